"""The simulator's query `sim/scans`: what lasers saw in the last tick."""

import msgspec


class ScansRequest(msgspec.Struct):
    """Asked of `sim/scans`."""

    robots: list[int]


class SensedScan(msgspec.Struct):
    """A laser's newest scan."""

    key: str
    """On which it was sent, if that had subscribers."""
    content: bytes
    """The encoded LaserScan."""


class ScansReply(msgspec.Struct):
    """Answer to `sim/scans`: what the lasers of these robots saw in the last tick."""

    scans: list[SensedScan]
