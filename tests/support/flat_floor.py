"""A flat floor for behaviours, in the simulator: walls as segments, robots with a laser that sees both. Nothing stops a
robot that drives into a wall: tests ask for its clearance. No bus."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.behaviors import Behavior, SafetyLayer, View, decide
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.kernels.simulator import follow
from zteam.messages import LaserScan, Odometry, Quaternion, Twist
from zteam.robot.trials import situations
from zteam.robot.view import FindPose
from zteam.sim import Engine
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.simulator.world.model import Limits, Obstacle, Ranger, Robot, Shape, World

Segment = tuple[float, float, float, float]
"""x0, y0, x1, y1 in metres."""
TICK = 100_000_000
"""Nanoseconds: Stage's 10 Hz."""
BEAMS = 541
FOV = math.radians(270.25)
LASER = Pose2(0.05, 0.0, 0.0)
"""The erratic's laser in its base."""
ORIGIN = Pose2(0.0, 0.0, 0.0)
_RANGER = Ranger("laser", *LASER[:2], 0.3, 0.0, FOV, BEAMS, 0.0, situations.RANGE_MAX)
_HEAD = [(LASER.x + 0.03 * math.cos(a), 0.03 * math.sin(a)) for a in np.arange(8) * math.tau / 8]
"""What a laser sees of another robot: only the other laser stands at its height."""
_FAST = Limits((-9.0, 9.0), (-9.0, 9.0), (-9.0, 9.0))
_THIN = 1e-9
"""Metres of a wall to either side of its segment."""


def make_scan(ranges: Sequence[float] | NDArray[np.float64], stamp: int = TICK, fov: float = FOV) -> LaserScan:
    """A scan of evenly spread beams, 0 to 30 m."""
    return situations.make_scan(ranges, fov, stamp, 0)


def make_view(scan: LaserScan | None = None, *, now: int = TICK, **changes: object) -> View:
    """A view of robot 0 that knows nothing but a scan."""
    fields: dict[str, object] = {"dt": 0.1, "robot_id": 0, "odom": Odometry(), "lookup": lambda _a, _b: None}
    return View(now=now, scan=scan, **(fields | changes))  # type: ignore[arg-type]


def make_odometry(pose: Pose2) -> Odometry:
    """Odometry that says this pose."""
    odom = Odometry()
    odom.pose.pose.position.x, odom.pose.pose.position.y = pose.x, pose.y
    odom.pose.pose.orientation = Quaternion(*quaternion_from_yaw(pose.yaw))
    return odom


def box(x0: float, y0: float, x1: float, y1: float) -> list[Segment]:
    """Four walls."""
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


def _wall(wall: Segment) -> Obstacle:
    x0, y0, x1, y1 = wall
    length = math.hypot(x1 - x0, y1 - y0)
    pose = Pose2(x0, y0, math.atan2(y1 - y0, x1 - x0))
    corners = (0.0, -_THIN), (length, -_THIN), (length, _THIN), (0.0, _THIN)
    return Obstacle("wall", pose, (Shape(corners, 0.0, 1.0, obstacle=False),))


def _make_engine(poses: Sequence[Pose2], walls: Sequence[Segment], seed: int = 1) -> Engine:
    head = Shape(tuple(_HEAD), 0.2, 0.4, obstacle=False)
    robots = [Robot("robot", "flat", pose, (head,), (_RANGER,), velocity=_FAST) for pose in poses]
    return Engine(World("floor", TICK, (), tuple(map(_wall, walls)), tuple(robots)), seed=seed)


@lru_cache(1)
def _room(walls: tuple[Segment, ...], robots: int) -> Engine:
    return _make_engine([ORIGIN] * robots, walls)


def cast(laser: Pose2, walls: Sequence[Segment], others: Sequence[tuple[float, float]] = ()) -> NDArray[np.float64]:
    """Distances (BEAMS,) from the laser to the nearest wall or other laser, 30 m where there is none."""
    room = _room(tuple(walls), 1 + len(others))
    for robot_id, pose in enumerate([laser, *(Pose2(x, y, 0.0) for x, y in others)]):
        room.place(robot_id, pose.compose(LASER.inverse()))
    return room.observe().robots[0].readings[0].ranges.astype(np.float64)


def clearance(pose: Pose2, walls: Sequence[Segment]) -> float:
    """Metres from the base's centre to the nearest wall."""
    distances = []
    for x0, y0, x1, y1 in walls:
        ex, ey = x1 - x0, y1 - y0
        share = ((pose.x - x0) * ex + (pose.y - y0) * ey) / (ex * ex + ey * ey)
        share = max(0.0, min(1.0, share))
        distances.append(math.hypot(pose.x - x0 - share * ex, pose.y - y0 - share * ey))
    return min(distances, default=math.inf)


def drive(pose: Pose2, command: Twist, seconds: float) -> Pose2:
    """Where a base gets to: the exact arc."""
    velocity = np.array([(command.linear.x, command.linear.y, command.angular.z)])
    return Pose2(*follow(np.array([pose]), velocity, seconds)[0].tolist())


class Floor:
    """Robots 0, 1, … that all decide on the same instant and move together, tick by tick.

    `delay` is the age of all transforms in ticks; scans are of the instant.
    """

    def __init__(self, poses: Sequence[Pose2], walls: Sequence[Segment], seed: int = 1, delay: int = 0) -> None:
        self.walls = walls
        self.commands: list[tuple[Twist, str]] = []
        self._engine = _make_engine(poses, walls, seed)
        self._layers = [SafetyLayer() for _ in poses]
        self._seen = self._engine.step({})
        self._past = [self.poses] * (1 + delay)
        self._delay = delay

    @property
    def poses(self) -> list[Pose2]:
        """Where the robots are."""
        return [robot.truth for robot in self._seen.robots.values()]

    def place(self, robot_id: int, pose: Pose2) -> None:
        """Move a robot elsewhere."""
        self._engine.place(robot_id, pose)
        self._seen = self._engine.observe()

    def step(self, behaviors: Sequence[Behavior]) -> None:
        """One tick."""
        self.commands = [decide(b, self.view(i), self._layers[i]) for i, b in enumerate(behaviors)]
        self._seen = self._engine.step({i: command for i, (command, _) in enumerate(self.commands)})
        self._past = [*self._past[1:], self.poses]

    def view(self, robot_id: int) -> View:
        """What one robot knows now."""
        seen = self._seen
        scan, odom = scan_message(seen, robot_id, 0), odometry_message(seen, robot_id)
        lookup = self._lookup(max(1, seen.stamp - self._delay * TICK))
        seed = self._engine.seed
        return make_view(scan, now=seen.stamp, robot_id=robot_id, odom=odom, lookup=lookup, laser=LASER[:2], seed=seed)

    def _lookup(self, stamp: int) -> FindPose:
        known = {names.MAP_FRAME: ORIGIN}
        for i, pose in enumerate(self._past[0]):
            known[names.robot_frame(i, names.BASE_FOOTPRINT)] = pose
        return lambda target, source: (known[target].inverse().compose(known[source]), stamp)
