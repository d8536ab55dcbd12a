"""The publishers of all robots that are in the world."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping

from zteam.messages import Message, Twist
from zteam.nodes.simulator.publishers import RobotOutputs
from zteam.runtime.process_node import ProcessNode
from zteam.sim import Engine, Observation


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
                self._outputs[robot_id].put_base_info()
                self.put_statics(robot_id)
        self.scan_counts = {robot_id: len(output.scans) for robot_id, output in self._outputs.items()}

    def put_statics(self, robot_id: int) -> None:
        """Send a robot's fixed frames."""
        self._outputs[robot_id].put_statics(self._engine.odom_origin(robot_id))

    def put_transforms(self, robot_ids: Iterable[int], observation: Observation) -> None:
        """Send these robots' odom -> base_footprint."""
        for robot_id in robot_ids:
            self._outputs[robot_id].put_transforms(observation.stamp, observation.robots[robot_id].odom)

    def put_odometry(self, robot_ids: Iterable[int], observation: Observation, *, again: bool = False) -> None:
        """Send these robots' odometry; `again` also without a known subscriber."""
        self._note_subscribers()
        for robot_id in robot_ids:
            self._outputs[robot_id].put_odometry(observation, again=again)

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
                output.put_scans(observation, again=again)

    def make_scans(self, robot_ids: Iterable[int], observation: Observation) -> Iterator[tuple[str, Message]]:
        """The key and the message of every scan of those of these robots that were observed."""
        for robot_id in robot_ids:
            if robot_id in self._outputs and robot_id in observation.robots:
                yield from self._outputs[robot_id].make_scans(observation)

    def put_rest(self, robot_ids: Iterable[int], observation: Observation) -> None:
        """Send what no robot's next command depends on."""
        self._note_subscribers()
        for robot_id in robot_ids:
            self._outputs[robot_id].put_rest(observation)

    def put_commands(self, commands: Mapping[int, Twist]) -> None:
        """Send, on `cmd_vel`, the commands that came with the answers of lock-step."""
        self._note_subscribers()
        for robot_id, command in commands.items():
            self._outputs[robot_id].put_command(command)

    def _note_subscribers(self) -> None:
        # Asked once for the whole team: it takes as long as asking one publisher.
        changes = self._node.bus.matching_changes
        if changes != self._noted:
            # In this order: another thread may let it change meanwhile.
            self._noted = changes
            for output in self._outputs.values():
                output.note_subscribers()
