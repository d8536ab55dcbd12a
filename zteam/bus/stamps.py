"""Time stamps of samples: each session makes its own, and notices senders whose clock is ahead.

Zenoh's own stamps need clocks that agree. A session or router that makes them refuses those that are more than 0.5 s
ahead of its clock: it writes another one with its own id, so the sender is no longer known. And it takes over a
clock that is less far ahead: between two messages from there its own stamps stand still.
"""

import logging
from collections.abc import Callable

import zenoh

from zteam.clock import APART, NS_PER_S, stamp_ns, to_seconds

log = logging.getLogger("zteam.bus")

_MAX_SENDERS = 4096
"""A sender can invent ids; beyond this many they are not looked at."""


def stamping_as(session: str) -> Callable[[], zenoh.Timestamp]:
    """Makes time stamps with the id of a session, each later than the one before; their clock is never set."""
    # As Zenoh writes its ids: the last byte comes first, and zeros at the front are left out.
    name = zenoh.TimestampId(bytes.fromhex(session.zfill(2 * -(-len(session) // 2)))[::-1])
    make, time = zenoh.Timestamp, zenoh.NTP64
    return lambda: make(time(*divmod(stamp_ns(), NS_PER_S)), name)


def read_stamp(text: str) -> tuple[int, str, float]:
    """What a sample's time stamp tells when the sample comes: time, session, delay; as the fields of RawSample."""
    # "<NTP64>/<id>": the only exact form that Python gets.
    time, _, session = text.partition("/")
    if not time:
        return 0, "", 0.0
    stamp = int(time)
    return stamp, session, to_seconds(stamp_ns() - (stamp * NS_PER_S >> 32))


class ClockWatch:
    """Warns once if a sender's clock is ahead. One that is behind cannot be told from a message that took its time."""

    def __init__(self) -> None:
        self._seen: set[str] = set()
        self._told = False

    def look(self, session: str, delay: float) -> None:
        """A sample has come with this delay (s); only a session's first one is judged."""
        seen = self._seen
        if session in seen or self._told or len(seen) >= _MAX_SENDERS:
            return
        seen.add(session)
        if -delay > APART:
            # One warning: whole hosts are ahead, not single sessions.
            self._told = True
            text = "the clock of session %s is %.2f s ahead of this process's: 'zteam doctor' compares the hosts"
            log.warning(text, session, -delay)
