"""What has come for one robot, and what the team's transforms say of it."""

from collections.abc import Mapping
from typing import Any

from zteam import names
from zteam.clock import FREEZES, monotonic
from zteam.geometry import Pose2
from zteam.messages import RobotDriver, RobotState, ns_from_time
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.navigation.planning.scans import Scan, Teammate
from zteam.node.node import Node
from zteam.node.stopping import STOPPED
from zteam.robot.view import SILENT_AFTER
from zteam.transforms import TransformException
from zteam.transforms.client import Lookup, TransformClient, find_frames
from zteam.transforms.lasers import LaserMounts
from zteam.transforms.listener import TransformListener

_ANSWER_LIMIT = 1.0
"""Host seconds for the aggregator to tell what it knows."""
OLD = 1_000_000_000
"""Nanoseconds after which a scan or a pose says nothing of where the robot is now (Nav2's transform_tolerance of 1 s
for its localiser)."""


class TeamTransforms(TransformListener):
    """The team's transforms, and where robots were before this process came.

    Of a localiser that has ended, only the aggregator knows the last `map -> robot_N/odom`.
    """

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._bus = node.bus
        self.left: dict[int, Pose2] = {}
        """The `map -> robot_N/odom` that localisers of before have left, by robot."""
        node.on_time_reset(self.left.clear)

    def ask(self) -> None:
        """Ask the aggregator, if there is one, where localisers of before have put robots. Before the first step."""
        frames = find_frames(self._bus, _ANSWER_LIMIT) or {}
        lookups = {
            names.robot_id_of(child.partition("/")[0]) or 0: Lookup(names.MAP_FRAME, child)
            for child, frame in frames.items()
            if frame.parent == names.MAP_FRAME and not frame.static and names.is_robot_frame(child, names.ODOM)
        }
        self.left.update(TransformClient(self._bus).find_poses(lookups))
        self._connected.update(self.left)

    def find_robots(self, now: int, bases: Mapping[int, Base]) -> dict[int, Teammate]:
        """Where the robots with these bases are in `map`: those whose place is known and, at `now` (ns), not old."""
        robots = sorted(bases)
        frames = tuple(names.robot_frame(robot_id, names.BASE_FOOTPRINT) for robot_id in robots)
        poses, stamps = self.find_poses2(names.MAP_FRAME, frames)
        return {
            robot_id: Teammate(poses[4 * row], poses[4 * row + 1], bases[robot_id].radius)
            for row, robot_id in enumerate(robots)
            if now - stamps[row] <= OLD
        }


class Inputs:
    """The newest data of one robot. Stamps are in ns."""

    def __init__(self, robot_id: int, transforms: TeamTransforms, bases: Mapping[int, Base]) -> None:
        """`bases` are those of the team's robots, as far as they have come."""
        self.robot_id, self._transforms, self._bases = robot_id, transforms, bases
        self.every_tick = [names.BASE_SCAN, names.ODOM]
        """Topics that each tick of lock-step brings."""
        self.base_frame = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self.odom_frame = names.robot_frame(robot_id, names.ODOM)
        self._lasers = LaserMounts(robot_id, transforms)
        self.scan_problem = ""
        """Why the newest scan cannot be used; empty if it can."""
        self.forget()

    def forget(self) -> None:
        """Time jumped back."""
        self.newest: dict[str, Any] = {}
        """The newest message of each topic; a goal and an initial pose until a step takes them. Of a goal that the bus
        dropped, what is wrong with it."""
        self.heard: float | None = None
        """Host time at which the status came; None in lock-step, where its stamp counts."""

    def stamp(self, topic: str) -> int:
        """Nanoseconds of the newest message of a topic; -1 without one."""
        message = self.newest.get(topic)
        return -1 if message is None else ns_from_time(message.header.stamp)

    @property
    def base(self) -> Base:
        return self._bases.get(self.robot_id, DEFAULT_BASE)

    def find(self, target: str, source: str, time: int = 0) -> tuple[Pose2, int] | None:
        """The pose of `source` in `target`, the newest with time 0, and its stamp (ns). None if it is unknown."""
        try:
            return self._transforms.lookup_pose2(target, source, time)
        except TransformException:
            return None

    def odom_pose(self, stamp: int = 0) -> tuple[Pose2, int] | None:
        """The base in `odom` at `stamp`, or the newest one, and its stamp (ns)."""
        newest = self.find(self.odom_frame, self.base_frame)
        if newest is None or stamp in (0, newest[1]):
            return newest
        return self.find(self.odom_frame, self.base_frame, stamp) or newest

    def known_pose(self) -> Pose2 | None:
        """The base in `map` as the transforms say, or as a localiser of before has left it."""
        found, odom = self.find(names.MAP_FRAME, self.base_frame), self.odom_pose()
        left = self._transforms.left.get(self.robot_id)
        if found is not None:
            return found[0]
        return None if left is None or odom is None else left.compose(odom[0])

    def planning_scan(self) -> Scan | None:
        """The newest scan as planning takes it; None if there is none, or if it cannot be used (`scan_problem`)."""
        self.scan_problem = ""
        if names.BASE_SCAN not in self.newest:
            return None
        scan, laser, problem = self._lasers.level(self.newest[names.BASE_SCAN])
        if scan is None:
            self.scan_problem = f"it needs {problem.noun}" if problem else ""
            return None
        sensor = Pose2(*laser, 0.0)
        return Scan(scan.ranges, scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max, sensor)

    def is_held(self, now: int) -> str:
        """Why the robot does not obey navigation at time `now` (ns); empty if it does, as far as is known."""
        status, heard = self.newest.get(names.STATUS), self.heard
        if status is None:
            return ""
        if heard is None:
            age = (now - self.stamp(names.STATUS)) / 1e9
        else:
            age = monotonic() - max(heard, FREEZES.look())
        if age > SILENT_AFTER:
            return f"{names.robot_name(self.robot_id)} is silent"
        if status.is_stopped:
            return STOPPED
        if status.state in (RobotState.BOOT, RobotState.READY):
            return "waits for GO"
        return "teleop drives" if status.driver == RobotDriver.TELEOP else ""
