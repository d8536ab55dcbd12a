"""The simulator's publishers: what one robot's sensors say, and what is made only if somebody listens."""

from typing import Any

from zteam import names
from zteam.bus import Publisher
from zteam.geometry import Pose2
from zteam.messages import (
    Blobs,
    Bool,
    Bumper,
    Fiducials,
    JointState,
    LaserScan,
    Odometry,
    Range,
    TFMessage,
    Twist,
)
from zteam.runtime.node import Node
from zteam.sim import Observation
from zteam.sim import to_messages as observed
from zteam.world import Robot


class RobotOutputs:
    """One robot's publishers."""

    def __init__(self, node: Node, robot_id: int, robot: Robot) -> None:
        def key(topic: str) -> str:
            return names.robot_key(robot_id, topic)

        bus = node.bus
        self._id, self._robot = robot_id, robot
        lasers = sum(1 for ranger in robot.rangers if ranger.samples > 1)
        self._tf = bus.publisher(key(names.TF), TFMessage)
        self._tf_static = bus.publisher(key(names.TF_STATIC), TFMessage, latched=True)
        self._odom = bus.publisher(key(names.ODOM), Odometry)
        self._truth = bus.publisher(key(names.GROUND_TRUTH), Odometry)
        self._stall = bus.publisher(key(names.STALL), Bool)
        self._command = bus.publisher(key(names.CMD_VEL), Twist, to_others=True)
        self.scans = [bus.publisher(names.scan_key(robot_id, i), LaserScan) for i in range(lasers)]
        self._sonars = [bus.publisher(names.sonar_key(robot_id, i), Range) for i in range(len(robot.rangers) - lasers)]
        self._joints = bus.publisher(key(names.JOINT_STATES), JointState)
        self._bumpers = [bus.publisher(key(names.BUMPER), Bumper)] if robot.bumpers else []
        self._fiducials = [
            bus.publisher(names.numbered_key(robot_id, names.FIDUCIALS, i), Fiducials)
            for i in range(len(robot.finders))
        ]
        self._blobs = [
            bus.publisher(names.numbered_key(robot_id, names.BLOBS, i), Blobs) for i in range(len(robot.blobfinders))
        ]
        self._all: list[Publisher[Any]] = [
            self._tf, self._tf_static, self._odom, self._truth, self._stall, self._command, self._joints,
            *self.scans, *self._sonars, *self._bumpers, *self._fiducials, *self._blobs,
        ]  # fmt: skip

    def put_statics(self, origin: Pose2) -> None:
        """The robot's fixed frames; `origin` is where its `odom` frame is in `map`."""
        self._tf_static.put(observed.static_transforms(self._id, self._robot, origin))

    def put_transforms(self, stamp: int, odom: Pose2) -> None:
        """odom -> base_footprint at `stamp` (ns)."""
        self._tf.put(observed.transforms(stamp, self._id, odom))

    def put_odometry(self, observation: Observation, *, again: bool = False) -> None:
        """Odometry; `again` whether it seems wanted or not, because somebody waits for it."""
        if self._odom.has_subscribers or again:
            self._odom.put(observed.odometry_message(observation, self._id))

    def put_scans(self, observation: Observation, *, again: bool = False) -> None:
        """Every laser's scan; `again` as with `put_odometry`."""
        for i, scan in enumerate(self.scans):
            if scan.has_subscribers or again:
                scan.put(observed.scan_message(observation, self._id, i))

    def put_command(self, command: Twist) -> None:
        """What the wheels are told in lock-step, where commands do not come over `cmd_vel`."""
        if self._command.has_subscribers:
            self._command.put(command)

    def put_rest(self, observation: Observation) -> None:
        """What no robot's next command hangs on; a message without a taker is not even made."""
        robot_id = self._id
        if self._truth.has_subscribers:
            self._truth.put(observed.ground_truth_message(observation, robot_id))
        if self._stall.has_subscribers:
            self._stall.put(Bool(observation.robots[robot_id].stall))
        if self._joints.has_subscribers:
            self._joints.put(observed.joint_message(observation, robot_id))
        for i, sonar in enumerate(self._sonars):
            if sonar.has_subscribers:
                sonar.put(observed.range_message(observation, robot_id, i))
        for bumper in self._bumpers:
            if bumper.has_subscribers:
                bumper.put(observed.bumper_message(observation, robot_id))
        for i, fiducials in enumerate(self._fiducials):
            if fiducials.has_subscribers:
                fiducials.put(observed.fiducials_message(observation, robot_id, i))
        for i, blobs in enumerate(self._blobs):
            if blobs.has_subscribers:
                blobs.put(observed.blobs_message(observation, robot_id, i))

    def close(self) -> None:
        """The robot is taken out of the world."""
        for publisher in self._all:
            publisher.close()
