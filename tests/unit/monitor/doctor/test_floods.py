"""What is said about senders that flood the bus, and about sessions of other programs."""

from typing import Any

import pytest

from support.team_facts import problems, team_facts
from zteam.monitor.doctor.checks import check_strangers, check_team, is_flood
from zteam.monitor.doctor.facts import Load


def load(**changes: Any) -> Load:
    """A plain session that sends on one key."""
    usual: dict[str, Any] = {"writer": "session abc", "known": False, "key": "junk", "keys": 1, "bytes_rate": 100.0}
    given = {**usual, "rate": 10.0, **changes}
    return Load(**{"total_rate": given["rate"], **given})


@pytest.mark.parametrize(
    ("sent", "tick_rate", "is_one"),
    [
        (load(rate=400.0), 10.0, False),
        (load(rate=5000.0), 10.0, True),
        (load(rate=1.0, total_rate=5000.0, keys=5000), 10.0, True),
        (load(bytes_rate=50e6), 10.0, True),
        (load(known=True, rate=1000.0, total_rate=20_000.0, keys=20, bytes_rate=25e6), 1000.0, False),
        (load(known=True, rate=1000.0), 10.0, True),
    ],
)
def test_what_is_a_flood(sent: Load, tick_rate: float, is_one: bool) -> None:
    """Many messages on one key, or on many, or many bytes; a simulator that ticks fast sends as much by right."""
    assert is_flood(sent, tick_rate) == is_one


def test_a_flood_is_named() -> None:
    """Its sender, its key and its rate; the sessions of other programs are a note of their own."""
    stranger = "session abc, tcp/10.0.0.7:40000"
    facts = team_facts(loads=[load(rate=5000.0, keys=2), load(known=True, writer="sim")], strangers=[stranger])
    text = "session abc floods junk and 1 other key: 5000 messages a second, 0.0 MB/s"
    assert problems(check_team(facts)) == [("load", text, "end or mend session abc: see the sessions")]
    (note,) = check_strangers(facts)
    assert (note.level, stranger in note.text) == ("note", True)
    assert not list(check_strangers(team_facts()))
