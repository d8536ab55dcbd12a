"""Which reasons a log prints. Pure."""

from zteam.clock import to_ns

REST = to_ns(5.0)
"""Nanoseconds for which a reason has to be gone until it is printed again."""
_MOST = 4
"""Reasons that are printed within REST: one that has a number in it may be another one in each step."""


class ReasonLog:
    """A reason is printed once until it changes, and not again and again while two of them take turns."""

    def __init__(self) -> None:
        self._logged: dict[str, int] = {}
        """By reason: when it held last."""

    def admit(self, reason: str, now: int, *, is_known: bool = False) -> bool:
        """Whether to print a reason that holds at time `now` (ns); not if it `is_known` to the reader already.

        Called in each step, or with each change alone.
        """
        logged = self._logged = {each: held for each, held in self._logged.items() if abs(now - held) < REST}
        if not reason or (reason not in logged and len(logged) >= _MOST):
            return False
        is_new = reason not in logged
        logged[reason] = now
        return is_new and not is_known
