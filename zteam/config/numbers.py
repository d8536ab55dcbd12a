"""Numbers that users type, numbers in words, and percentiles.

A typed number has bounds: a number that is too large would fail far from the place where it was typed.
"""

from collections.abc import Iterable
from typing import Annotated, TypeVar

import msgspec

from zteam.errors import UsageError
from zteam.geometry import FAR
from zteam.names import MAX_ROBOT_ID

N = TypeVar("N", int, float)
MAX_SECONDS = 1e9
"""Thirty years: longer than any run, and within the range of 64-bit nanoseconds and of time-outs."""
Positive = Annotated[float, msgspec.Meta(ge=1e-3, le=1000.0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)]
"""In SI units: what a robot and its surroundings have."""
Signed = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
Coordinate = Annotated[float, msgspec.Meta(ge=-FAR, le=FAR)]
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=MAX_SECONDS)]
Count = Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]
RobotId = Annotated[int, msgspec.Meta(ge=0, le=MAX_ROBOT_ID)]


def shown(text: str) -> str:
    """A refused text, quoted, of which an error repeats 24 characters."""
    word = text.strip()
    return repr(word if len(word) <= 24 else f"{word[:24]}…")


def parse_number(text: str, low: N, high: N, what: str) -> N:
    """The number from `low` to `high` that a user typed, whole if these are. Raises UsageError that asks for `what`."""
    form = "d" if isinstance(low, int) else "g"
    try:
        # Python also reads `1_0`, `+1` and the digits of all scripts; Zenoh does not.
        is_plain = text.isascii() and "_" not in text and not text.startswith("+")
        if is_plain and low <= (value := type(low)(text)) <= high:
            return value
    except ValueError:
        # Also a number of thousands of digits.
        pass
    raise UsageError(f"{shown(text)}: give {what} from {low:{form}} to {high:{form}}")


def counted(count: float, noun: str, plural: str = "") -> str:
    """A count and its noun: `1 robot`, `2 robots`; `plural` is for a noun that does not only take an s."""
    shown = f"{count}" if isinstance(count, int) else f"{count:g}"
    return f"{shown} {noun if count == 1 else plural or f'{noun}s'}"


def format_factor(factor: float) -> str:
    """A real-time factor with no more digits than are known: `0.98`, `20.7`, `1234`."""
    return f"{factor:.2f}" if factor < 10.0 else f"{factor:.1f}" if factor < 100.0 else f"{factor:.0f}"


def format_rate(rate: float) -> str:
    """A rate in Hz without digits that are only jitter."""
    return f"{rate:.1f} Hz" if rate >= 1.0 else f"{rate:.2g} Hz"


def percentile(values: Iterable[float], share: float) -> float | None:
    """The value at a `share` (0 to 1) of the way through the sorted values; None where there are no values."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else None
