"""How a robot moves, by the simulator's ground truth and its commands. Pure. Stamps are simulated ns."""

import math

import msgspec

from zteam.clock import to_seconds
from zteam.messages import Odometry, ns_from_time

SLOWEST = 0.05
"""m/s, or rad/s, below which a robot stands."""


class Motion(msgspec.Struct):
    """The motion of one robot. It receives ground truth and commands in the bus's order."""

    stamp: int = 0
    """Of the newest truth."""
    world: int = 0
    """How often the world began anew."""
    tick: int = 0
    """The shortest time between two truths."""
    speed: float = 0.0
    moved: int = -1
    """Of the newest truth in which it moved."""
    started: int = -1
    """Since when it has moved, or moved last."""
    halted: int = 0
    """Since when it has stood, or stood last."""
    commanded: int | None = None
    """Of its last command; None before the first."""
    commanded_at: float = 0.0
    """Host time of that."""
    silent: int = 0
    """How long before the newest truth that was; 0 while the robot stands or brakes: it brakes as fast as it can."""
    distance: float = 0.0
    """Metres driven in this world. A robot that is put elsewhere has not driven there."""

    @property
    def moves(self) -> bool:
        """Whether it moved in the newest truth."""
        return self.speed >= SLOWEST

    def moved_since(self, world: int, stamp: int) -> bool:
        """Whether it has moved later than at this time of this world."""
        return (self.world, self.moved) > (world, stamp)

    def begin_anew(self) -> None:
        """The world has begun anew."""
        self.world, self.moved, self.commanded, self.distance = self.world + 1, -1, None, 0.0
        self.speed, self.stamp = 0.0, 0

    def take_command(self, now: int, host: float) -> None:
        """A command at the time `now` and the host time `host`. Before the first truth its time is not known."""
        if self.stamp:
            self.commanded, self.commanded_at = max(self.stamp, now), host

    def take_truth(self, truth: Odometry) -> None:
        """The simulator's truth."""
        stamp, twist = ns_from_time(truth.header.stamp), truth.twist.twist
        if stamp < self.stamp:
            self.begin_anew()
        elif stamp > self.stamp > 0:
            self.tick = min(stamp - self.stamp, self.tick or stamp)
            # By its velocity in this tick: the pose also changes where a robot is moved, or comes back to the world.
            self.distance += math.hypot(twist.linear.x, twist.linear.y) * to_seconds(self.tick)
        before, moved, self.stamp, self.silent = self.speed, self.moves, stamp, 0
        self.speed = max(abs(twist.linear.x), abs(twist.linear.y), abs(twist.angular.z))
        if not self.moves:
            self.halted = stamp if moved else self.halted
            return
        self.moved, self.started = stamp, self.started if moved else stamp
        if self.commanded is not None and self.speed >= before:
            self.silent = stamp - self.commanded
