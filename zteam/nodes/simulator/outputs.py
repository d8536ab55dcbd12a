"""The publishers of all robots that are in the world; a message without subscribers is not built."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from zteam import names
from zteam.bus import Publisher
from zteam.messages import BaseInfo, Message, TFMessage, Twist
from zteam.runtime.process_node import ProcessNode
from zteam.sim import Engine, Observation, to_messages
from zteam.world import Robot
from zteam.world.model import base_info


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
        self.robot = robot
        self.tf = bus.publisher(names.robot_key(robot_id, names.TF), TFMessage)
        self.tf_static = bus.publisher(names.robot_key(robot_id, names.TF_STATIC), TFMessage, latched=True)
        self._base_info = bus.publisher(names.robot_key(robot_id, names.BASE_INFO), BaseInfo, latched=True)
        self._base_info.put(base_info(robot))
        command_key = names.robot_key(robot_id, names.CMD_VEL)
        # In real time the robot itself publishes its command.
        self.command = bus.publisher(command_key, Twist, to_others=True) if lockstep else None
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
        # Robots compute their next command from these: they are published first.
        self.odom, self.scans = sensed.pop(names.ODOM), sensed.pop(names.BASE_SCAN)
        self._rest = [output for outputs in sensed.values() for output in outputs]
        self.note_subscribers()

    def note_subscribers(self) -> None:
        """Look which outputs have subscribers: to be called when the bus's `matching_changes` is another number."""
        self.odom_heard, self.scans_heard, self.rest_heard = (
            [output for output in outputs if output.publisher.has_subscribers]
            for outputs in (self.odom, self.scans, self._rest)
        )
        self.command_heard = self.command if self.command is not None and self.command.has_subscribers else None

    def close(self) -> None:
        """The robot is removed from the world."""
        for publisher in (self.tf, self.tf_static, self._base_info, self.command):
            if publisher is not None:
                publisher.close()
        for output in (*self.odom, *self.scans, *self._rest):
            output.publisher.close()


class TeamOutputs(Collection[int]):
    """The ids of the robots in the world, in the order in which they came, each with its publishers."""

    def __init__(self, node: ProcessNode, engine: Engine, *, lockstep: bool = False) -> None:
        self._node = node
        self._engine = engine
        self._lockstep = lockstep
        self._outputs: dict[int, RobotOutputs] = {}
        self.scan_counts: Mapping[int, int] = {}
        """Scans in a tick, by robot."""
        self._noted: int | None = None
        """The bus's `matching_changes` when the robots' outputs noted their subscribers."""

    def __contains__(self, robot_id: object) -> bool:
        return robot_id in self._outputs

    def __iter__(self) -> Iterator[int]:
        return iter(self._outputs)

    def __len__(self) -> int:
        return len(self._outputs)

    def match_robots(self) -> None:
        """Make publishers for new robots, and close those of robots that have left the world or are other ones now."""
        robots = self._engine.robots
        for robot_id in [known for known, output in self._outputs.items() if robots.get(known) is not output.robot]:
            self._outputs.pop(robot_id).close()
        for robot_id, robot in robots.items():
            if robot_id not in self._outputs:
                self._outputs[robot_id] = RobotOutputs(self._node, robot_id, robot, lockstep=self._lockstep)
                self.put_statics(robot_id)
        self.scan_counts = {robot_id: len(output.scans) for robot_id, output in self._outputs.items()}

    def put_statics(self, robot_id: int) -> None:
        """Send a robot's fixed frames."""
        output, origin = self._outputs[robot_id], self._engine.odom_origin(robot_id)
        output.tf_static.put(to_messages.static_transforms(robot_id, output.robot, origin))

    def put_transforms(self, robot_ids: Iterable[int], observation: Observation) -> None:
        """Send these robots' odom -> base_footprint."""
        for robot_id in robot_ids:
            odom = observation.robots[robot_id].odom
            self._outputs[robot_id].tf.hand_over(to_messages.transforms(observation.stamp, robot_id, odom))

    def put_odometry(self, robot_ids: Iterable[int], observation: Observation, *, again: bool = False) -> None:
        """Send these robots' odometry; with `again` a participant waits for it, and no subscriber needs to be known."""
        self._note_subscribers()
        for robot_id in robot_ids:
            output = self._outputs[robot_id]
            for publisher, build, number in output.odom if again else output.odom_heard:
                publisher.hand_over(build(observation, robot_id, number))

    def put_scans(
        self,
        robot_ids: Iterable[int],
        observation: Observation,
        on_scan: Callable[[int], None],
        *,
        again: bool = False,
    ) -> None:
        """Send these robots' scans; `again` as with `put_odometry`.

        `on_scan(robot_id)` is called before the scans of a robot leave.
        """
        self._note_subscribers()
        for robot_id in robot_ids:
            output = self._outputs[robot_id]
            if output.scans:
                on_scan(robot_id)
            for publisher, build, number in output.scans if again else output.scans_heard:
                publisher.hand_over(build(observation, robot_id, number))

    def make_scans(self, robot_ids: Iterable[int], observation: Observation) -> Iterator[tuple[str, Message]]:
        """The key and the message of every scan of those of these robots that were observed."""
        for robot_id in robot_ids:
            if robot_id in self._outputs and robot_id in observation.robots:
                for _, build, number in self._outputs[robot_id].scans:
                    yield names.scan_key(robot_id, number), build(observation, robot_id, number)

    def put_rest(self, robot_ids: Iterable[int], observation: Observation) -> None:
        """Send what no robot's next command depends on."""
        self._note_subscribers()
        for robot_id in robot_ids:
            for publisher, build, number in self._outputs[robot_id].rest_heard:
                publisher.put(build(observation, robot_id, number))

    def put_commands(self, commands: Mapping[int, Twist]) -> None:
        """Send, on `cmd_vel`, the commands that came with the answers of lock-step."""
        self._note_subscribers()
        for robot_id, command in commands.items():
            if publisher := self._outputs[robot_id].command_heard:
                publisher.put(command)

    def _note_subscribers(self) -> None:
        # Asked once for the whole team: it takes as long as asking one publisher.
        changes = self._node.bus.matching_changes
        if changes != self._noted:
            # In this order: another thread may let it change meanwhile.
            self._noted = changes
            for output in self._outputs.values():
                output.note_subscribers()
