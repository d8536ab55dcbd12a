"""A world on the bus: what a tick does, what counts, and the changes that are asked for."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import msgspec

from zteam import names
from zteam.bus.lateness import LATE
from zteam.clock import NS_PER_S, monotonic, to_ns, to_seconds
from zteam.config.numbers import counted
from zteam.errors import UsageError, log
from zteam.geometry import Pose2
from zteam.messages import Clock, Input, TeamState, TeamStatus, Twist, encode, ns_from_time, time_from_ns
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import SimOptions
from zteam.node.stopping import STOPS
from zteam.simulator import client
from zteam.simulator.core import Engine, Observation
from zteam.simulator.faults import FaultPlan, is_simulated
from zteam.simulator.process.commands import Holds, RobotCommands
from zteam.simulator.process.lockstep import LockStep
from zteam.simulator.process.open_tick import OpenTick
from zteam.simulator.process.outputs import TeamOutputs
from zteam.simulator.process.pacing import Pacer, TickBoundary
from zteam.simulator.process.statistics import RunStatistics, TickProfile
from zteam.simulator.world import Robot, World, add_robot
from zteam.simulator.world.placing import map_metadata

ANSWER_SHARE = 0.4
"""Share of a tick's host time for which the rest of its messages waits for the robots' commands."""


class Simulation:
    """A world on the bus: its ticks, the count of its run, and the changes that are asked for. The main loop calls all
    of it, but for `set_go`, `status` and `report`, which any thread may call."""

    def __init__(self, node: ProcessNode, world: World, robots: Mapping[int, Robot], options: SimOptions) -> None:
        self.world, self._options, self._instance = world, options, node.bus.instance
        self._map = client.map_info(map_metadata(world, options.engine.map_resolution))
        self.engine = Engine(world, seed=options.seed, robots=robots, options=options.engine)
        self.pacer = Pacer(world.interval, options.speed, paused=options.paused)
        self.boundary = TickBoundary(node, self.pacer)
        self.boundary.begin_anew()
        self.profile = TickProfile()
        self.statistics = RunStatistics(options.follows)
        self.outputs = TeamOutputs(node.bus, self.engine, lockstep=options.lockstep is not None)
        self.faults = FaultPlan(options.faults, world.interval, to_ns(LATE))
        self.commands = RobotCommands(node, self.outputs, self.statistics, lockstep=options.lockstep is not None)
        self.lockstep: LockStep | None = None
        if options.lockstep is not None:
            self.lockstep = LockStep(node, options.lockstep, self.commands.answered)
            self.commands.passes_over = self.lockstep.outside.has
        self.holds = Holds(node.bus, self._stop)
        # As soon as this process answers to its name; what it asks comes after that, and before the first tick.
        node.on_present(self.holds.learn)
        self._changes: dict[str, tuple[Any, Callable[[Any], object]]] = {
            _change_key("spawn"): (client.SpawnRequest, self.spawn),
            _change_key("remove"): (client.RemoveRequest, lambda request: self.remove(request.id)),
            _change_key("move"): (client.MoveRequest, self.move),
            _change_key("fault"): (client.FaultRequest, self.add_fault),
        }
        """What a request changes that a tick has carried, by its key."""
        self._clock = node.bus.publisher(names.CLOCK, Clock)
        self._observation: Observation | None = None
        self._opened: tuple[list[int], list[str]] = [], []
        """Robots and sessions of the last `sim/tick` (lock-step)."""
        self._is_early = True
        """Whether `sim/tick` comes before the data of its tick."""
        self._is_first = True
        """Whether no tick was sent yet since the start or the last reset."""
        self._go: int | None = None
        """Simulated time (ns) from which GO holds; None before GO."""
        if options.lockstep is None:
            node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)

    def tick(self, commands: Mapping[int, Twist]) -> None:
        """One tick with these commands; what the robots' next commands depend on is sent."""
        self.pacer.start(monotonic())
        self.engine.move({**self._open(), **commands}, self.holds.held)
        self.profile.end("physics")
        self._send_inputs()
        if self.lockstep is None:
            # The rest wakes every process, and no robot's next command depends on it: the robots' commands come first.
            speed = None if self.pacer.paused else self.pacer.speed
            tick_seconds = 0.0 if speed is None else self.world.interval / NS_PER_S / speed
            self.commands.wait_for_answers(ANSWER_SHARE * tick_seconds)
            self.profile.end("wait")

    def _open(self) -> dict[int, Twist]:
        """Open the next tick in lock-step, which fixes the sessions that take part and what came from outside. The
        commands of that."""
        lockstep, engine = self.lockstep, self.engine
        if lockstep is None:
            return {}
        for each in lockstep.outside.coming(engine.tick + 1):
            self._change_again(each)
        now, robots = engine.now + self.world.interval, list(self.outputs)
        out = self.faults.absent(None if self._go is None else now - self._go)
        came = lockstep.open(now, engine.tick + 1, robots, out)
        outside: dict[int, Twist] = {}
        for each in came:
            robot_id, topic = names.split_robot_key(each.key) or (-1, each.key)
            if each.type == Input.REQUEST and topic in STOPS:
                self.holds.hold(robot_id, STOPS[topic])
            elif topic == names.CMD_VEL:
                if (command := self.commands.read(each)) is None:
                    continue
                outside[robot_id] = command
            if topic != names.TEAM_STATUS:
                self.statistics.add_external_command()
        # Where the aggregator has to learn which robots' transforms to wait for, which sessions' and inputs count, and
        # where time starts anew, the tick comes before the data.
        tick = lockstep.tick.message
        opened, self._opened = self._opened, (robots, tick.sessions)
        self._is_early = engine.tick == 0 or bool(tick.inputs) or opened != self._opened
        return outside

    def _change_again(self, recorded: Input) -> None:
        """A run is run again: change the world as a query has changed it before this tick."""
        robot_id, topic = names.split_robot_key(recorded.key) or (-1, recorded.key)
        if recorded.type != Input.REQUEST:
            return
        if topic in STOPS:
            self.holds.note(robot_id, STOPS[topic])
        elif topic in self._changes:
            request_type, change = self._changes[topic]
            try:
                change(msgspec.json.decode(recorded.data.tobytes(), type=request_type))
            except UsageError as error:
                log.error("tick %d: %s cannot be done again: %s", self.engine.tick + 1, topic, error)

    def _stop(self, robot_id: int, stopped: bool) -> None:
        """A query stops or releases a robot: in lock-step with the next tick, for its process too."""
        if self.lockstep is None:
            self.holds.hold(robot_id, stopped)
            self.statistics.add_external_command()
        else:
            topic, slot = names.ENGAGE if stopped else names.RELEASE, names.robot_key(robot_id, names.STOP)
            self.lockstep.outside.add(names.robot_key(robot_id, topic), b"{}", slot=slot)

    def _note_change(self, service: str, request: msgspec.Struct) -> None:
        """A query has changed the world. In lock-step the next tick tells so, and the run can be repeated."""
        if self.lockstep is None:
            self.statistics.add_external_command()
        else:
            self.lockstep.outside.add(_change_key(service), msgspec.json.encode(request))

    def send_rest(self) -> None:
        """Send the clock, which wakes every process, and what no robot's next command depends on."""
        assert self._observation is not None
        if not self._is_first and self._clock.has_subscribers:
            self._clock.put(Clock(time_from_ns(self.engine.now)))
        for output in self.outputs.values():
            output.put_rest(self._observation)
        self._is_first = False
        self.profile.end("publish")

    def _send_inputs(self) -> None:
        """Compute the sensors, and send what the robots' next commands depend on."""
        engine, outputs = self.engine, self.outputs
        if self._is_first:
            # A process that knew an earlier simulator must see time jump back before it gets this one's data.
            self._clock.put(Clock(time_from_ns(engine.now)))
        # Otherwise `sim/tick` comes last: then it wakes the robots together with the scans.
        if self.lockstep is not None and self._is_early:
            self.lockstep.send()
        # Transforms leave before the lasers are computed. They pass through the aggregator, and this way the tree is
        # complete when a robot has its scan.
        observation = engine.observe_bases()
        for output in outputs.values():
            output.put_transforms(observation)
        for output in outputs.values():
            output.put(output.odom, observation)
        self.profile.end("publish")
        engine.measure(observation)
        self._observation = observation
        self.profile.end("sensors")
        self._put_scans(observation, outputs)
        if self.lockstep is not None and not self._is_early:
            self.lockstep.send()
        self.profile.end("publish")

    def _put_scans(self, observation: Observation, robot_ids: Iterable[int], *, again: bool = False) -> None:
        for robot_id in robot_ids:
            output = self.outputs[robot_id]
            if output.scans:
                self.commands.scan_sent(robot_id)
            output.put(output.scans, observation, again=again)

    def take_commands(self) -> dict[int, Twist]:
        """The commands since the last tick, for the next one."""
        commands = self.commands.drain()
        if self.lockstep is None:
            self.statistics.add_late_steps(self.engine.tick, self.commands.missing(commands))
            return commands
        answers = dict(
            self.faults.deliver(self.since_go, self.lockstep.ask(lambda tick: tick.take_commands(self.outputs)))
        )
        self.outputs.put_commands(answers)
        return commands | answers

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO:
            self.set_go(ns_from_time(status.go_stamp))

    def set_go(self, stamp: int) -> None:
        """GO holds from simulated time `stamp` (ns) on, but not from later than now. Only the first GO counts."""
        if self._go is None:
            # A stamp beyond this simulator's time belongs to an earlier simulator: GO then holds from now on.
            self._go = min(stamp, self.engine.now)

    @property
    def since_go(self) -> int | None:
        """Simulated ns since GO; None before."""
        return None if self._go is None else self.engine.now - self._go

    def count(self) -> None:
        """Count the engine's tick if GO was given; finish the run if its time is over with it."""
        engine, run_for, until = self.engine, self._options.run_for, self._options.until
        if self.lockstep is not None and self.lockstep.tick.message.epoch > 0:
            self.set_go(engine.now)
        end = f"before tick {engine.tick + 1}" if until is not None and engine.tick + 1 >= until else ""
        if self._go is not None:
            ids, poses, stalled = engine.standing()
            if self.statistics.go_stamp is None:
                self.statistics.start(self._go, engine.tick, ids, poses)
                self.profile.start()
                self.pacer.start_anew()
            scans = {robot_id: len(output.scans) for robot_id, output in self.outputs.items()}
            self.statistics.add_tick(ids, poses, stalled, scans)
            if not end and run_for is not None and engine.now - self._go >= run_for * NS_PER_S:
                end = f"{counted(run_for, 'simulated second')} after GO"
        if engine.tick == self._options.pause_at and not self.pacer.paused:
            self.pacer.pause()
            log.info("paused at tick %d: 'zteam sim resume' goes on", engine.tick)
        if end and not self.boundary.finished:
            self.boundary.finish()
            trajectory = "" if self.lockstep is None else f"; trajectory {self.statistics.trajectory_sha256}"
            log.info("%s: the world stands still%s", end, trajectory)

    def scans(self, robot_ids: Iterable[int]) -> client.ScansReply:
        """What the lasers of these robots saw in the last tick."""
        observation, outputs = self._observation, self.outputs
        if observation is None:
            return client.ScansReply([])
        there = [i for i in robot_ids if i in outputs and i in observation.robots]
        scans = [(names.scan_key(i, n), build(observation, i, n)) for i in there for _, build, n in outputs[i].scans]
        return client.ScansReply([client.SensedScan(key, encode(scan)) for key, scan in scans])

    def repeat(self, participants: Sequence[str] = ()) -> None:
        """Send the last tick's data again, for processes that have not received it. Of `participants` (lock-step) that
        are all robots, only the inputs: those of other processes are not known."""
        observation, outputs, count = self._observation, self.outputs, self.outputs.bus.in_ticks
        assert observation is not None
        # First sendings alone are counted.
        sent = count.sent
        robots = {names.robot_id_of(name) for name in participants} or {None}
        present = [i for i in outputs if i in observation.robots and (i in robots or None in robots)]
        for i in present:
            outputs[i].put_transforms(observation)
            outputs[i].put(outputs[i].odom, observation, again=True)
        self._put_scans(observation, present, again=True)
        for i in present if None in robots else ():
            outputs[i].put_rest(observation)
        count.sent = sent

    def reset(self) -> None:
        """Put everything back to the start, where GO, if it was given, holds from the first tick on."""
        self.engine.reset()
        self.match_robots()
        for robot_id in self.outputs:
            self.outputs.put_statics(robot_id)
        self.statistics.start_anew()
        if self._go is not None:
            self._go = self.world.interval
        self.commands.start_anew()
        self.faults.start_anew()
        self.pacer.start_anew()
        self._is_first = True
        if self.lockstep is not None:
            self.lockstep.ask(OpenTick.start_anew)
            self.lockstep.outside.start_anew()
        self.boundary.begin_anew()

    def match_robots(self) -> None:
        """Publish what the robots sense that are in the world now, and answer for them."""
        self.outputs.match_robots()
        self.holds.match_robots(self.outputs.keys())
        if self.lockstep is not None:
            self.lockstep.outside.read(names.robot_key(robot_id, names.CMD_VEL) for robot_id in self.outputs)

    def spawn(self, request: client.SpawnRequest) -> int:
        """Add a robot and return its id. Raises UsageError."""
        robots = self.engine.robots
        free = next(i for i in range(names.MAX_ROBOT_ID + 1) if i not in robots)
        robot_id = free if request.id is None else request.id
        robot = add_robot(self.world, request.model, _pose(request), names.robot_name(robot_id))
        self.engine.spawn(robot_id, robot, checked=not request.force)
        self.statistics.set_down(robot_id, robot.pose)
        self.match_robots()
        self._note_change("spawn", msgspec.structs.replace(request, id=robot_id))
        return robot_id

    def remove(self, robot_id: int) -> None:
        self.engine.remove(robot_id)
        self.match_robots()
        self._note_change("remove", client.RemoveRequest(robot_id))

    def move(self, request: client.MoveRequest) -> None:
        """Put a robot at another pose. Raises UsageError."""
        self.engine.place(request.id, _pose(request), checked=not request.force)
        self.statistics.set_down(request.id, _pose(request))
        self.outputs.put_statics(request.id)
        self._note_change("move", request)

    def add_fault(self, request: client.FaultRequest) -> None:
        """Carry out a fault from the next tick on (lock-step). Raises UsageError."""
        if self.lockstep is None or self._go is None:
            raise UsageError("the simulator carries out faults in lock-step alone, and after GO")
        soon = to_seconds(self.engine.now + self.world.interval - self._go)
        fault = msgspec.structs.replace(request.fault, at=soon)
        if not is_simulated(fault):
            raise UsageError(f"{fault.fault} {fault.name}: in lock-step this happens to a process, not in the world")
        self.faults.add(fault)
        self._note_change("fault", request)

    def status(self) -> client.SimStatus:
        lockstep = self.lockstep
        return client.SimStatus(
            world=self.world.name,
            robots=sorted(self.engine.robots),
            interval=self.world.interval,
            seed=self._options.seed,
            now=self.engine.now,
            tick=self.engine.tick,
            real_time_factor=self.pacer.factor,
            speed=self.pacer.speed,
            paused=self.pacer.paused,
            lockstep=lockstep is not None,
            participants=lockstep.tick.members if lockstep else [],
            joining=sorted(lockstep.tick.joining) if lockstep else [],
            waiting_for=lockstep.ask(OpenTick.waiting_for) if lockstep else "",
            silent=lockstep.ask(OpenTick.silent) if lockstep else [],
            hung=list(lockstep.tick.hung) if lockstep else [],
            finished=self.boundary.finished,
            instance=self._instance,
            writers=self.commands.writers(),
            stopped=self.holds.stopped,
            map=self._map,
        )

    def report(self) -> client.SimReport:
        lockstep, run = self.lockstep, self.statistics
        go_stamp, ticks, wall = run.go_stamp, run.ticks, run.wall_seconds
        elapsed = (ticks - 1) * self.world.interval / NS_PER_S
        return client.SimReport(
            sim_seconds=0.0 if go_stamp is None else max(0, self.engine.now - go_stamp) / NS_PER_S,
            seed=self._options.seed,
            external_commands=run.external_commands,
            finished=self.boundary.finished,
            robots=run.robots(),
            latency_ms=run.latency(),
            ticks=ticks,
            wall_seconds=wall,
            real_time_factor=elapsed / wall if wall > 0.0 else None,
            trajectory_sha256=run.trajectory_sha256,
            lockstep=lockstep is not None,
            resends=lockstep.resends if lockstep else 0,
            hung=list(lockstep.tick.hung) if lockstep else [],
            timing_ms=self.profile.timing(),
            lateness_p99_ms=self.pacer.lateness_p99_ms,
        )


_change_key = partial(names.service_key, names.SIMULATOR)


def _pose(request: client.SpawnRequest | client.MoveRequest) -> Pose2:
    return Pose2(request.x, request.y, request.yaw)
