"""What the simulator sends in a tick, in the order in which the processes need it."""

from collections.abc import Iterable

from zteam import names
from zteam.messages import Clock, Message, time_from_ns
from zteam.nodes.simulator import tick_profile
from zteam.nodes.simulator.commands import Commands
from zteam.nodes.simulator.lockstep import LockStep
from zteam.nodes.simulator.team_outputs import TeamOutputs
from zteam.nodes.simulator.tick_profile import TickProfile
from zteam.runtime.process_node import ProcessNode
from zteam.sim import Engine, Observation


class TickSender:
    """Sends the engine's ticks: `send_inputs`, then `send_rest`. The main loop calls everything here."""

    def __init__(
        self,
        node: ProcessNode,
        engine: Engine,
        outputs: TeamOutputs,
        commands: Commands,
        lockstep: LockStep | None,
        profile: TickProfile,
    ) -> None:
        self._engine, self._outputs, self._commands = engine, outputs, commands
        self._lockstep, self._profile = lockstep, profile
        self._clock = node.bus.publisher(names.CLOCK, Clock)
        self._observation: Observation | None = None
        self._announced: list[int] = []
        """The robots in the last `sim/tick` (lock-step)."""
        self.is_first = True
        """Whether no tick was sent yet since the start or the last reset."""

    def start_anew(self) -> None:
        """The world is as at its start: the next tick is the first one."""
        self.is_first = True

    def send_inputs(self) -> None:
        """Compute the sensors, and send what the robots' next commands depend on."""
        engine = self._engine
        if self.is_first:
            # A process that knew an earlier simulator must see time jump back before it gets this one's data.
            self._clock.put(Clock(time_from_ns(engine.now)))
        # `sim/tick` comes before the data where the aggregator has to learn which robots' transforms to wait for, and
        # where time starts anew. Otherwise it comes last: then it wakes the robots together with the scans.
        early = engine.tick == 1 or self._announced != list(self._outputs)
        if early:
            self._announce()
        # Transforms leave before the lasers are computed. They pass through the aggregator, and this way the tree is
        # complete when a robot has its scan.
        bases = engine.observe_bases()
        self._outputs.put_transforms(self._outputs, bases)
        self._outputs.put_odometry(self._outputs, bases)
        self._profile.end(tick_profile.PUBLISH)
        self._observation = engine.observe()
        self._profile.end(tick_profile.SENSORS)
        self._outputs.put_scans(self._outputs, self._observation, self._commands.scan_sent)
        if not early:
            self._announce()
        self._profile.end(tick_profile.PUBLISH)

    def _announce(self) -> None:
        if self._lockstep is not None:
            self._announced = list(self._outputs)
            self._lockstep.open(self._engine.now, self._engine.tick, self._announced)

    def send_rest(self) -> None:
        """Send the clock, which wakes every process, and what no robot's next command depends on."""
        assert self._observation is not None
        if not self.is_first and self._clock.has_subscribers:
            self._clock.put(Clock(time_from_ns(self._engine.now)))
        self._outputs.put_rest(self._outputs, self._observation)
        self.is_first = False
        self._profile.end(tick_profile.PUBLISH)

    def scans(self, robot_ids: Iterable[int]) -> list[tuple[str, Message]]:
        """Key and message of what the lasers of these robots saw in the last tick."""
        return [] if self._observation is None else list(self._outputs.make_scans(robot_ids, self._observation))

    def repeat(self) -> None:
        """Send the last tick's data again, for processes that have not received it."""
        assert self._observation is not None
        present = [robot_id for robot_id in self._outputs if robot_id in self._observation.robots]
        self._repeat_inputs(present, self._observation)
        self._outputs.put_rest(present, self._observation)

    def repeat_for(self, missing: list[str]) -> None:
        """Send the open tick's inputs again, for the participants that owe an answer (lock-step)."""
        assert self._observation is not None
        robots = {names.robot_id_of(name) for name in missing}
        if None in robots:
            # The inputs of other processes than robots are not known: send everything.
            self.repeat()
        else:
            self._repeat_inputs([robot_id for robot_id in self._outputs if robot_id in robots], self._observation)

    def _repeat_inputs(self, robot_ids: list[int], observation: Observation) -> None:
        self._outputs.put_transforms(robot_ids, observation)
        self._outputs.put_odometry(robot_ids, observation, again=True)
        self._outputs.put_scans(robot_ids, observation, self._commands.scan_sent, again=True)
