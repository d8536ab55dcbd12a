"""Why a robot stands: words for people, and what programs go by."""

from enum import Enum, auto


class Cause(Enum):
    """Of what kind a reason is, where that matters."""

    OTHER = auto()
    OBSTACLE_AHEAD = auto()
    UNSEEN = auto()
    """The robot drives slowly, because it does not see where it drives."""


class Reason(str):
    """A reason in words that also says which robot it is about. Nothing compares its words."""

    waits_for: int
    """The robot that it waits for: one before it in its line, one that is silent or lost; -1 = none."""
    blocked_by: int
    """The robot that its safety layer stops it before; -1 = none."""
    cause: Cause

    def __new__(cls, text: str, *, waits_for: int = -1, blocked_by: int = -1, cause: Cause = Cause.OTHER) -> "Reason":
        """`text` with these."""
        made = super().__new__(cls, text)
        made.waits_for, made.blocked_by, made.cause = waits_for, blocked_by, cause
        return made

    @classmethod
    def of(cls, text: str) -> "Reason":
        """A text that may be a Reason already."""
        return text if isinstance(text, Reason) else cls(text)
