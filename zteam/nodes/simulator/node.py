"""The simulator process: it steps the engine, publishes what the robots sense, and takes their commands.

A tick: commands in, `Engine.move`, transforms out, `Engine.observe`, everything else out. In lock-step the next tick
begins when every participant has answered and it is due; in real time when it is due.
"""

import logging
from collections.abc import Mapping

from zteam import names
from zteam.clock import NS_PER_S, Every, monotonic
from zteam.errors import UsageError
from zteam.messages import OccupancyGrid, TeamState, TeamStatus, Twist, ns_from_time
from zteam.nodes.simulator import tick_profile
from zteam.nodes.simulator.commands import Commands
from zteam.nodes.simulator.lockstep import LockStep
from zteam.nodes.simulator.outside_commands import OutsideCommands
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.queries import Queries
from zteam.nodes.simulator.reports import Reporter
from zteam.nodes.simulator.run_counter import RunCounter
from zteam.nodes.simulator.run_statistics import RunStatistics
from zteam.nodes.simulator.shapes import serve_shapes
from zteam.nodes.simulator.team_outputs import TeamOutputs
from zteam.nodes.simulator.tick_profile import TickProfile
from zteam.nodes.simulator.tick_sender import TickSender
from zteam.nodes.simulator.turns import Turns
from zteam.nodes.simulator.world_changes import WorldChanges
from zteam.numbers import counted
from zteam.process_options import SimOptions
from zteam.runtime.process_node import ProcessNode
from zteam.services.simulator import map_info
from zteam.sim import Engine
from zteam.sim.occupancy_grid import map_message, map_metadata
from zteam.world import Robot, World

log = logging.getLogger("zteam")

ANSWER_SHARE = 0.4
"""Share of a tick's host time for which the rest of its messages waits for the robots' commands."""


class Simulator:
    """A world on the bus: the main loop, and the parts that it drives. `run` is the main loop."""

    def __init__(self, node: ProcessNode, world: World, robots: dict[int, Robot], options: SimOptions) -> None:
        self._node, self._world, self._options = node, world, options
        self._engine = Engine(world, seed=options.seed, robots=robots, options=options.engine)
        self._profile = TickProfile()
        self._pacer = Pacer(world.interval, options.speed, paused=options.paused)
        self._statistics = RunStatistics(options.follows)
        self._outputs = TeamOutputs(node, self._engine, lockstep=bool(options.lockstep))
        self._commands = Commands(node, self._outputs.__contains__, self._statistics)
        self._lockstep = LockStep(node, options.lockstep, self._commands.answered) if options.lockstep else None
        self._counter = RunCounter(
            self._engine,
            self._outputs,
            self._statistics,
            self._profile,
            self._pacer,
            options.run_for,
            options.until,
        )
        self._sender = TickSender(node, self._engine, self._outputs, self._commands, self._lockstep, self._profile)
        self._turns = Turns(node, self._pacer)
        self._behind = Every(5.0)
        if self._lockstep is None:
            node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        else:
            OutsideCommands(node, self._outputs.__contains__, self._lockstep, self._statistics)
        self._serve_queries()

    def _serve_queries(self) -> None:
        reporter = Reporter(
            self._world,
            map_info(map_metadata(self._world, self._options.map_resolution)),
            self._options.seed,
            self._node.bus.instance,
            self._engine,
            self._commands,
            self._pacer,
            self._lockstep,
            self._statistics,
            self._profile,
        )
        serve_shapes(self._node.bus, self._world, self._engine)
        on_reset = [part.start_anew for part in (self._counter, self._commands, self._pacer, self._sender)]
        if self._lockstep is not None:
            on_reset.append(self._lockstep.start_anew)
        turns = self._turns
        Queries(
            self._node,
            self._pacer,
            turns,
            WorldChanges(
                self._world, self._engine, self._outputs, self._sender, on_reset, self._statistics.add_external_command
            ),
            lambda: reporter.status(turns.finished),
            lambda: reporter.report(turns.finished),
        )

    def publish_statics(self) -> None:
        """Send the latched messages: every robot's fixed frames, and the map."""
        self._outputs.match_robots()
        if self._options.has_map:
            self._map = self._node.bus.publisher(names.MAP, OccupancyGrid, latched=True)
            self._map.put(map_message(self._world, self._options.map_resolution))

    def run(self) -> None:
        """Tick until the process is asked to stop."""
        commands: dict[int, Twist] = {}
        while True:
            self._tick(commands)
            if self._lockstep is not None and not self._lockstep.wait(self._sender.repeat_for):
                return
            self._profile.end(tick_profile.WAIT)
            if not self._counter.is_counting:
                # GO may have come while the first tick was held.
                self._count()
            if not self._turns.wait_for_turn():
                return
            self._profile.end(tick_profile.IDLE)
            commands = self._take_commands()
            self._profile.end_tick()
            if self._pacer.behind and self._behind.due():
                log.warning("real-time factor %.2g: %s", self._pacer.factor, self._profile.last_text())

    def _tick(self, commands: dict[int, Twist]) -> None:
        self._pacer.start(monotonic(), counts=not self._sender.is_first)
        self._engine.move(commands)
        self._profile.end(tick_profile.PHYSICS)
        self._sender.send_inputs()
        if self._lockstep is None:
            # The rest wakes every process, and no robot's next command depends on it: the robots' commands come first.
            self._commands.wait_for_answers(ANSWER_SHARE * self._tick_seconds)
            self._profile.end(tick_profile.WAIT)
        # Before the clock: a process that hears the last tick's clock may ask for the report at once.
        self._count()
        self._sender.send_rest()

    @property
    def _tick_seconds(self) -> float:
        """Host seconds of a tick at the speed that was asked for; 0 as fast as possible."""
        speed = None if self._pacer.paused else self._pacer.speed
        return 0.0 if speed is None else self._world.interval / NS_PER_S / speed

    def _take_commands(self) -> dict[int, Twist]:
        commands = self._commands.take()
        if self._lockstep is None:
            self._statistics.add_late_steps(self._engine.tick, self._commands.missing(commands))
            return commands
        answers = self._lockstep.take_commands(self._outputs)
        self._outputs.put_commands(answers)
        return commands | answers

    def _count(self) -> None:
        if self._lockstep is not None and self._lockstep.is_go:
            self._counter.take_go(self._engine.now)
        if self._counter.count() and not self._turns.finished:
            self._turns.finish()
            trajectory = f"; trajectory {self._statistics.trajectory_sha256}" if self._lockstep is not None else ""
            log.info("%s: the world stands still%s", self._end_text(), trajectory)

    def _end_text(self) -> str:
        until = self._options.until
        if until is not None and self._engine.tick + 1 >= until:
            return f"before tick {self._engine.tick + 1}"
        return f"{counted(self._options.run_for or 0.0, 'simulated second')} after GO"

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO:
            self._counter.take_go(ns_from_time(status.go_stamp))


def check_follows(follows: Mapping[int, int], robots: Mapping[int, Robot]) -> None:
    """Raise UsageError if a measured pair names a robot that the world does not have."""
    for robot_id in (*follows.keys(), *follows.values()):
        if robot_id not in robots:
            raise UsageError(f"--gap names robot {robot_id}, but the world has {sorted(robots)}")


def run_simulator(node: ProcessNode, world: World, robots: dict[int, Robot], options: SimOptions) -> None:
    """Run the simulator until it is asked to stop."""
    check_follows(options.follows, robots)
    simulator = Simulator(node, world, robots, options)
    simulator.publish_statics()
    node.become_present()
    log.info("%s: %s, a tick every %g ms", world.name, counted(len(robots), "robot"), world.interval / 1e6)
    simulator.run()
