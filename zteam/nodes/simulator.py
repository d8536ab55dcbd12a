"""The simulator process: steps the engine in real time, publishes what robots sense, takes their commands."""

import logging
import threading
from collections.abc import Mapping
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import NoRequest, Publisher
from zteam.bus.transport import RawSample
from zteam.clock import NS_PER_S, Every, monotonic, wait_until
from zteam.errors import UsageError
from zteam.messages import (
    Blobs,
    Bool,
    Bumper,
    Clock,
    Fiducials,
    JointState,
    LaserScan,
    OccupancyGrid,
    Odometry,
    Range,
    TeamState,
    TeamStatus,
    TFMessage,
    Twist,
    ns_from_time,
    time_from_ns,
)
from zteam.nodes.node import Node
from zteam.nodes.pacing import Pacer
from zteam.nodes.sim_messages import SimReport, SimStatus
from zteam.nodes.tally import Tally
from zteam.sim import Engine, Observation, Options
from zteam.sim import reports as observed
from zteam.sim.mapping import map_message
from zteam.world import Robot, World

log = logging.getLogger("zteam")

ANSWER_TIME = 0.01
"""Host seconds that the rest of a tick's messages wait for the robots' commands."""


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


class _Outputs:
    """One robot's publishers."""

    def __init__(self, node: Node, robot_id: int, robot: Robot) -> None:
        def key(topic: str) -> str:
            return names.robot_key(robot_id, topic)

        bus = node.bus
        lasers = sum(1 for ranger in robot.rangers if ranger.samples > 1)
        self.tf: Publisher[TFMessage] = bus.publisher(key(names.TF), TFMessage)
        self.tf_static = bus.publisher(key(names.TF_STATIC), TFMessage, latched=True)
        self.odom = bus.publisher(key(names.ODOM), Odometry)
        self.truth = bus.publisher(key(names.GROUND_TRUTH), Odometry)
        self.stall = bus.publisher(key(names.STALL), Bool)
        self.scans = [bus.publisher(names.scan_key(robot_id, i), LaserScan) for i in range(lasers)]
        self.sonars = [bus.publisher(names.sonar_key(robot_id, i), Range) for i in range(len(robot.rangers) - lasers)]
        self.joints = bus.publisher(key(names.JOINT_STATES), JointState)
        self.bumpers = [bus.publisher(key(names.BUMPER), Bumper)] if robot.bumpers else []
        self.fiducials = [
            bus.publisher(names.numbered_key(robot_id, names.FIDUCIALS, i), Fiducials)
            for i in range(len(robot.finders))
        ]
        self.blobs = [
            bus.publisher(names.numbered_key(robot_id, names.BLOBS, i), Blobs) for i in range(len(robot.blobfinders))
        ]

    def put_rest(self, observation: Observation, robot_id: int) -> None:
        """What no robot's next command hangs on; a message without a taker is not even made."""
        if self.truth.wanted:
            self.truth.put(observed.ground_truth_message(observation, robot_id))
        if self.stall.wanted:
            self.stall.put(Bool(observation.robots[robot_id].stall))
        if self.joints.wanted:
            self.joints.put(observed.joint_message(observation, robot_id))
        for i, sonar in enumerate(self.sonars):
            if sonar.wanted:
                sonar.put(observed.range_message(observation, robot_id, i))
        for bumper in self.bumpers:
            if bumper.wanted:
                bumper.put(observed.bumper_message(observation, robot_id))
        for i, fiducials in enumerate(self.fiducials):
            if fiducials.wanted:
                fiducials.put(observed.fiducials_message(observation, robot_id, i))
        for i, blobs in enumerate(self.blobs):
            if blobs.wanted:
                blobs.put(observed.blobs_message(observation, robot_id, i))


class _Commands:
    """What arrived on `robot_N/cmd_vel` since the last tick. Filled by the bus's threads."""

    def __init__(self, node: Node, robots: Mapping[int, Robot], tally: Tally) -> None:
        self._node = node
        self._robots = robots
        self._tally = tally
        self._lock = threading.Condition()
        self._fresh: dict[int, Twist] = {}
        self._scan_sent: dict[int, float] = {}
        self._holders: dict[int, set[str]] = {robot_id: set() for robot_id in robots}
        node.bus.watch_tokens([names.tokens_key()], self._on_token)
        node.bus.subscribe_raw(names.all_robots_key(names.CMD_VEL), self._on_sample)

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        robot_id = names.robot_id_of(token[0]) if token else None
        if token and robot_id in self._holders:
            with self._lock:
                holders = self._holders[robot_id]
                (holders.add if alive else holders.discard)(token[1])

    def _on_sample(self, sample: RawSample) -> None:
        arrived = monotonic()
        target = names.split_robot_key(sample.key)
        if target is None or target[0] not in self._robots:
            self._node.bus.counters.drop(sample.key, "the world has no such robot")
            return
        command = self._node.bus.decode(sample, Twist)
        if command is None:
            return
        robot_id = target[0]
        with self._lock:
            if sample.source not in self._holders[robot_id]:
                self._tally.external_commands += self._tally.go_stamp is not None
            sent = self._scan_sent.pop(robot_id, None)
            self._fresh[robot_id] = command
            self._lock.notify_all()
        if sent is not None:
            self._tally.add_latency(arrived - sent)

    def scan_sent(self, robot_id: int) -> None:
        """The robot's scan of this tick leaves now."""
        with self._lock:
            self._scan_sent[robot_id] = monotonic()

    def wait_for_answers(self, timeout: float) -> None:
        """Let the robots that were sent a scan answer, for `timeout` host seconds at most."""
        with self._lock:
            wait_until(self._lock, lambda: not any(self._holders[i] for i in self._scan_sent), timeout)

    def take(self) -> tuple[dict[int, Twist], list[int]]:
        """The commands since the last call, and the robots with a living process that sent none."""
        with self._lock:
            fresh, self._fresh = self._fresh, {}
            late = [robot_id for robot_id, holders in self._holders.items() if holders and robot_id not in fresh]
        return fresh, late


class Simulator:
    """A world on the bus."""

    def __init__(self, node: Node, world: World, robots: dict[int, Robot], options: SimOptions) -> None:
        self._node = node
        self._options = options
        self._world = world
        self._robots = robots
        self._engine = Engine(world, seed=options.seed, robots=robots, options=options.engine)
        self._tally = Tally(options.follows, options.seed)
        self._commands = _Commands(node, robots, self._tally)
        self._pacer = Pacer(world.interval)
        self._finished = False
        self._go: int | None = None
        self._obeyed_from: int | None = None
        """First tick whose scans every robot can have met with GO in hand: GO may cross the scans of two ticks."""
        self._clock = node.bus.publisher(names.CLOCK, Clock)
        self._outputs = {robot_id: _Outputs(node, robot_id, robot) for robot_id, robot in robots.items()}
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        node.bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: self._status())
        node.bus.serve(names.service_key(names.SIMULATOR, "report"), NoRequest, lambda _: self._report())

    def publish_statics(self) -> None:
        """Send the latched messages: every robot's fixed frames, and the map."""
        for robot_id, outputs in self._outputs.items():
            origin = self._engine.odom_origin(robot_id)
            outputs.tf_static.put(observed.static_transforms(robot_id, self._robots[robot_id], origin))
        self._map = self._node.bus.publisher(names.MAP, OccupancyGrid, latched=True)
        self._map.put(map_message(self._world, self._options.map_resolution))

    def run(self) -> None:
        """Tick until the process is asked to stop."""
        slow = Every(5.0)
        while self._pacer.wait(self._node):
            if self._finished:
                self._node.wait(lambda: False, 3600.0)
                continue
            commands, late = self._commands.take()
            if self._obeyed_from is not None and self._engine.tick >= self._obeyed_from:
                self._tally.add_late_steps(late)
            self._tick(commands)
            factor = self._pacer.factor
            if factor < 0.95 and slow.due():
                log.warning("real-time factor %.2f: a tick takes %.0f ms", factor, self._pacer.busy * 1e3)

    def _tick(self, commands: dict[int, Twist]) -> None:
        engine = self._engine
        engine.move(commands)
        first = engine.tick == 1
        if first:
            # Whoever knew a simulator before this one must see time jump back before its data.
            self._clock.put(Clock(time_from_ns(engine.now)))
        # Transforms leave before the lasers are even computed: they go over the aggregator, so this way the tree is
        # whole when a robot has its scan and looks. The clock wakes every process, so it leaves when the scans have.
        for robot_id, outputs in self._outputs.items():
            outputs.tf.put(observed.transforms(engine.now, robot_id, engine.odom(robot_id)))
        observation = engine.observe()
        for robot_id, outputs in self._outputs.items():
            if outputs.odom.wanted:
                outputs.odom.put(observed.odometry_message(observation, robot_id))
            for i, scan in enumerate(outputs.scans):
                if scan.wanted:
                    message = observed.scan_message(observation, robot_id, i)
                    if i == 0:
                        self._commands.scan_sent(robot_id)
                    scan.put(message)
        # What follows wakes every process, and nobody's next command hangs on it: the robots' answers come first.
        self._commands.wait_for_answers(min(ANSWER_TIME, 0.1 * self._world.interval / NS_PER_S))
        # Whoever hears the last tick's clock may ask for the report at once.
        self._count()
        if not first:
            self._clock.put(Clock(time_from_ns(engine.now)))
        for robot_id, outputs in self._outputs.items():
            outputs.put_rest(observation, robot_id)

    def _count(self) -> None:
        engine = self._engine
        poses = {robot_id: engine.truth(robot_id) for robot_id in self._robots}
        if self._tally.go_stamp is None:
            if self._go is None:
                return
            self._tally.start(self._go, poses)
            self._obeyed_from = engine.tick + 2
        stalled = [robot_id for robot_id in self._robots if engine.stalled(robot_id)]
        self._tally.add_tick(poses, stalled, {i: len(o.scans) for i, o in self._outputs.items()})
        limit = self._options.run_for
        if limit is not None and self._go is not None and engine.now - self._go >= limit * 1e9:
            self._finished = True
            log.info("%g simulated seconds after GO: the world stands still", limit)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO and self._go is None:
            # A GO older than this simulator's own time was given to a team before it: it holds from now on.
            self._go = min(ns_from_time(status.go_stamp), self._engine.now)

    def _status(self) -> SimStatus:
        return SimStatus(
            world=self._world.name,
            robots=sorted(self._robots),
            interval=self._world.interval,
            seed=self._options.seed,
            now=self._engine.now,
            tick=self._engine.tick,
            real_time_factor=self._pacer.factor,
        )

    def _report(self) -> SimReport:
        return self._tally.report(self._engine.now, self._finished)


def check_follows(follows: Mapping[int, int], robots: Mapping[int, Robot]) -> None:
    """Raise UsageError if a measured pair names a robot that the world has not."""
    for robot_id in (*follows.keys(), *follows.values()):
        if robot_id not in robots:
            raise UsageError(f"--gap names robot {robot_id}, but the world has {sorted(robots)}")


def run_simulator(node: Node, world: World, robots: dict[int, Robot], options: SimOptions) -> None:
    """Be the simulator until asked to stop."""
    check_follows(options.follows, robots)
    simulator = Simulator(node, world, robots, options)
    simulator.publish_statics()
    node.become_present()
    log.info("%s: %d robots, a tick every %g ms", world.name, len(robots), world.interval / 1e6)
    simulator.run()
