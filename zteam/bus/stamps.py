"""Time stamps of samples: each session makes its own.

Zenoh's own stamps need clocks that agree. A session or router that makes them refuses those that are more than 0.5 s
ahead of its clock: it writes another one with its own id, so the sender is no longer known. And it takes over a
clock that is less far ahead: between two messages from there its own stamps stand still.
"""

from collections.abc import Callable

import zenoh

from zteam.clock import NS_PER_S, stamp_ns, to_seconds


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
