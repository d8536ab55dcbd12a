"""The aggregator's queries `tf/static`, `tf/lookup`, `tf/history`, `tf/frames` and `tf/newest`."""

from typing import Annotated

import msgspec

from zteam.bus import Change

MAX_LOOKUPS = 10_000
"""Of one request; rows of one history."""
MAX_WAIT = 60.0
"""Seconds that a look-up may be waited for."""
MAX_COORDINATE = 1e9
"""Metres of a fixed transform at most, either way."""
Coordinate = Annotated[float, msgspec.Meta(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
MAX_TIME = 2**62
"""Nanoseconds, either way."""
Nanoseconds = Annotated[int, msgspec.Meta(ge=-MAX_TIME, le=MAX_TIME)]


class StaticRequest(Change):
    """Hang `child` under `parent` at x, y, z (m) and the quaternion, for as long as the caller's session lives."""

    parent: str
    child: str
    caller: str
    """The caller's session id; its token `static/alive/<caller>` shows that it lives."""
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Coordinate = 0.0
    qx: Coordinate = 0.0
    qy: Coordinate = 0.0
    qz: Coordinate = 0.0
    qw: Coordinate = 1.0


class StaticReply(msgspec.Struct):
    """`refused` says why not; empty if the transform holds."""

    refused: str = ""


class Lookup(msgspec.Struct):
    """The pose of `source` in `target` at `time` (ns; 0 = latest common).

    With `fixed`, a frame that does not move: of `source` as it was at `source_time`, in `target` as it was at `time`.
    """

    target: str
    source: str
    time: Nanoseconds = 0
    fixed: str = ""
    source_time: Nanoseconds = 0


class LookupRequest(msgspec.Struct):
    """One or many look-ups, answered in this order; those that cannot be yet are waited for, `timeout` s in all."""

    lookups: Annotated[list[Lookup], msgspec.Meta(max_length=MAX_LOOKUPS)]
    timeout: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_WAIT)] = 0.0


class LookupReply(msgspec.Struct):
    """A transform, or the exception's name and text."""

    stamp: int = 0
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    error: str = ""
    text: str = ""


class HistoryRequest(msgspec.Struct):
    """The poses of `source` in `target` every `step` ns from `start` to `end` (ns).

    `end` 0 is the latest common time; a `start` of 0 or below is counted from the end.
    """

    target: str
    source: str
    step: Annotated[int, msgspec.Meta(ge=1, le=MAX_TIME)]
    start: Nanoseconds = 0
    end: Nanoseconds = 0


class HistoryReply(msgspec.Struct):
    """Rows of stamp (ns), x, y, z, qx, qy, qz, qw, oldest first; instants without data are left out."""

    rows: list[tuple[int, float, float, float, float, float, float, float]]


class BundleReply(msgspec.Struct):
    """Answer to `tf/newest`: the bundle that was sent last."""

    content: bytes
    """The encoded TFMessage."""


class FrameReply(msgspec.Struct):
    """One frame of `tf/frames`; times in ns, rate in Hz."""

    parent: str
    authority: str
    static: bool
    rate: float
    oldest: int
    newest: int
    samples: int
