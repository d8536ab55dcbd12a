"""What zteam asks of routers in Zenoh's admin space."""

import re
from pathlib import Path

import zteam

ADMIN_QUERY = re.compile(r"""\bget\(\s*f?["'](@/[^"']*)["']""")
OWN_RECORD = {"@/{zid}/router"}
"""`zid` is a router's id."""


def test_a_router_is_asked_for_its_own_record_alone() -> None:
    """Other queries of the admin space may stop a router for ever (`zteam/bus/bus.py`)."""
    sources = [path.read_text(encoding="utf-8") for path in Path(zteam.__file__).parent.rglob("*.py")]
    assert {key for source in sources for key in ADMIN_QUERY.findall(source)} == OWN_RECORD
