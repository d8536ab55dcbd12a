"""The simulator's publishers of one robot; a message without subscribers is not built."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from zteam import names
from zteam.bus import Publisher
from zteam.geometry import Pose2
from zteam.messages import BaseInfo, Message, TFMessage, Twist
from zteam.runtime.process_node import ProcessNode
from zteam.sim import Observation, to_messages
from zteam.world import Robot
from zteam.world.bases import base_info

_BEFORE_COMMANDS = (names.ODOM, names.BASE_SCAN)
"""What robots compute their next command from: it is published first."""


class _Output(NamedTuple):
    """One key, and what builds its messages."""

    publisher: Publisher[Any]
    build: Callable[[Observation, int, int], Message]
    number: int
    """Of the device among those of its kind."""


class RobotOutputs:
    """One robot's publishers."""

    def __init__(self, node: ProcessNode, robot_id: int, robot: Robot, *, lockstep: bool = False) -> None:
        bus = node.bus
        self._id, self.robot = robot_id, robot
        self._tf = bus.publisher(names.robot_key(robot_id, names.TF), TFMessage)
        self._tf_static = bus.publisher(names.robot_key(robot_id, names.TF_STATIC), TFMessage, latched=True)
        self._base_info = bus.publisher(names.robot_key(robot_id, names.BASE_INFO), BaseInfo, latched=True)
        command_key = names.robot_key(robot_id, names.CMD_VEL)
        # In real time the robot itself publishes its command.
        self._command = bus.publisher(command_key, Twist, to_others=True) if lockstep else None
        sensed = {
            topic: [
                _Output(
                    bus.publisher(sensor.kind.key(robot_id, i), sensor.kind.message, latched=sensor.kind.latched),
                    sensor.message,
                    i,
                )
                for i in range(sensor.kind.count(robot))
            ]
            for topic, sensor in to_messages.SENSORS.items()
        }
        self._odom = sensed[names.ODOM]
        self.scans = sensed[names.BASE_SCAN]
        self._rest = [out for topic, outputs in sensed.items() if topic not in _BEFORE_COMMANDS for out in outputs]
        self.note_subscribers()

    def note_subscribers(self) -> None:
        """Look which outputs have subscribers: to be called when the bus's `matching_changes` is another number."""
        self._odom_heard, self._scans_heard, self._rest_heard = (
            [output for output in outputs if output.publisher.has_subscribers]
            for outputs in (self._odom, self.scans, self._rest)
        )
        self._command_heard = self._command is not None and self._command.has_subscribers

    def put_base_info(self) -> None:
        """Publish what the robot's base is."""
        self._base_info.put(base_info(self.robot))

    def put_statics(self, origin: Pose2) -> None:
        """Publish the robot's fixed frames; `origin` is where its `odom` frame is in `map`."""
        self._tf_static.put(to_messages.static_transforms(self._id, self.robot, origin))

    def put_transforms(self, stamp: int, odom: Pose2) -> None:
        """Publish odom -> base_footprint at `stamp` (ns)."""
        self._tf.hand_over(to_messages.transforms(stamp, self._id, odom))

    def put_odometry(self, observation: Observation, *, again: bool = False) -> None:
        """Publish odometry; with `again` a participant waits for it, so it is sent even if no subscriber is known."""
        self._hand_over(self._odom if again else self._odom_heard, observation)

    def put_scans(self, observation: Observation, *, again: bool = False) -> None:
        """Publish every laser's scan; `again` as with `put_odometry`."""
        self._hand_over(self.scans if again else self._scans_heard, observation)

    def make_scans(self, observation: Observation) -> Iterator[tuple[str, Message]]:
        """The key and the message of every laser's scan, which are not sent."""
        for _, build, number in self.scans:
            yield names.scan_key(self._id, number), build(observation, self._id, number)

    def put_command(self, command: Twist) -> None:
        """Publish what the wheels are commanded in lock-step, where commands do not come over `cmd_vel`."""
        if self._command is not None and self._command_heard:
            self._command.put(command)

    def put_rest(self, observation: Observation) -> None:
        """Publish what no robot needs for its next command."""
        for publisher, build, number in self._rest_heard:
            publisher.put(build(observation, self._id, number))

    def close(self) -> None:
        """The robot is removed from the world."""
        for publisher in (self._tf, self._tf_static, self._base_info, self._command):
            if publisher is not None:
                publisher.close()
        for output in (*self._odom, *self.scans, *self._rest):
            output.publisher.close()

    def _hand_over(self, outputs: list[_Output], observation: Observation) -> None:
        for publisher, build, number in outputs:
            publisher.hand_over(build(observation, self._id, number))
