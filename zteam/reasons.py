"""Why a robot stands: words for people, and what programs go by."""


class Reason(str):
    """A reason in words that also says which robot it is about. Nothing compares its words."""

    waits_for: int
    """The robot that it waits for: one before it in its line, one that is silent or lost; -1 = none."""
    blocked_by: int
    """The robot that its safety layer stops it before; -1 = none."""
    slows: bool
    """Whether the robot is only slowed, because it does not see where it drives."""

    def __new__(cls, text: str, *, waits_for: int = -1, blocked_by: int = -1, slows: bool = False) -> "Reason":
        """`text` with these."""
        made = super().__new__(cls, text)
        made.waits_for, made.blocked_by, made.slows = waits_for, blocked_by, slows
        return made

    @classmethod
    def of(cls, text: str) -> "Reason":
        """A text that may be a Reason already."""
        return text if isinstance(text, Reason) else cls(text)
