"""The robot process: one robot's brain. It cannot tell the simulator from a real base.

It acts when a scan arrives, not on a timer of its own, so that a command follows its scan at once; between scans it
only watches for data that has grown old. In lock-step it acts once a tick, when all its inputs of that tick have come.
"""

import logging
from collections.abc import Callable
from functools import partial
from itertools import count

from zteam import names
from zteam.bus import Deferred, NoRequest
from zteam.bus.lateness import Lateness
from zteam.bus.transport import RawSample
from zteam.clock import FREEZES, Every, monotonic, to_ns
from zteam.errors import BusError
from zteam.messages import (
    BaseInfo,
    LaserScan,
    Message,
    Odometry,
    RobotState,
    RobotStatus,
    TeamStatus,
    TFMessage,
    Tick,
    Twist,
)
from zteam.messages.tf_stamps import bases_stamp
from zteam.messages.topics import has_one_writer, is_latched
from zteam.node.lockstep import Participant
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import RobotOptions
from zteam.node.rivals import RivalWatch
from zteam.node.robot_status import Readiness, StatusReport, go_epoch
from zteam.node.stopping import StopSwitch
from zteam.node.tick_messages import MAX_AHEAD, HeldMessage, stamp_of
from zteam.node.tokens import TokenSet
from zteam.robot.behaviors import Behavior
from zteam.robot.behaviors.behavior import declared_inputs
from zteam.robot.client import CANCEL, SAFETY, CancelReply, CancelRequest, SafetyReply, navigation_query
from zteam.robot.process.driver import ALONE, Driver, StepInput
from zteam.robot.process.inputs import SOURCES, RobotInputs, TransformInputs
from zteam.robot.process.parameters import BehaviorParameters
from zteam.simulator.client import absence_text, read_status

log = logging.getLogger("zteam")

_HEARTBEAT = 1.0
"""Host seconds after which a robot gives a sign of life."""
_LOOK = 0.1
"""Host seconds between two looks at whether data has stopped, in real time."""
STALE = to_ns(0.5)
"""Age of the newest scan (simulated ns) from which on the robot acts without a new one, to stop."""
TF_LIMIT = 0.02
"""Host seconds to wait for the transforms of a scan's own tick: they come over the aggregator, one hop later. By the
host's clock, because simulated time stands still within a tick; a next scan ends the wait as well."""
_ANSWER_LIMIT = 0.5
"""Host seconds for the simulator to say which robots it has."""
_LOOKS = 3
"""Looks, a second apart, until something that does not come is missing."""
NO_POSES = f"no new poses on '{names.TF}' (zteam-tf)"
"""What the status says while scans come without them."""
_TELL_EVERY = 5
"""Seconds between two lines about the others that GO waits for."""


class DataWatch:
    """What a robot waits for before it drives: a place in the world, its first data, the rest of its team. And, in real
    time, why nothing comes any more: simulated time then stands still, and no step is taken.

    Asked once a second by the main loop.
    """

    def __init__(
        self, node: ProcessNode, inputs: RobotInputs, driver: Driver, part: Participant, status: StatusReport
    ) -> None:
        self._status = status
        self._deaf = 0
        """Looks in a row at which no other process answered."""
        self._is_out = False
        """Whether nothing comes any more, and was said to."""
        self._is_logged = False
        self._poses = 0
        """Stamp of the newest transforms at the last look."""
        self._node = node
        self._inputs = inputs
        self._driver = driver
        self._part = part
        self._looks = 0
        self._ready_for = 0
        """Seconds since the robot is ready, or since the last line."""
        self._told = ""
        self._scan: LaserScan | None = None
        """The newest at the last look."""

    def find_absence(self) -> None:
        """Ask the simulator whether it has this robot, if no scan comes; say so if none runs. Not under the lock."""
        self._looks += 1
        # At the start all is on its way.
        if self._looks < _LOOKS:
            return
        before, self._scan = self._scan, self._inputs.scan
        if self._scan is not before:
            self._driver.absence = ""
            self._tell_outage("")
            self._look_at_poses()
            return
        try:
            status = read_status(self._node.bus, _ANSWER_LIMIT)
        except BusError as error:
            log.debug("%s", error)
            self._tell_outage(self._find_outage())
            return
        if status is None:
            self._tell_outage(self._find_outage())
        robot_id = self._driver.robot_id
        lacks = status is not None and robot_id not in status.robots
        name = names.robot_name(robot_id)
        self._driver.absence = f"{name} is {absence_text(robot_id, status.robots)}" if status and lacks else ""
        if status is None and not self._driver.is_alone and self._driver.readiness.released and self._scan is None:
            # Without a gate nothing else says what the robot waits for. Later the monitor tells that data has stopped.
            log.info("waiting for a first scan: %s", ALONE)
        self._driver.is_alone = status is None

    def _find_outage(self) -> str:
        """Why no scan comes, in words, where the simulator does not answer; empty if that means nothing."""
        node = self._node
        if not node.clock.simulated or self._part.active or FREEZES.has_just_woken():
            return ""
        if not node.link_up:
            return "the router is lost"
        self._deaf = 0 if node.reaches_others() else self._deaf + 1
        if self._deaf:
            # A router that is gone is known soon.
            return "no other process answers" if self._deaf >= _LOOKS else ""
        return "the simulator does not answer" if node.has_simulator else "the simulator has ended"

    def _tell_outage(self, why: str) -> None:
        """Say once why nothing comes, and once that it comes again."""
        with self._node.changed:
            # What it is said to be at first stays: a frozen simulator loses its token a little later.
            if not self._driver.readiness.released or bool(why) == self._is_out:
                return
            self._is_out = bool(why)
            if why:
                # The log has the router's loss and return.
                self._is_logged = self._node.link_up
                self._driver.stand(f"no data: {why}", logged=self._is_logged)
            elif self._is_logged:
                log.info("data comes again")

    def _look_at_poses(self) -> None:
        """Say once that no poses come while scans do. A behaviour that drives by them says so itself."""
        before, self._poses = self._poses, self._inputs.transforms.stamp
        with self._node.changed:
            is_old = 0 < before == self._poses and not (self._part.active or FREEZES.has_just_woken())
            if is_old != bool(self._status.note):
                self._status.note = NO_POSES if is_old else ""
                if not self._driver.behavior.uses_tf:
                    log.info("%s", NO_POSES if is_old else "poses come again")
                self._status.say_again()

    def begin_look(self) -> StepInput | None:
        """The input to find out what is missing: while nothing comes there is no other (under `node.changed`)."""
        if self._looks < _LOOKS or self._part.active or self._driver.readiness.released or self._node.stopping:
            return None
        return self._driver.take_input(self._node.clock.now(), 0)

    def tell(self) -> None:
        """Log what GO waits for, if that takes long (under `node.changed`)."""
        team = self._inputs.team
        if self._driver.readiness.state != RobotState.READY or team is None or not team.waiting_for:
            self._ready_for = 0
            return
        self._ready_for += 1
        if self._ready_for > _TELL_EVERY and team.waiting_for != self._told:
            self._ready_for, self._told = 0, team.waiting_for
            log.info("ready; GO waits for %s", team.waiting_for)


class RobotNode:
    """One robot on the bus. Handlers of messages run under `node.changed`."""

    def __init__(
        self, node: ProcessNode, kind: type[Behavior], options: RobotOptions, transforms: TransformInputs | None = None
    ) -> None:
        """`kind` is the class of the behaviour, which is made anew after time has jumped back."""
        self._node = node
        self._id = options.robot_id
        self._inputs = RobotInputs(self._id, options.base, declared_inputs(kind.inputs, self._id), transforms)
        self._stop = StopSwitch(node.bus, self._id, self._on_stop)
        # As soon as the robot answers to its name; what this process asks comes after that.
        node.on_present(self._learn_stop)
        self._status = StatusReport(
            node,
            self._id,
            options.behavior,
            Readiness(gated=options.gate),
            lambda: self._part.active,
            self._stop,
            safety=options.safety,
        )
        parameters = BehaviorParameters(node, kind, options.behavior, options.params)
        self._driver = Driver(
            node, self._inputs, parameters, self._status, options, self._team, self._stop, lambda: self._part.active
        )
        self._heartbeat = Every(_HEARTBEAT)
        self._lateness = Lateness()
        """Of scans, and of velocities that others send."""
        self._rivals = RivalWatch(node.bus)
        """Of base_scan, velocities and declared inputs: what comes with its sender."""
        self._known_to: tuple[int, ...] = ()
        """Lock-step: the robots that have had its status; none before its own first tick."""
        self._alive: TokenSet | None = None
        """The processes of robots that are alive, from the first question on."""
        self._first_data = 0.0
        """Host time of the first scan; 0 before."""
        self._acted = 0
        """Stamp of the scan that was acted on last."""
        self._looked = 0
        """Real time: when it acted last (ns), also before GO, where no step is taken."""
        self._cmd_vel = node.bus.publisher(names.robot_key(self._id, names.CMD_VEL), Twist)
        # First: latched messages come while it subscribes, and look whether this is lock-step.
        self._part = Participant(node, self._has_inputs, gives_away=True)
        node.on_input = self._advance
        self._start = DataWatch(node, self._inputs, self._driver, self._part, self._status)
        node.on_time_reset(self._on_time_reset)
        safety = names.service_key(node.name, SAFETY)
        node.bus.serve(safety, NoRequest, lambda _: SafetyReply(self._driver.safety_stops))
        if self._driver.behavior.navigation is not None:
            # It waits for the end of a step: other queries are answered meanwhile.
            cancel = navigation_query(self._id, CANCEL)
            node.bus.serve(cancel, CancelRequest, lambda _: Deferred(self._cancel_goal))
        self._subscribe()

    def _subscribe(self) -> None:
        node, key, numbers = self._node, partial(names.robot_key, self._id), count()
        node.subscribe_from(key(names.BASE_SCAN), LaserScan, self._on_scan, self._lateness_of_scan)
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        node.subscribe(names.all_robots_key(names.BASE_INFO), BaseInfo, self._on_base_info, latched=True)
        node.subscribe(key(names.ODOM), Odometry, lambda _, odom: self._inputs.take_odom(odom))
        node.subscribe(names.TF, TFMessage, self._on_tf)
        take_static = self._inputs.transforms.take_static
        node.subscribe(names.TF_STATIC, TFMessage, lambda _, message: take_static(message), latched=True)
        # The newest one of each broadcaster counts.
        node.subscribe_latched_raw(key(names.TF_STATIC), self._on_fixed)
        for source in SOURCES:
            velocity = partial(self._on_sent, next(numbers), partial(self._inputs.mux.take, source))
            node.subscribe_from(key(source.topic), source.type, velocity, self._lateness_of)
        for declared in self._inputs.declared.declared:
            take = partial(self._on_sent, next(numbers), partial(self._inputs.declared.take, declared))
            if is_latched(declared.key):
                # Its bus lets one sender's message count alone: the one with the newest time.
                node.subscribe(declared.key, declared.type, take, latched=True)
            else:
                node.subscribe_from(declared.key, declared.type, take)

    def _lateness_of(self, sample: RawSample) -> str:
        """Why a velocity comes too late to be obeyed; empty if it does not. In lock-step the world waits."""
        return "" if self._part.active else self._lateness.problem(sample)

    def _lateness_of_scan(self, sample: RawSample) -> str:
        """As of velocities: simulated time, which comes over the same link, cannot tell. A base has the host's time."""
        return self._lateness_of(sample) if self._node.clock.simulated else ""

    def _on_stop(self) -> None:
        """A query has stopped or released the robot: in real time it does not wait for the next scan, nor for a
        behaviour that works long. In lock-step it counts from the next tick on, and a tick at work is not waited for.
        """
        if self._part.active:
            return
        with self._node.changed:
            if self._stop.is_stopped:
                self._cmd_vel.put(Twist())
            self._status.say_again()

    def _learn_stop(self) -> None:
        self._stop.learn()
        self._advance()

    def _cancel_goal(self) -> CancelReply:
        with self._node.between_steps():
            return CancelReply(self._driver.behavior.cancel_goal())

    # Inputs

    def _on_scan(self, key: str, scan: LaserScan, source: str) -> None:
        self._rivals.take(key, source)
        self._inputs.take_scan(scan)
        self._part.take_stamp(self._inputs.scan_stamp)
        self._first_data = self._first_data or monotonic()

    def _on_fixed(self, sample: RawSample) -> None:
        message = self._node.bus.decode(sample, TFMessage)
        if message is not None:
            self._inputs.take_fixed(message)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self._inputs.team = status

    def _on_tf(self, key: str, bundle: TFMessage) -> None:
        now = self._node.clock.now()
        if not self._node.ended_time.has(key, lambda: bases_stamp(bundle), now):
            self._inputs.transforms.take_bundle(bundle, now)

    def _on_base_info(self, key: str, message: BaseInfo) -> None:
        robot_id = names.robot_id_of(key.partition("/")[0])
        if robot_id is not None:
            self._inputs.take_base(robot_id, message)

    def _on_sent(self, number: int, take: Callable[..., None], key: str, message: Message, source: str = "") -> None:
        """A message of another process than the simulator: in lock-step it counts in the tick after its own."""
        part, clock, messages = self._part, self._node.clock, self._inputs.messages
        if has_one_writer(key):
            self._rivals.take(key, source)
        if isinstance(message, RobotStatus) and self._node.ended_time.has(key, lambda: stamp_of(message), clock.now()):
            return
        if not part.active:
            messages.handle_due(None)
            take(key, message, clock.now())
            return
        # The tick itself may be on its way; what it brings to this robot left before it.
        arrival = HeldMessage(number, key, message, source, False, None, take)
        ahead = self._inputs.scan_stamp
        if problem := messages.hold(arrival, ahead if part.stamp < ahead <= part.stamp + MAX_AHEAD else part.stamp):
            self._node.bus.counters.drop(key, problem)

    def _team(self) -> tuple[int, ...]:
        """The robots that are alive: in lock-step those that take part in the tick, so that all robots see the same."""
        if self._part.active:
            return self._part.team
        if self._alive is None:
            # Not before: in lock-step, each token would wake every robot for nothing.
            self._alive = TokenSet()
            # A lost link takes all tokens with it.
            self._node.watch_certain_tokens(names.tokens_key(names.ALL_ROBOTS), self._on_robot)
        ids = map(names.robot_id_of, self._alive)
        return tuple(sorted(robot_id for robot_id in ids if robot_id is not None))

    def _on_robot(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None and self._alive is not None:
            self._alive.take(*token, alive)

    def _on_time_reset(self) -> None:
        log.warning("time jumped back (the simulator started anew): old data is forgotten")
        self._inputs.forget()
        self._driver.begin_anew()
        self._acted = self._looked = 0

    # Steps: in lock-step once a tick, by the thread of the last input. In real time once for each scan, and again while
    # no scan comes, by the main loop.

    def _advance(self) -> None:
        """Lock-step: take the step of the open tick, if its inputs are there."""
        part, released = self._part, self._driver.readiness.released
        if part.active and not (part.is_open and self._step()) and not (released or self._inputs.scan is None):
            # The first tick is held until all are ready, and what that takes may come after this robot's answer.
            self._node.take_step(lambda: self._driver.take_input(self._acted, 0), self._driver.pass_gate)

    def _step(self) -> bool:
        """Take the step that is due, if one is."""
        return self._node.take_step(self._begin_step, self._driver.step, self._end_step)

    def run(self) -> None:
        """Drive until the process is asked to stop."""
        while not self._node.stopping:
            self._wait_for_work()
            if self._node.stopping:
                return
            self._node.decide_clock(self._first_data)
            self._step()
            if not self._heartbeat.due():
                continue
            self._start.find_absence()
            self._node.take_step(self._start.begin_look, self._driver.pass_gate)
            with self._node.changed:
                self._start.tell()
                self._rivals.look()
                self._status.beat()

    def _wait_for_work(self) -> None:
        """Real time: wait until a step is due, and then for the transforms of its scan.

        In lock-step, which goes on in handlers, only heartbeats are due.
        """
        node, part, active, due = self._node, self._part, self._part.active, self._heartbeat.left()
        if node.wait(lambda: part.active != active or self._is_due(), due if active else min(due, _LOOK)):
            inputs, scan, now = self._inputs, self._inputs.scan, self._now()
            if self._driver.behavior.uses_tf:
                node.wait(lambda: part.active or inputs.transforms.stamp >= now or inputs.scan is not scan, TF_LIMIT)

    def _is_due(self) -> bool:
        """Whether there is a reason to act in real time: a new scan, or none while time goes on.

        Time goes on for STALE without a scan, and for a fifth of that since the last step.
        """
        if self._part.active or not self._stop.is_known:
            return False
        now = self._node.clock.now()
        return self._has_new_scan() or (now - self._acted > STALE and now - self._looked >= STALE // 5)

    def _has_new_scan(self) -> bool:
        return self._inputs.scan is not None and self._inputs.scan_stamp != self._acted

    def _begin_step(self) -> StepInput | None:
        """What the step that is due goes by; None if none is."""
        if self._part.active:
            return self._begin_tick()
        if not self._is_due():
            return None
        inputs, now = self._inputs, self._now()
        if self._has_new_scan():
            self._acted = inputs.scan_stamp
            inputs.wait_no_longer()
        self._looked = now
        return self._driver.take_input(now, go_epoch(inputs.team, now))

    def _now(self) -> int:
        """Time of a step in real time. A scan that was held up on its way is as old as the clock says."""
        return max(self._inputs.scan_stamp, self._node.clock.now())

    def _begin_tick(self) -> StepInput | None:
        """The input of the open tick; None if one is missing."""
        tick = self._part.begin()
        if tick is None:
            return None
        self._acted = self._part.stamp
        is_first = tick.tick == 1 or not self._known_to
        return self._driver.take_input(self._acted, tick.epoch, tick, is_first=is_first)

    def _has_inputs(self, tick: Tick) -> bool:
        """Lock-step: whether all that the tick brings to this robot has come."""
        if not self._stop.is_known:
            return False
        if self._id not in self._part.robots:
            return True
        # Without an aggregator among the participants no transforms of this tick are promised. A bundle of lock-step is
        # whole; only at first the fixed transforms may still be on their way.
        tf = names.AGGREGATOR in tick.participants
        return self._inputs.has_bases(self._part.robots) and self._inputs.complete_for(
            self._part.stamp, tf=tf, connected=not self._driver.readiness.released
        )

    def _end_step(self, given: StepInput, command: Twist | None) -> None:
        if given.tick is None:
            if command is not None:
                # It may have been stopped during the step.
                self._cmd_vel.put(Twist() if self._stop.is_stopped else command)
            return
        if given.is_first or self._part.team is not self._known_to:
            # A robot that has just come must know this one from the next tick on, and not from a heartbeat by chance.
            self._known_to = self._part.team
            self._status.publish()
        self._status.keep_up(self._acted)
        self._part.answer(given.tick, command)

    def log_start(self, *, gated: bool) -> None:
        """Log what this process is and what it waits for; `gated`: for GO too."""
        leader = self._driver.behavior.leader
        behind = "" if leader is None else f" behind {names.robot_name(leader)}"
        go = "then for the monitor's GO" if gated else "not for GO (--no-gate)"
        log.info("robot %d, behaviour %s%s: waiting for its data, %s", self._id, self._status.behavior, behind, go)

    def halt(self) -> None:
        """Publish zero velocity, then the status; both leave before the session closes."""
        with self._node.changed:
            self._cmd_vel.put(Twist())
            self._status.stop()
        log.info("%s stopped", names.robot_name(self._id))


def run_robot(
    node: ProcessNode, kind: type[Behavior], options: RobotOptions, transforms: TransformInputs | None = None
) -> None:
    """Be robot `options.robot_id` until asked to stop. `transforms` are those of all robots of this process."""
    robot = RobotNode(node, kind, options, transforms)
    node.become_present()
    robot.log_start(gated=options.gate)
    # Only the process that holds the name may publish commands, so not before this.
    node.on_stop(robot.halt)
    if not options.safety:
        log.warning("NO SAFETY LAYER (--no-safety): nothing stops this robot before obstacles or on old data")
    robot.run()
