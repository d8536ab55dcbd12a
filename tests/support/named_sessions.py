"""Sessions on a bus in memory that tools take for processes of zteam."""

from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.bus.presence import own_info
from zteam.bus.transport import RawSample


def open_named(hub: MemoryHub, name: str) -> Bus:
    """A session that answers as the process `name`: its token, its information and its counters."""
    bus = hub.bus()
    bus.serve(names.info_key(name), NoRequest, lambda _: own_info(name, bus.instance, 0))
    bus.serve_stats(name)
    bus.declare_token(names.token_key(name, bus.instance))
    return bus


def ignore(_sample: RawSample) -> None:
    """Take a sample."""
