"""The publishers of all robots that are in the world; a message without subscribers is not built."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from zteam import names
from zteam.bus import Bus, Publisher
from zteam.messages import BaseInfo, Message, TFMessage, Twist
from zteam.simulator.core import Engine, Observation, to_messages
from zteam.simulator.world import Robot
from zteam.simulator.world.devices import KINDS
from zteam.simulator.world.model import base_info

Output = tuple[Publisher[Any], Callable[[Observation, int, int], Message], int]
"""One key: its publisher, what builds its messages, and the number of the device among those of its kind."""


class RobotOutputs:
    """One robot's publishers."""

    def __init__(self, bus: Bus, robot_id: int, robot: Robot, *, lockstep: bool) -> None:
        self.robot, self._id = robot, robot_id
        self._publishers: list[Publisher[Any]] = []

        def publisher(key: str, message_type: type[Message], **options: bool) -> Publisher[Any]:
            self._publishers.append(bus.publisher(key, message_type, **options))
            return self._publishers[-1]

        self._tf = publisher(names.robot_key(robot_id, names.TF), TFMessage)
        self.tf_static = publisher(names.robot_key(robot_id, names.TF_STATIC), TFMessage, latched=True)
        publisher(names.robot_key(robot_id, names.BASE_INFO), BaseInfo, latched=True).put(base_info(robot))
        command_key = names.robot_key(robot_id, names.CMD_VEL)
        # In real time the robot itself publishes its command.
        self.command = publisher(command_key, Twist, to_others=True) if lockstep else None
        sensed: dict[str, list[Output]] = {}
        for topic, kind in KINDS.items():
            publishers = [publisher(kind.key(robot_id, i), kind.message) for i in range(kind.count(robot))]
            sensed[topic] = [(each, to_messages.BUILDERS[topic], i) for i, each in enumerate(publishers)]
        # Robots compute their next command from these: they are published first.
        self.odom, self.scans = sensed.pop(names.ODOM), sensed.pop(names.BASE_SCAN)
        self._rest = [output for outputs in sensed.values() for output in outputs]

    def close(self) -> None:
        for publisher in self._publishers:
            publisher.close()

    def put_transforms(self, observation: Observation) -> None:
        """Send odom -> base_footprint."""
        odom = observation.robots[self._id].odom
        self._tf.put_owned(to_messages.transforms(observation.time, self._id, odom))

    def put(self, outputs: Sequence[Output], observation: Observation, *, again: bool = False) -> None:
        """Send `odom` or `scans`; with `again` a participant waits for them, and no subscriber needs to be known."""
        for publisher, build, number in outputs:
            if again or publisher.has_subscribers:
                publisher.put_owned(build(observation, self._id, number))

    def put_rest(self, observation: Observation) -> None:
        """Send what no robot's next command depends on."""
        for publisher, build, number in self._rest:
            if publisher.has_subscribers:
                publisher.put(build(observation, self._id, number))


class TeamOutputs(dict[int, RobotOutputs]):
    """The publishers of each robot in the world, by its id, in the order in which the robots came."""

    def __init__(self, bus: Bus, engine: Engine, *, lockstep: bool = False) -> None:
        super().__init__()
        self.bus, self._engine, self._lockstep = bus, engine, lockstep

    def match_robots(self) -> None:
        """Make publishers for new robots, and close those of robots that have left the world or are other ones now."""
        robots = self._engine.robots
        for robot_id in [known for known, output in self.items() if robots.get(known) is not output.robot]:
            self.pop(robot_id).close()
        for robot_id, robot in robots.items():
            if robot_id not in self:
                self[robot_id] = RobotOutputs(self.bus, robot_id, robot, lockstep=self._lockstep)
                self.put_statics(robot_id)

    def put_statics(self, robot_id: int) -> None:
        output, origin = self[robot_id], self._engine.odom_origin(robot_id)
        output.tf_static.put(to_messages.static_transforms(robot_id, output.robot, origin))

    def put_commands(self, commands: Mapping[int, Twist]) -> None:
        """Send, on `cmd_vel`, the commands that came with the answers of lock-step."""
        for robot_id, command in commands.items():
            publisher = self[robot_id].command
            if publisher is not None and publisher.has_subscribers:
                publisher.put(command)
