"""The safety layer's lines in the robot's log: one when it stops the robot, one when the way is free again."""

import logging

from zteam.behaviors import View
from zteam.behaviors.safety import OBSTACLE, obstacle_distance
from zteam.clock import to_ns
from zteam.messages import Twist

log = logging.getLogger("zteam")

FREE_AFTER = to_ns(1.0)
"""Simulated ns that the way has to be free before the log says so: at the edge of a stop it comes and goes."""


class SafetyLog:
    """Fed with every step: what the behaviour wanted, and why that was stopped."""

    def __init__(self, behavior: str) -> None:
        """`behavior` is the name that the lines show."""
        self._behavior = behavior
        self._began: int | None = None
        """Time of the stop (ns); None while there is none."""
        self._free: int | None = None
        """Time since which the robot may drive forwards again (ns)."""
        self._stopped: int | None = None
        """Time of the newest step that was stopped (ns)."""

    def stopped_at(self, now: int) -> bool:
        """Whether the step of time `now` (ns) was stopped."""
        return self._stopped == now

    def take(self, wanted: Twist, trouble: str, view: View) -> None:
        """A step: `trouble` says why the safety layer stopped the command; empty if it did not."""
        if trouble:
            self._free, self._stopped = None, view.now
            if self._began is None:
                self._began = view.now
                log.info("safety: stopped %s (%.2f m/s): %s", self._behavior, wanted.linear.x, _cause(trouble, view))
        elif self._began is not None and wanted.linear.x > 0.0:
            self._free = view.now if self._free is None else self._free
            if view.now - self._free >= FREE_AFTER:
                log.info("safety: the way is free again after %.1f s", (self._free - self._began) / 1e9)
                self._began = self._free = None


def _cause(trouble: str, view: View) -> str:
    if trouble != OBSTACLE or view.scan is None:
        return trouble
    return f"obstacle {obstacle_distance(view.scan, view.base.half_width):.2f} m ahead of the laser"
