"""One fault on purpose, as users write it in a plan."""

import math
from typing import Literal, get_args

import msgspec

from zteam.config.numbers import MAX_SECONDS
from zteam.config.problems import KeyValueError

FaultKind = Literal["kill", "pause", "cut", "slow"]
KINDS: tuple[FaultKind, ...] = get_args(FaultKind)


class Fault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A process of a team is killed or stopped, or its link is cut or made slow. Raises ValueError out of range."""

    at: float
    """Simulated seconds after GO at which it begins."""
    fault: FaultKind
    """`pause` freezes a process, `cut` lets nothing pass on its link, `slow` lets it pass later."""
    name: str
    """Of the process: `robot_1`, `sim`, `router`, …"""
    seconds: float = msgspec.field(name="for", default=3.0)
    """How long it lasts; a kill has no end."""
    delay: float = 0.5
    """`slow`: seconds that each message takes longer, in each direction."""
    rate: float | None = None
    """`slow`: bytes a second that pass in each direction at most."""

    def __post_init__(self) -> None:
        for name, value, low in (("at", self.at, 0.0), ("for", self.seconds, 1e-3), ("delay", self.delay, 0.0)):
            if not low <= value <= MAX_SECONDS:
                raise KeyValueError(name, f"must be from {low:g} to {MAX_SECONDS:g} s, not {value:g}")
        if self.rate is not None and not 1.0 <= self.rate < math.inf:
            raise KeyValueError("rate", f"must be 1 byte a second or more, not {self.rate:g}")

    @property
    def lasts(self) -> float:
        """Seconds until its end; 0 for a kill."""
        return 0.0 if self.fault == "kill" else self.seconds
