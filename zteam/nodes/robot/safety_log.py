"""The safety layer's lines in the robot's log: one when it stops the robot, one when the way is free again."""

import logging
import math

from zteam.behaviors import View
from zteam.behaviors.safety.layer import UNSEEN_CAUSE
from zteam.behaviors.safety.motion import DRIVE_MARGIN
from zteam.behaviors.scans import look_along
from zteam.clock import to_ns
from zteam.messages import RobotDriver, Twist

log = logging.getLogger("zteam")

_AHEAD = "obstacle ahead"
FREE_AFTER = to_ns(1.0)
"""Simulated ns that the way has to be free before the log says so: at the edge of a stop it comes and goes."""


class SafetyLog:
    """Fed with every step: what the driver wanted, and why that was stopped."""

    def __init__(self, behavior: str) -> None:
        """`behavior` is the name that the lines show of it."""
        self._behavior = behavior
        self._began: int | None = None
        """Time of the stop (ns); None while there is none."""
        self._stands = False
        """Whether a line has said that it was stopped, and not only slowed."""
        self._free: int | None = None
        """Time since which the robot may drive again (ns)."""
        self._stopped: int | None = None
        """Time of the newest step that was stopped (ns)."""

    def stopped_at(self, now: int) -> bool:
        """Whether the step of time `now` (ns) was stopped."""
        return self._stopped == now

    def take(self, driver: str, wanted: Twist, trouble: str, view: View) -> None:
        """A step: `driver` wanted a velocity; `trouble` says why that was stopped, empty if it was not."""
        if trouble:
            self._free, self._stopped = None, view.now
            stands = not trouble.startswith(UNSEEN_CAUSE)
            if self._began is None or (stands and not self._stands):
                self._began, self._stands = self._began or view.now, stands
                wanting = self._behavior if driver == RobotDriver.BEHAVIOR else driver
                verb = "stopped" if stands else "slowed"
                log.info("safety: %s %s (%.2f m/s): %s", verb, wanting, wanted.linear.x, _cause(trouble, view))
        elif self._began is not None and wanted.linear.x:
            self._free = view.now if self._free is None else self._free
            if view.now - self._free >= FREE_AFTER:
                log.info("safety: the way is free again after %.1f s", (self._free - self._began) / 1e9)
                self._began = self._free = None
                self._stands = False


def _cause(trouble: str, view: View) -> str:
    if trouble != _AHEAD or view.scan is None:
        return trouble
    away = look_along(view.scan, view.base.half_width + DRIVE_MARGIN)
    return f"obstacle {away:.2f} m ahead of the laser" if math.isfinite(away) else trouble
