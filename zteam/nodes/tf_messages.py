"""Requests and replies of the aggregator's queries: `tf/static`, `tf/lookup`, `tf/frames`."""

import msgspec


class StaticRequest(msgspec.Struct):
    """Hang `child` under `parent` at x, y, z (m) and the quaternion, for as long as the caller's session lives."""

    parent: str
    child: str
    instance: str
    """The caller's session; it shows it with a token `static/alive/<instance>`."""
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0


class StaticReply(msgspec.Struct):
    """`refused` says why not; empty if the transform holds."""

    refused: str = ""


class LookupRequest(msgspec.Struct):
    """The pose of `source` in `target` at `time` (ns; 0 = latest common)."""

    target: str
    source: str
    time: int = 0


class LookupReply(msgspec.Struct):
    """A transform, or the exception's name and text."""

    stamp: int = 0
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    error: str = ""
    text: str = ""


class FrameReply(msgspec.Struct):
    """One frame of `tf/frames`; times in ns, rate in Hz."""

    parent: str
    authority: str
    static: bool
    rate: float
    oldest: int
    newest: int
    samples: int
