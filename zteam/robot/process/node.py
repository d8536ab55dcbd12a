"""The robot process: one robot's brain. It cannot tell the simulator from a real base.

It acts when a scan arrives, not on a timer of its own, so that a command follows its scan at once; between scans it
only watches for data that has grown old. In lock-step it acts once a tick, when all its inputs of that tick have come.
"""

from functools import partial

from zteam import names
from zteam.bus import NoRequest
from zteam.bus.lateness import Lateness
from zteam.bus.transport import RawSample
from zteam.clock import FREEZES, monotonic, to_ns
from zteam.errors import BusError, log
from zteam.messages import BaseInfo, LaserScan, Message, NavigationState, Odometry, RobotState, TFMessage, Tick, Twist
from zteam.messages.geometry_msgs import bases_stamp
from zteam.messages.topics import is_latched
from zteam.node.node import Node
from zteam.node.process_options import RobotOptions
from zteam.node.robot_status import Readiness, StatusReport
from zteam.node.steps import Due
from zteam.node.tokens import CertainTokens, TokenSet
from zteam.robot.behaviors.behavior import Behavior, DeclaredInput, declared_inputs
from zteam.robot.client import CANCEL, SAFETY, CancelReply, CancelRequest, SafetyReply, navigation_query
from zteam.robot.process.driver import ALONE, Driver
from zteam.robot.process.inputs import SOURCES, RobotInputs, TransformInputs
from zteam.simulator.client import absence_of, absence_text, read_status

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
_TELL_EVERY = 5
"""Seconds between two lines about the others that GO waits for."""


class RobotNode:
    """One robot on the bus: what comes for it, and the timer of its steps in real time.

    A step is due with each scan, and again and again while none comes: then the robot has to stop. Handlers of messages
    run under `node.changed`.
    """

    def __init__(
        self, node: Node, kind: type[Behavior], options: RobotOptions, transforms: TransformInputs | None = None
    ) -> None:
        """`kind` is the class of the behaviour, which is made anew after time has jumped back."""
        assert node.switch is not None
        self._node = node
        self._id = options.robot_id
        self._inputs = RobotInputs(self._id, options.base, declared_inputs(kind.inputs, self._id), transforms)
        way_out = "" if node.in_team else "zteam-monitor; --no-gate drives at once"
        readiness = Readiness(gated=options.gate, way_out=way_out)
        self.status = StatusReport(node, self._id, options.behavior, readiness, node.switch, safety=options.safety)
        self.driver = Driver(node, self._inputs, kind, self.status, options, self._team)
        self._lateness = Lateness()
        """Of scans, and of velocities that others send."""
        self._alive: TokenSet | None = None
        """The processes of robots that are alive, from the first question on."""
        self._beats = self._ready_for = self._deaf = 0
        """Seconds since the start, since the robot is ready or the last line about GO; looks without an answer."""
        self._told = ""
        """What GO waits for, in that line."""
        self._is_out = self._is_logged = False
        """Whether nothing comes any more, and whether the log says so."""
        self._scan: LaserScan | None = None
        """The newest at the last look."""
        self._acted = 0
        """Real time: stamp of the scan that was acted on last."""
        self._looked = 0
        """Real time: when it acted last (ns), also before GO, where no step is taken."""
        self._is_overdue = self._lacked_tf = False
        """Real time: whether another scan came before the newest and was not acted on, and whether it acted last
        without the transforms of its scan."""
        node.part.gives_away = True
        node.adopt(self.driver.step, self, readiness, self.status)
        node.on_time_reset(self._on_time_reset)
        node.need(self._lacks)
        count = names.service_key(node.name, SAFETY)
        node.bus.serve(count, NoRequest, lambda _: SafetyReply(self.driver.safety.stops))
        if self.driver.behavior.navigation is not None:
            cancel = navigation_query(self._id, CANCEL)
            node.serve_change(cancel, CancelRequest, self._can_cancel, self._cancel_goal, after_step=True)
        self._subscribe()

    def _subscribe(self) -> None:
        node, key, inputs = self._node, partial(names.robot_key, self._id), self._inputs
        on_scan = node.handler(self._on_scan)
        node.bus.subscribe(key(names.BASE_SCAN), LaserScan, on_scan, problem=self._lateness_of_scan)
        node.follow_go()
        node.hear(names.all_robots_key(names.BASE_INFO), BaseInfo, self._on_base_info, latched=True)
        node.hear(key(names.ODOM), Odometry, lambda _, odom: inputs.on_odom(odom))
        node.hear(names.TF, TFMessage, self._on_tf)
        node.hear(names.TF_STATIC, TFMessage, lambda _, message: inputs.transforms.on_static(message), latched=True)
        # The newest one of each broadcaster counts.
        node.bus.subscribe_raw(key(names.TF_STATIC), node.handler(self._on_fixed), latched=True)
        for driver, (topic, kind) in SOURCES.items():
            node.receive(key(topic), kind, partial(inputs.on_velocity, driver), self._lateness_of)
        for declared in inputs.declared:
            receive = partial(self._on_declared, declared)
            node.receive(declared.key, declared.type, receive, latched=is_latched(declared.key))

    def _lateness_of(self, sample: RawSample) -> str:
        """Why a velocity comes too late to be obeyed; empty if it does not. In lock-step the world waits."""
        return "" if self._node.ticks_tell_time else self._lateness.problem(sample)

    def _lateness_of_scan(self, sample: RawSample) -> str:
        """As of velocities: simulated time, which comes over the same link, cannot tell. A base has the host's time."""
        node = self._node
        return "" if node.ticks_tell_time or not node.clock.simulated else self._lateness.problem(sample)

    def _can_cancel(self, _request: CancelRequest) -> tuple[CancelReply, bool]:
        navigation = self.driver.behavior.navigation
        has_goal = navigation is not None and navigation.state == NavigationState.DRIVING
        # One that is about to come is canceled as well.
        return CancelReply(has_goal), True

    def _cancel_goal(self, _request: CancelRequest) -> None:
        self.driver.behavior.cancel_goal()

    def _on_scan(self, _key: str, scan: LaserScan) -> None:
        self._is_overdue = self._has_new_scan()
        self._inputs.on_scan(scan)
        self._node.hear_stamp(self._inputs.scan_stamp)
        self._node.first_data = self._node.first_data or monotonic()

    def _on_fixed(self, sample: RawSample) -> None:
        message = self._node.bus.counters.decode(sample, TFMessage)
        if message is not None:
            self._inputs.on_fixed(message)

    def _on_tf(self, _key: str, bundle: TFMessage) -> None:
        if not self._node.is_of_ended_time(lambda: bases_stamp(bundle)):
            self._inputs.transforms.on_bundle(bundle, self._node.clock.now())

    def _on_base_info(self, key: str, message: BaseInfo) -> None:
        robot_id = names.robot_id_of(key.partition("/")[0])
        if robot_id is not None:
            self._inputs.on_base_info(robot_id, message)

    def _on_declared(self, declared: DeclaredInput, key: str, message: Message, stamp: int) -> None:
        part, target = self._node.part, names.split_robot_key(key)
        is_of_team = target is None or target[0] in part.robots or target[0] in part.team
        # Any program can invent robots, and each would be remembered.
        if is_of_team or part.tick is None or not declared.of_all_robots:
            self._inputs.on_declared(declared, key, message, stamp)

    def _team(self) -> tuple[int, ...]:
        """The robots that are alive: in lock-step those that take part in the tick, so that all robots see the same."""
        if self._node.part.tick is not None:
            return self._node.part.team
        if self._alive is None:
            # Not before: in lock-step, each token would wake every robot for nothing.
            self._alive = TokenSet()
            # A lost link takes all tokens with it.
            CertainTokens(self._node.bus, names.tokens_key(names.ALL_ROBOTS), self._node.handler(self._on_robot))
        ids = map(names.robot_id_of, self._alive)
        return tuple(sorted(robot_id for robot_id in ids if robot_id is not None))

    def _on_robot(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None and self._alive is not None:
            self._alive.take(*token, alive)

    def _on_time_reset(self) -> None:
        log.warning("time jumped back (the simulator started anew): old data is forgotten")
        self._inputs.forget()
        self.driver.begin_anew()
        self._acted = self._looked = 0

    def _lacks(self, tick: Tick) -> list[str]:
        """What the tick brings to this robot and has not come."""
        robots = self._node.part.robots
        if self._id not in robots:
            return []
        if not self._inputs.has_bases(robots):
            return [names.all_robots_key(names.BASE_INFO)]
        # Without an aggregator among the participants no transforms of this tick are promised. A bundle of lock-step is
        # whole; only at first the fixed transforms may still be on their way.
        tf, connected = names.AGGREGATOR in tick.participants, not self._node.readiness.released
        return self._inputs.lacking(self._node.part.stamp, tf=tf, connected=connected)

    def wait(self, limit: float) -> None:
        """Wait for a scan with the transforms of its tick, so that this thread wakes once for both.

        Where the robot acted last without them, it wakes for the scan, and they have TF_LIMIT from then on.
        """
        node = self._node
        node.wait(self._is_due if self._lacked_tf else self._is_complete, min(limit, _LOOK))
        if self._is_due():
            node.wait(self._is_complete, TF_LIMIT)

    def take(self) -> int | None:
        """The scan's time, or by the clock if that is later: a scan may have been held up on its way."""
        if not self._is_due():
            return None
        self._lacked_tf = not self._has_tf()
        if self._has_new_scan():
            self._acted = self._inputs.scan_stamp
            self._inputs.wait_no_longer()
        self._looked = self._now()
        return self._looked

    def _is_due(self) -> bool:
        """Whether there is a new scan, or none while time goes on: for STALE, and for a fifth of that since the last
        step."""
        now = self._node.clock.now()
        return self._has_new_scan() or (now - self._acted > STALE and now - self._looked >= STALE // 5)

    def _is_complete(self) -> bool:
        """Whether what is due lacks no transforms, or waits for them no longer because another scan has come."""
        return self._is_due() and (self._has_tf() or self._is_overdue or not self._has_new_scan())

    def _has_tf(self) -> bool:
        return not self.driver.behavior.uses_tf or self._inputs.transforms.stamp >= self._now()

    def _has_new_scan(self) -> bool:
        return self._inputs.scan is not None and self._inputs.scan_stamp != self._acted

    def _now(self) -> int:
        return max(self._inputs.scan_stamp, self._node.clock.now())

    def beat(self) -> None:
        """Look once a second, and not at the start, where all is on its way, what the robot waits for."""
        self._beats += 1
        if self._beats >= _LOOKS:
            self._find_absence()
            self._node.look()
        with self._node.changed:
            waiting_for = self._node.team.waiting_for
            waits = self._node.readiness.state == RobotState.READY and waiting_for
            self._ready_for = self._ready_for + 1 if waits else 0
            if self._ready_for > _TELL_EVERY and waiting_for != self._told:
                self._ready_for, self._told = 0, waiting_for
                log.info("ready; GO waits for %s", waiting_for)

    def _find_absence(self) -> None:
        """Ask the simulator whether it has this robot, if no scan comes; say so if none runs. Not under the lock."""
        before, self._scan = self._scan, self._inputs.scan
        node, driver = self._node, self.driver
        if self._scan is not before:
            # Before GO: why the pose of a leader cannot come.
            leader = None if node.readiness.released else driver.behavior.leader
            driver.absence, driver.is_alone = "" if leader is None else absence_of(node.bus, leader), False
            self._tell_outage("")
            return
        try:
            status = read_status(node.bus, _ANSWER_LIMIT)
        except BusError as error:
            log.debug("%s", error)
            self._tell_outage(self._find_outage())
            return
        driver.absence = ""
        if status is None:
            self._tell_outage(self._find_outage())
            if not driver.is_alone and node.readiness.released and self._scan is None:
                # Without a gate nothing else says so. Later the monitor tells that data has stopped.
                log.info("waiting for a first scan: %s", ALONE)
        elif self._id not in status.robots:
            driver.absence = f"{node.name} is {absence_text(self._id, status.robots)}"
        driver.is_alone = status is None

    def _find_outage(self) -> str:
        """Why no scan comes, in words, where the simulator does not answer; empty if that means nothing."""
        node = self._node
        if not node.clock.simulated or node.ticks_tell_time or FREEZES.has_just_woken():
            return ""
        if not node.link_up:
            return "the router is lost"
        self._deaf = 0 if node.reaches_others() else self._deaf + 1
        if self._deaf:
            # A router that is gone is known soon.
            return "no other process answers" if self._deaf >= _LOOKS else ""
        return "the simulator does not answer" if node.simulators else "the simulator has ended"

    def _tell_outage(self, why: str) -> None:
        """Say once why nothing comes, and once that it comes again."""
        with self._node.changed:
            # What it is said to be at first stays: a frozen simulator loses its token a little later.
            if not self._node.readiness.released or bool(why) == self._is_out:
                return
            self._is_out = bool(why)
            if why:
                # The log has the router's loss and return.
                self._is_logged, driver = self._node.link_up, self.status.driver
                self._node.report(Due(0), driver, Twist(), f"no data: {why}", logged=self._is_logged)
            elif self._is_logged:
                log.info("data comes again")


def run_robot(
    node: Node, kind: type[Behavior], options: RobotOptions, transforms: TransformInputs | None = None
) -> None:
    """Be robot `options.robot_id` until asked to stop. `transforms` are those of all robots of this process."""
    robot = RobotNode(node, kind, options, transforms)
    node.become_present()
    leader = robot.driver.behavior.leader
    behind = "" if leader is None else f" behind {names.robot_name(leader)}"
    go = "then for the monitor's GO" if options.gate else "not for GO (--no-gate)"
    does = f"behaviour {options.behavior}{behind}"
    log.info("%s", does if node.in_team else f"robot {options.robot_id}, {does}: waiting for its data, {go}")
    if not options.safety:
        log.warning("NO SAFETY LAYER (--no-safety): nothing stops this robot before obstacles or on old data")
    node.drive(robot.beat)
