"""How long lock-step waits for the answers to one tick. Pure: it is told how long the tick has been open."""

from enum import Enum, auto

RESEND = 0.05
"""Host seconds until a tick is sent again. The time doubles with each repeat, up to MAX_RESEND."""
MAX_RESEND = 0.5
NAME_AFTER = 1.0
"""Host seconds until the log names the participants that hold the world."""
_NAME_EVERY = 5.0
"""Host seconds between two such lines in the log."""


class Silence(Enum):
    """What to do about participants that have not answered."""

    WAIT = auto()
    NAME = auto()
    """Name them in the log."""
    DROP = auto()
    """Go on without them."""


class Patience:
    """The schedule of repeats, warnings and the time-out of one tick."""

    def __init__(self, timeout: float) -> None:
        """`timeout` in host seconds."""
        self._timeout = timeout
        self.delay = RESEND
        """Host seconds until the next repeat."""
        self._next_name = NAME_AFTER
        """Host seconds of waiting after which the silent participants are named next."""

    def lengthen(self) -> None:
        """The tick was sent again: the next repeat comes later."""
        self.delay = min(MAX_RESEND, 2.0 * self.delay)

    def judge(self, waited: float, held: bool) -> Silence:
        """What to do after `waited` host seconds. A `held` first tick has no time-out: a start may take any time."""
        if waited > self._timeout and not held:
            self._next_name = NAME_AFTER
            return Silence.DROP
        if waited > self._next_name:
            self._next_name = waited + _NAME_EVERY
            return Silence.NAME
        return Silence.WAIT
