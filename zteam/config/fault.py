"""One fault on purpose, as users write it in a plan."""

from typing import Annotated, Literal, get_args

import msgspec

from zteam.config.numbers import MAX_SECONDS, Seconds
from zteam.config.problems import CheckedOptions

FaultKind = Literal["kill", "pause", "cut", "slow"]
KINDS: tuple[FaultKind, ...] = get_args(FaultKind)


class Fault(CheckedOptions, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A process of a team is killed or stopped, or its link is cut or made slow. Raises ValueError out of range."""

    at: Seconds
    """Simulated seconds after GO at which it begins."""
    fault: FaultKind
    """`pause` freezes a process, `cut` lets nothing pass on its link, `slow` lets it pass later."""
    name: str
    """Of the process: `robot_1`, `sim`, `router`, …"""
    seconds: Annotated[float, msgspec.Meta(ge=1e-3, le=MAX_SECONDS)] = msgspec.field(name="for", default=3.0)
    """How long it lasts; a kill has no end."""
    delay: Seconds = 0.5
    """`slow`: seconds that each message takes longer, in each direction."""
    rate: Annotated[float, msgspec.Meta(ge=1.0, le=1e12)] | None = None
    """`slow`: bytes a second that pass in each direction at most."""

    @property
    def lasts(self) -> float:
        """Seconds until its end; 0 for a kill."""
        return 0.0 if self.fault == "kill" else self.seconds
