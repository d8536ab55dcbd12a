"""Whether robots of a team under faults move on without commands."""

import math

import msgspec

from zteam import names
from zteam.bus.lateness import LATE
from zteam.clock import HOST_FACTOR, monotonic, to_ns, to_seconds
from zteam.messages import Odometry
from zteam.monitor.observer import LINK, RobotView, TeamObserver
from zteam.node.tokens import RETURN_GRACE

ALLOWED = to_ns(0.2)
"""Simulated time after which the base stops without a command; one tick is added, for the command under way."""
ON_ITS_WAY = (0.3 + LATE) * HOST_FACTOR
"""Host seconds for which, in real time, a command that this process has received may not have reached the simulator."""


class Violation(msgspec.Struct, frozen=True):
    """A robot moved on without commands."""

    name: str
    at: float
    """Simulated seconds."""
    silent: float
    """Simulated seconds since its last command."""
    speed: float


class Watchdog:
    """Observes the motion of a team, and finds the violations."""

    def __init__(self, team: TeamObserver, *, lockstep: bool, simulated: bool = True) -> None:
        """Without a simulator (`simulated` False) time is the host's, from now on."""
        self.team, self._lockstep = team, lockstep
        self._linked = monotonic()
        """Host time of the newest change of the link."""
        self._since = None if simulated else monotonic()
        self.violations: list[Violation] = []
        team.on(LINK, self._on_link)
        team.on(names.GROUND_TRUTH, self._on_truth)
        team.observe(names.GROUND_TRUTH, names.CMD_VEL, names.STATUS, names.TEAM_STATUS, names.CLOCK)

    @property
    def elapsed(self) -> float:
        """Simulated seconds since GO that were observed, however often the world began anew."""
        return to_seconds(self.team.elapsed) if self._since is None else monotonic() - self._since

    def reaches(self, at: float) -> bool:
        """Whether it is so many simulated seconds after GO, and all that moves has been observed."""
        return self.elapsed >= at and self.elapsed > 0.0

    def driving(self) -> list[RobotView]:
        """The robots that move."""
        return [robot for _, robot in sorted(self.team.robots.items()) if robot.motion.moves]

    def _on_truth(self, robot: RobotView, _truth: Odometry) -> None:
        motion = robot.motion
        # A simulator that has just found its link publishes no command before it knows of this subscriber.
        is_exact = self._lockstep and monotonic() > self._linked + RETURN_GRACE
        quiet = math.inf if is_exact else monotonic() - motion.commanded_at
        if motion.silent > ALLOWED + motion.tick and quiet > ON_ITS_WAY:
            silent = to_seconds(motion.silent)
            self.violations.append(Violation(robot.name, to_seconds(motion.stamp), silent, motion.speed))

    def _on_link(self, *_: object) -> None:
        # Commands were lost, and after the link is back a truth may come before the first command.
        with self.team.changed:
            self._linked = monotonic()
            for robot in self.team.robots.values():
                robot.motion.commanded = None
