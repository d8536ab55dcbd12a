"""A flat floor for behaviours: walls as segments, robots as unicycles, a laser that sees both. No physics, no bus."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.behaviors import Behavior, SafetyLayer, View, decide
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.messages import Header, LaserScan, Odometry, Quaternion, Twist, time_from_ns

Segment = tuple[float, float, float, float]
"""x0, y0, x1, y1 in metres."""
TICK = 100_000_000
"""Nanoseconds: Stage's 10 Hz."""
BEAMS = 541
FOV = math.radians(270.25)
LASER = Pose2(0.05, 0.0, 0.0)
"""The erratic's laser in its base."""
LASER_RADIUS = 0.03
"""What a laser sees of another robot: only the other laser stands at its height."""


def make_scan(ranges: Sequence[float] | NDArray[np.float64], stamp: int = TICK, fov: float = FOV) -> LaserScan:
    """A scan of evenly spread beams, 0 to 30 m."""
    count = len(ranges)
    return LaserScan(
        header=Header(time_from_ns(stamp), "robot_0/base_laser_link"),
        angle_min=-0.5 * fov,
        angle_max=0.5 * fov,
        angle_increment=fov / (count - 1) if count > 1 else 0.0,
        range_max=30.0,
        ranges=np.array(ranges, np.float32),
    )


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


def cast(laser: Pose2, walls: Sequence[Segment], discs: Sequence[tuple[float, float]] = ()) -> NDArray[np.float64]:
    """Distances (BEAMS,) from the laser to the nearest wall or disc of LASER_RADIUS, 30 m where there is none."""
    angles = laser.yaw + np.linspace(-0.5 * FOV, 0.5 * FOV, BEAMS)
    dx, dy = np.cos(angles), np.sin(angles)
    ranges = np.full(BEAMS, 30.0)
    for x0, y0, x1, y1 in walls:
        ex, ey = x1 - x0, y1 - y0
        px, py = x0 - laser.x, y0 - laser.y
        cross = dx * ey - dy * ex
        cross[cross == 0.0] = np.nan
        along, across = (px * ey - py * ex) / cross, (px * dy - py * dx) / cross
        hit = (along >= 0.0) & (across >= 0.0) & (across <= 1.0)
        ranges[hit] = np.minimum(ranges[hit], along[hit])
    for x, y in discs:
        px, py = x - laser.x, y - laser.y
        middle = px * dx + py * dy
        rest = middle**2 - (px**2 + py**2 - LASER_RADIUS**2)
        along = middle - np.sqrt(np.maximum(rest, 0.0))
        hit = (rest >= 0.0) & (along >= 0.0)
        ranges[hit] = np.minimum(ranges[hit], along[hit])
    return ranges


def clearance(pose: Pose2, walls: Sequence[Segment]) -> float:
    """Metres from the base's centre to the nearest wall."""
    distances = []
    for x0, y0, x1, y1 in walls:
        ex, ey = x1 - x0, y1 - y0
        share = ((pose.x - x0) * ex + (pose.y - y0) * ey) / (ex * ex + ey * ey)
        share = max(0.0, min(1.0, share))
        distances.append(math.hypot(pose.x - x0 - share * ex, pose.y - y0 - share * ey))
    return min(distances)


def drive(pose: Pose2, command: Twist, seconds: float) -> Pose2:
    """Where a unicycle gets to: the exact arc."""
    speed, turn = command.linear.x, command.angular.z
    angle = turn * seconds
    if abs(angle) < 1e-9:
        return pose.compose(Pose2(speed * seconds, 0.0, 0.0))
    radius = speed / turn
    return pose.compose(Pose2(radius * math.sin(angle), radius * (1.0 - math.cos(angle)), angle))


class Floor:
    """Robots 0, 1, … that all decide on the same instant and move together, tick by tick.

    `delay` is the age of all transforms in ticks; scans are of the instant.
    """

    def __init__(self, poses: Sequence[Pose2], walls: Sequence[Segment], seed: int = 1, delay: int = 0) -> None:
        self.poses = list(poses)
        self.walls = walls
        self.seed = seed
        self.ticks = 0
        self.commands: list[tuple[Twist, str]] = []
        self._delay = delay
        self._past = [self.poses]
        self._layers = [SafetyLayer() for _ in poses]

    def step(self, behaviors: Sequence[Behavior]) -> None:
        """One tick."""
        self.ticks += 1
        self.commands = [decide(b, self.view(i), self._layers[i]) for i, b in enumerate(behaviors)]
        self.poses = [drive(p, c, TICK / 1e9) for p, (c, _) in zip(self.poses, self.commands, strict=True)]
        self._past.append(self.poses)

    def view(self, robot_id: int) -> View:
        """What one robot knows now."""
        now = self.ticks * TICK
        lasers = [pose.compose(LASER) for pose in self.poses]
        others = [(laser.x, laser.y) for i, laser in enumerate(lasers) if i != robot_id]
        scan = make_scan(cast(lasers[robot_id], self.walls, others), now)
        scan.header.frame_id = names.robot_frame(robot_id, names.BASE_LASER_LINK)
        odom = make_odometry(self.poses[robot_id])
        return make_view(scan, now=now, robot_id=robot_id, odom=odom, lookup=self._lookup(), seed=self.seed)

    def _lookup(self) -> Callable[[str, str], tuple[Pose2, int] | None]:
        at = max(0, len(self._past) - 1 - self._delay)
        stamp = max(1, (self.ticks - self._delay) * TICK)

        def map_from(frame: str) -> Pose2:
            if frame == "map":
                return Pose2(0.0, 0.0, 0.0)
            robot, _, local = frame.partition("/")
            base = self._past[at][int(robot[6:])]
            return base.compose(LASER) if local == names.BASE_LASER_LINK else base

        return lambda target, source: (map_from(target).inverse().compose(map_from(source)), stamp)
