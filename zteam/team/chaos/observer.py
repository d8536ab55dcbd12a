"""What the bus tells of a team under faults: time, presence, and how the robots move by the simulator's own truth."""

import math
import threading

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.lateness import LATE
from zteam.clock import HOST_FACTOR, monotonic, to_ns, to_seconds
from zteam.messages import Clock, Odometry, RobotStatus, TeamState, TeamStatus, Twist, ns_from_time
from zteam.node.tokens import RETURN_GRACE, TokenSet

SLOWEST = 0.05
"""m/s, or rad/s, below which a robot stands."""
ALLOWED = to_ns(0.2)
"""Simulated time after which the base stops without a command; one tick is added, for the command under way."""
ON_ITS_WAY = (0.3 + LATE) * HOST_FACTOR
"""Host seconds for which, in real time, a command that this process has got may not have reached the simulator."""


class Violation(msgspec.Struct, frozen=True):
    """A robot moved on without commands."""

    name: str
    at: float
    """Simulated seconds."""
    silent: float
    """Simulated seconds since its last command."""
    speed: float


class Motion(msgspec.Struct):
    """How one robot moves. Pure: it is fed with what the bus tells, in its order. Stamps are simulated ns."""

    name: str
    stamp: int = 0
    """Of the newest truth."""
    world: int = 0
    """How often the world began anew."""
    tick: int = 0
    """Between two truths."""
    speed: float = 0.0
    moved: int = -1
    """Of the newest truth in which it moved."""
    started: int = -1
    """From when on it has moved, or moved last."""
    halted: int = 0
    """From when on it has stood, or stood last."""
    commanded: int | None = None
    """Of its last command; None before the first."""
    heard: float = 0.0
    """Host time of that."""
    reason: str = ""
    """Why it stands, in its own words."""

    @property
    def moves(self) -> bool:
        """Whether it moved in the newest truth."""
        return self.speed >= SLOWEST

    def moved_since(self, world: int, stamp: int) -> bool:
        """Whether it has moved later than at this time of this world."""
        return (self.world, self.moved) > (world, stamp)

    def take_truth(self, stamp: int, speed: float, quiet: float) -> Violation | None:
        """The simulator's truth of this time; a violation if the watchdog should have stopped the robot.

        `quiet` is host seconds since its last command; infinite in lock-step, where no command is on its way.
        """
        if stamp < self.stamp:
            self.world += 1
            self.moved, self.commanded, self.speed, self.stamp = -1, None, 0.0, 0
        elif stamp > self.stamp > 0:
            self.tick = min(stamp - self.stamp, self.tick or stamp)
        before, moved, self.speed, self.stamp = self.speed, self.moves, speed, stamp
        if not self.moves:
            self.halted = stamp if moved else self.halted
            return None
        self.moved, self.started = stamp, self.started if moved else stamp
        if self.commanded is None or speed < before:
            # It brakes as fast as it can.
            return None
        silent = stamp - self.commanded
        if silent <= ALLOWED + self.tick or quiet <= ON_ITS_WAY:
            return None
        return Violation(self.name, to_seconds(stamp), to_seconds(silent), speed)


class Observer:
    """Subscribes to a team. `changed` is notified with the clock and with tokens."""

    def __init__(self, bus: Bus, *, lockstep: bool, simulated: bool = True) -> None:
        """Without a simulator (`simulated` False) time is the host's, from now on."""
        self._lockstep = lockstep
        self._linked = monotonic()
        """Host time of the newest change of the link."""
        self.changed = threading.Condition(threading.RLock())
        self.robots: dict[str, Motion] = {}
        self.violations: list[Violation] = []
        self.has_go = not simulated
        self._since = None if simulated else monotonic()
        self._elapsed = 0
        self._now = 0
        self._tokens = TokenSet()
        # One thread of the bus takes commands and truths, in the order in which they come.
        bus.subscribe(names.all_robots_key(names.GROUND_TRUTH), Odometry, self._on_truth)
        bus.subscribe(names.all_robots_key(names.CMD_VEL), Twist, self._on_command)
        bus.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._on_status)
        bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        bus.subscribe(names.CLOCK, Clock, self._on_clock)
        bus.watch_tokens([names.tokens_key()], self._on_token)
        bus.watch_link(self._on_link)

    @property
    def now(self) -> int:
        """Simulated ns; it goes back when the world begins anew."""
        return self._now

    @property
    def elapsed(self) -> float:
        """Simulated seconds since GO that this process has seen, however often the world began anew."""
        return to_seconds(self._elapsed) if self._since is None else monotonic() - self._since

    def reaches(self, at: float) -> bool:
        """Whether it is so many simulated seconds after GO, and all that moves has been seen."""
        return self.has_go and self.elapsed >= at and self.elapsed > 0.0

    def alive(self, name: str) -> bool:
        """Whether a process holds this name."""
        return name in self._tokens

    def instances(self, name: str) -> frozenset[str]:
        """The sessions that hold this name."""
        return self._tokens.instances(name)

    def present(self) -> list[str]:
        """The names that are held."""
        return sorted(self._tokens)

    def driving(self) -> list[str]:
        """The robots that move."""
        return sorted(robot.name for robot in self.robots.values() if robot.moves)

    def _on_truth(self, key: str, message: Odometry) -> None:
        twist = message.twist.twist
        speed = max(abs(twist.linear.x), abs(twist.linear.y), abs(twist.angular.z))
        with self.changed:
            robot = self._robot(key)
            if robot is None:
                return
            # A simulator that has just found its link publishes no command before it knows of this subscriber.
            is_exact = self._lockstep and monotonic() > self._linked + RETURN_GRACE
            quiet = math.inf if is_exact else monotonic() - robot.heard
            found = robot.take_truth(ns_from_time(message.header.stamp), speed, quiet)
            if found is not None:
                self.violations.append(found)

    def _on_command(self, key: str, _command: Twist) -> None:
        with self.changed:
            robot = self._robot(key)
            # Before the first truth its time is not known.
            if robot is not None and robot.stamp:
                robot.commanded, robot.heard = max(robot.stamp, self._now), monotonic()

    def _on_status(self, key: str, status: RobotStatus) -> None:
        with self.changed:
            if (robot := self._robot(key)) is not None:
                robot.reason = status.reason

    def _robot(self, key: str) -> Motion | None:
        target = names.split_robot_key(key)
        if target is None:
            return None
        name = names.robot_name(target[0])
        return self.robots.setdefault(name, Motion(name))

    def _on_clock(self, _key: str, message: Clock) -> None:
        with self.changed:
            before, self._now = self._now, ns_from_time(message.clock)
            if self.has_go and before:
                self._elapsed += max(0, self._now - before)
            self.changed.notify_all()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        with self.changed:
            if status.state == TeamState.GO and not self.has_go:
                self.has_go = True
            self.changed.notify_all()

    def _on_link(self, _up: bool) -> None:
        # Commands were lost, and after the link is back a truth may come before the first command.
        with self.changed:
            self._linked = monotonic()
            for robot in self.robots.values():
                robot.commanded = None

    def _on_token(self, key: str, alive: bool) -> None:
        if (token := names.split_token_key(key)) is not None:
            with self.changed:
                self._tokens.take(*token, alive)
                self.changed.notify_all()
