"""The simulator process: steps the engine, publishes what robots sense, takes their commands.

A tick: commands in, `Engine.move`, transforms out, `Engine.observe`, everything else out. In lock-step the next one
begins when every participant has answered, else when it is due.
"""

import logging
from collections.abc import Mapping
from pathlib import Path

import msgspec

from zteam import names
from zteam.clock import NS_PER_S, Every, monotonic
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import Clock, OccupancyGrid, TeamState, TeamStatus, Twist, ns_from_time, time_from_ns
from zteam.nodes.simulator import tick_profile
from zteam.nodes.simulator.commands import Commands
from zteam.nodes.simulator.lockstep import LockStep, LockStepOptions
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.publishers import RobotOutputs
from zteam.nodes.simulator.queries import Control
from zteam.nodes.simulator.run_statistics import RunStatistics
from zteam.nodes.simulator.tick_profile import TickProfile
from zteam.runtime.node import Node
from zteam.services.simulator import MoveRequest, SimReport, SimStatus, SpawnRequest, Timing
from zteam.sim import Engine, Observation, Options
from zteam.sim.occupancy_grid import map_message
from zteam.sim.takeover import Takeover
from zteam.world import Robot, World, add_robot

log = logging.getLogger("zteam")

ANSWER_SHARE = 0.4
"""Share of a tick's time that the rest of its messages wait for the robots' commands."""


class SimOptions(msgspec.Struct, frozen=True):
    """What the command line says about a run."""

    world: Path
    seed: int = 1
    map_resolution: float = 0.05
    """Metres a cell of the published map."""
    follows: Mapping[int, int] = msgspec.field(default_factory=dict)
    """Pairs whose gap is measured: follower -> leader."""
    engine: Options = Options()
    run_for: float | None = None
    """Stand still this many simulated seconds after GO."""
    speed: float | None = 1.0
    """Simulated seconds a second of the host; None = as fast as possible."""
    paused: bool = False
    """Stand still at the first tick."""
    lockstep: LockStepOptions | None = None


class Simulator:
    """A world on the bus. `run` and what it calls is the main loop's; queries and messages come from bus threads."""

    def __init__(
        self, node: Node, world: World, robots: dict[int, Robot], options: SimOptions, kernels: Takeover | None = None
    ) -> None:
        self._node = node
        self._kernels = kernels
        self._options = options
        self._world = world
        self._engine = Engine(world, seed=options.seed, robots=robots, options=options.engine)
        self._outputs: dict[int, RobotOutputs] = {}
        self._phases = TickProfile()
        self._pacer = Pacer(world.interval, options.speed, paused=options.paused)
        self._tally = RunStatistics(options.follows, options.seed)
        self._commands = Commands(node, self._outputs.__contains__, self._tally)
        self._lockstep = LockStep(node, options.lockstep, self._commands.answered) if options.lockstep else None
        self._observation: Observation | None = None
        self._first = True
        """Whether no tick was sent yet."""
        self._announced: list[int] = []
        """The robots that the last tick told of (lock-step)."""
        self._go: int | None = None
        self._obeyed_from: int | None = None
        """First tick whose scans every robot can have met with GO in hand: GO may cross the scans of two ticks."""
        self._clock = node.bus.publisher(names.CLOCK, Clock)
        self._slow = Every(5.0)
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        self._control = Control(node, self, self._pacer)

    def publish_statics(self) -> None:
        """Send the latched messages: every robot's fixed frames, and the map."""
        self._meet_robots()
        self._map = self._node.bus.publisher(names.MAP, OccupancyGrid, latched=True)
        self._map.put(map_message(self._world, self._options.map_resolution))

    def _meet_robots(self) -> None:
        """Publishers for those that are there, none for those that are gone."""
        robots = self._engine.robots
        for robot_id in [known for known in self._outputs if known not in robots]:
            self._outputs.pop(robot_id).close()
        for robot_id, robot in robots.items():
            if robot_id not in self._outputs:
                self._outputs[robot_id] = RobotOutputs(self._node, robot_id, robot)
                self._outputs[robot_id].put_statics(self._engine.odom_origin(robot_id))

    def run(self) -> None:
        """Tick until the process is asked to stop."""
        commands: dict[int, Twist] = {}
        while True:
            self._tick(commands)
            if self._lockstep is not None and not self._lockstep.wait(self._resend):
                return
            self._phases.end(tick_profile.WAIT)
            if self._tally.go_stamp is None:
                self._count()
            if not self._control.wait_for_turn():
                return
            self._phases.end(tick_profile.IDLE)
            commands = self._take_commands()
            if self._kernels is not None:
                self._kernels.poll()
            self._phases.end_tick()
            if self._pacer.behind and self._slow.due():
                log.warning("real-time factor %.2g: %s", self._pacer.factor, self._phases.last_text())

    def _take_commands(self) -> dict[int, Twist]:
        commands, late = self._commands.take()
        if self._lockstep is not None:
            answers = self._lockstep.take_commands(self._outputs)
            for robot_id, command in answers.items():
                self._outputs[robot_id].put_command(command)
            return commands | answers
        if self._obeyed_from is not None and self._engine.tick >= self._obeyed_from:
            self._tally.add_late_steps(late)
        return commands

    def _tick(self, commands: dict[int, Twist]) -> None:
        engine = self._engine
        self._pacer.start(monotonic(), counts=not self._first)
        engine.move(commands)
        self._phases.end(tick_profile.PHYSICS)
        if self._first:
            # Whoever knew a simulator before this one must see time jump back before its data.
            self._clock.put(Clock(time_from_ns(engine.now)))
        # The aggregator has to know of whom it waits for transforms, and everybody that time starts anew, before the
        # data. Else the tick is told last: with the scans, it wakes the robots once less.
        early = engine.tick == 1 or self._announced != list(self._outputs)
        if early:
            self._announce()
        # Transforms leave before the lasers are even computed: they go over the aggregator, so this way the tree is
        # whole when a robot has its scan and looks. The clock wakes every process, so it leaves when the scans have.
        self._put_transforms(self._outputs)
        self._phases.end(tick_profile.PUBLISH)
        self._observation = engine.observe()
        self._phases.end(tick_profile.SENSORS)
        self._put_sensors(self._observation, self._outputs)
        if not early:
            self._announce()
        if self._lockstep is None:
            # What follows wakes every process, and nobody's next command hangs on it: the robots' answers come first.
            self._phases.end(tick_profile.PUBLISH)
            self._commands.wait_for_answers(ANSWER_SHARE * self._tick_seconds)
            self._phases.end(tick_profile.WAIT)
        # Whoever hears the last tick's clock may ask for the report at once.
        self._count()
        if not self._first and self._clock.has_subscribers:
            self._clock.put(Clock(time_from_ns(engine.now)))
        for outputs in self._outputs.values():
            outputs.put_rest(self._observation)
        self._first = False
        self._phases.end(tick_profile.PUBLISH)

    @property
    def _tick_seconds(self) -> float:
        """Host seconds of a tick at the speed that was asked for; 0 as fast as possible."""
        speed = None if self._pacer.paused else self._pacer.speed
        return 0.0 if speed is None else self._world.interval / NS_PER_S / speed

    def _announce(self) -> None:
        """Lock-step: tell the tick."""
        if self._lockstep is None:
            return
        self._announced = list(self._outputs)
        self._lockstep.open(self._engine.now, self._engine.tick, self._announced)

    def _put_transforms(self, outputs: Mapping[int, RobotOutputs]) -> None:
        engine = self._engine
        for robot_id, output in outputs.items():
            output.put_transforms(engine.now, engine.odom(robot_id))

    def _put_sensors(
        self, observation: Observation, outputs: Mapping[int, RobotOutputs], *, again: bool = False
    ) -> None:
        for robot_id, output in outputs.items():
            output.put_odometry(observation, again=again)
            if output.scans:
                self._commands.scan_sent(robot_id)
                output.put_scans(observation, again=again)

    def _resend(self, missing: list[str]) -> None:
        """Lock-step: the tick's inputs once more, for those who owe an answer."""
        assert self._observation is not None
        robots = {names.robot_id_of(name) for name in missing}
        if None in robots:
            # What others than robots need is not known, so it is everything.
            self.repeat()
            return
        chosen = {i: output for i, output in self._outputs.items() if i in robots}
        self._put_transforms(chosen)
        self._put_sensors(self._observation, chosen, again=True)

    def _count(self) -> None:
        engine = self._engine
        if self._lockstep is not None and self._go is None and self._lockstep.is_go:
            self._go = engine.now
        if self._tally.go_stamp is None:
            if self._go is None:
                return
            self._tally.start(self._go, self._poses())
            self._phases.start()
            self._pacer.start_anew()
            self._obeyed_from = engine.tick + 2
        stalled = [robot_id for robot_id in self._outputs if engine.stalled(robot_id)]
        self._tally.add_tick(self._poses(), stalled, {i: len(o.scans) for i, o in self._outputs.items()})
        limit = self._options.run_for
        if limit is not None and self._go is not None and engine.now - self._go >= limit * NS_PER_S:
            self._control.finish()
            trajectory = f"; trajectory {self._tally.trajectory_sha256}" if self._lockstep is not None else ""
            log.info("%g simulated seconds after GO: the world stands still%s", limit, trajectory)

    def _poses(self) -> dict[int, Pose2]:
        return {robot_id: self._engine.truth(robot_id) for robot_id in self._outputs}

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if self._lockstep is None and status.state == TeamState.GO and self._go is None:
            # A GO older than this simulator's own time was given to a team before it: it holds from now on.
            self._go = min(ns_from_time(status.go_stamp), self._engine.now)

    # What the queries ask for; all of it between two ticks, in the main loop.

    def repeat(self) -> None:
        """The last tick's data once more, for who has not heard it."""
        assert self._observation is not None
        present = {i: output for i, output in self._outputs.items() if i in self._observation.robots}
        self._put_transforms(present)
        self._put_sensors(self._observation, present, again=True)
        for output in present.values():
            output.put_rest(self._observation)

    def reset(self) -> None:
        """Everything as at the start; GO stands."""
        self._engine.reset()
        self._meet_robots()
        for robot_id, output in self._outputs.items():
            output.put_statics(self._engine.odom_origin(robot_id))
        self._tally = RunStatistics(self._options.follows, self._options.seed)
        self._commands.start_anew(self._tally)
        self._pacer.start_anew()
        if self._lockstep is not None:
            self._lockstep.start_anew()
        if self._go is not None:
            self._go = self._world.interval
        self._first = True

    def spawn(self, request: SpawnRequest) -> int:
        """A further robot; its id. Raises UsageError."""
        robots = self._engine.robots
        free = next(i for i in range(names.MAX_ROBOT_ID + 1) if i not in robots)
        robot_id = free if request.id is None else request.id
        pose = Pose2(request.x, request.y, request.yaw)
        robot = add_robot(self._world, request.model, pose, names.robot_name(robot_id))
        self._engine.spawn(robot_id, robot, checked=not request.force)
        self._meet_robots()
        return robot_id

    def remove(self, robot_id: int) -> None:
        """Take a robot out of the world. Raises UsageError."""
        self._engine.remove(robot_id)
        self._meet_robots()

    def move(self, request: MoveRequest) -> None:
        """Lift a robot to another place. Raises UsageError."""
        self._engine.place(request.id, Pose2(request.x, request.y, request.yaw), checked=not request.force)
        self._outputs[request.id].put_statics(self._engine.odom_origin(request.id))

    def status(self) -> SimStatus:
        """The answer to `sim/status`."""
        lockstep = self._lockstep
        return SimStatus(
            world=self._world.name,
            robots=sorted(self._outputs),
            interval=self._world.interval,
            seed=self._options.seed,
            now=self._engine.now,
            tick=self._engine.tick,
            real_time_factor=self._pacer.factor,
            speed=self._pacer.speed,
            paused=self._pacer.paused,
            lockstep=lockstep is not None,
            participants=lockstep.participants if lockstep else [],
            joining=lockstep.joining if lockstep else [],
            waiting_for=lockstep.waiting_for() if lockstep else "",
            hung=list(lockstep.hung) if lockstep else [],
            writers=self._commands.writers(),
        )

    def report(self) -> SimReport:
        """The answer to `sim/report`."""
        report = self._tally.report(self._engine.now, self._control.finished)
        report.timing_ms = Timing(**self._phases.mean_ms())
        if report.wall_seconds > 0.0:
            elapsed = (report.ticks - 1) * self._world.interval / NS_PER_S
            report.real_time_factor = elapsed / report.wall_seconds
        report.lateness_p99_ms = self._pacer.lateness_p99_ms
        if self._lockstep is not None:
            report.lockstep, report.resends, report.hung = True, self._lockstep.resends, list(self._lockstep.hung)
        return report


def check_follows(follows: Mapping[int, int], robots: Mapping[int, Robot]) -> None:
    """Raise UsageError if a measured pair names a robot that the world has not."""
    for robot_id in (*follows.keys(), *follows.values()):
        if robot_id not in robots:
            raise UsageError(f"--gap names robot {robot_id}, but the world has {sorted(robots)}")


def run_simulator(
    node: Node, world: World, robots: dict[int, Robot], options: SimOptions, kernels: Takeover | None = None
) -> None:
    """Be the simulator until asked to stop; `kernels` take over from those that it begins with."""
    check_follows(options.follows, robots)
    simulator = Simulator(node, world, robots, options, kernels)
    simulator.publish_statics()
    node.become_present()
    log.info("%s: %d robots, a tick every %g ms", world.name, len(robots), world.interval / 1e6)
    if kernels is not None:
        # Not before: who starts along with this process needs the processors now.
        kernels.start()
        node.on_stop(kernels.close)
    simulator.run()
