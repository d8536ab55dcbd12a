"""The robot process: one robot's brain. It cannot tell the simulator from a real base.

It acts when a scan arrives, not on a timer of its own, so that a command follows its scan at once; between scans it
only watches for data that has grown old. In lock-step it acts once a tick, when all its inputs of that tick are there.
"""

import logging
from collections.abc import Callable

import msgspec

from zteam import names
from zteam.behaviors import Behavior, View, decide, missing
from zteam.clock import Every, monotonic, to_ns
from zteam.geometry import Pose2
from zteam.messages import (
    Header,
    LaserScan,
    Odometry,
    RobotState,
    RobotStatus,
    TeamState,
    TeamStatus,
    TFMessage,
    Tick,
    Twist,
    ns_from_time,
    time_from_ns,
)
from zteam.runtime.node import Node
from zteam.runtime.participant import Participant
from zteam.tf import Buffer, TransformException
from zteam.tf.lazy_bundles import Bundles

log = logging.getLogger("zteam")

STALE = to_ns(0.5)
"""A scan older than this (simulated ns) moves nobody."""
TF_PATIENCE = 0.02
"""Host seconds to wait for the transforms of a scan's own tick: they come over the aggregator, one hop later. By the
host's clock, because simulated time stands still within a tick; a next scan ends the wait as well."""


class RobotOptions(msgspec.Struct, frozen=True):
    """What the command line says about the robot."""

    robot_id: int
    gate: bool = True
    """Wait for the monitor's GO."""
    seed: int = 1


class RobotNode:
    """One robot on the bus. Callbacks run under `node.changed`."""

    def __init__(self, node: Node, make_behavior: Callable[[], Behavior], options: RobotOptions) -> None:
        """`make_behavior()` makes the behaviour, and makes it anew when time starts anew."""
        self._node = node
        self._make_behavior = make_behavior
        self._behavior = make_behavior()
        self._options = options
        self._id = options.robot_id
        self._scan: LaserScan | None = None
        self._odom: Odometry | None = None
        self._team: TeamStatus | None = None
        self._buffer = Buffer()
        self._bundles = Bundles(self._buffer, names.TF)
        self._acted = 0
        """Stamp of the scan that was acted on last."""
        self._stepped = 0
        self._jumps = 0
        """How often time has jumped back."""
        self._hears_odom = self._hears_tf = True
        self._heard_tf = 0
        """Stamp of the newest bundle."""
        self._waiting = False
        """Whether the main loop waits for the transforms of a scan that it has seen."""
        self._awaits_tf = False
        """Whether the transforms of the last scan's tick came in time."""
        self._released = not options.gate
        self._epoch = 0
        """The GO that it obeys."""
        self._state = RobotState.BOOT
        self._text = ""
        self._first_data = 0.0
        self._heartbeat = Every(1.0)
        self._cmd_vel = node.bus.publisher(self._key(names.CMD_VEL), Twist)
        self._status = node.bus.publisher(self._key(names.STATUS), RobotStatus)
        self._base = names.robot_frame(self._id, names.BASE_FOOTPRINT)
        # First: latched messages come while it subscribes, and look whether this is lock-step.
        self._part = Participant(node, self._has_inputs, self._act)
        self._subscribe()

    def _key(self, topic: str) -> str:
        return names.robot_key(self._id, topic)

    def _subscribe(self) -> None:
        node = self._node
        node.clock.sim.on_jump_back(self._on_jump_back)
        node.subscribe(self._key(names.BASE_SCAN), LaserScan, self._on_scan, wake=False)
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        self._odom_input = node.subscribe(self._key(names.ODOM), Odometry, self._on_odom, wake=False)
        self._tf_input = node.subscribe_payloads(names.TF, TFMessage, self._on_tf)
        node.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)
        node.watch_tokens(names.tokens_key(names.MONITOR), self._on_monitor)

    def _on_scan(self, _key: str, scan: LaserScan) -> None:
        self._scan = scan
        self._part.take_stamp(ns_from_time(scan.header.stamp))
        self._first_data = self._first_data or monotonic()
        self._arrived()

    def _on_odom(self, _key: str, odom: Odometry) -> None:
        self._odom = odom
        if self._part.active:
            self._arrived()

    def _arrived(self) -> None:
        """An input has come: lock-step goes on in this very thread, else the main loop does."""
        if not self._part.active:
            # The main loop is woken once a scan and not for each of its parts.
            if self._is_complete() or self._waiting:
                self._node.changed.notify_all()
        elif not self._part.advance() and not self._released and self._node.speaks:
            # The first tick is held until all are ready, and what that takes may come after this robot's answer.
            with self._node.failing():
                self._may_drive(0, self._view(self._acted))

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self._team = status

    def _on_tf(self, _key: str, payload: bytes) -> None:
        self._heard_tf = self._bundles.take(payload) or self._heard_tf
        self._arrived()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        # The full set: a start pose that a localiser took over is no longer in it.
        self._buffer.set_all_static(message.transforms, names.TF)
        self._bundles.forget_paths()
        self._arrived()

    def _on_monitor(self, _key: str, alive: bool) -> None:
        if alive:
            # A monitor that just came must not wait for the next heartbeat to know this robot.
            self._publish_status()

    def _on_jump_back(self, _old: int, _new: int) -> None:
        log.warning("time jumped back (the simulator started anew): old data is forgotten")
        self._buffer.clear()
        self._bundles.clear()
        self._scan = self._odom = None
        self._acted = self._stepped = self._heard_tf = 0
        self._jumps += 1
        self._behavior = self._make_behavior()

    def run(self) -> None:
        """Drive until the process is asked to stop."""
        while not self._node.stopping:
            self._node.wait(self._due, 0.1)
            if self._node.stopping:
                return
            self._node.decide_clock(self._first_data)
            # One lock for all that makes the behaviour or asks it: handlers make it anew when time jumps back.
            with self._node.changed:
                self._take_turn()
                if self._heartbeat.due():
                    self._publish_status()

    def _take_turn(self) -> None:
        """Real time: act if there is a reason to."""
        scan = self._scan
        if self._part.active:
            return  # the bus's threads drive
        if scan is not None and ns_from_time(scan.header.stamp) != self._acted:
            self._acted = ns_from_time(scan.header.stamp)
            # A scan that was held up on its way is as old as the clock says.
            self._drive(max(self._acted, self._node.clock.now()))
        elif self._data_stopped():
            self._drive(self._node.clock.now())

    def _due(self) -> bool:
        return not self._part.active and (self._is_complete() or self._data_stopped())

    def _is_complete(self) -> bool:
        """Whether there is a new scan, and the transforms of its tick if they are to be counted on."""
        scan = self._scan
        if scan is None:
            return False
        stamp = ns_from_time(scan.header.stamp)
        return stamp != self._acted and (not self._awaits_tf or self._heard_tf >= stamp)

    def _data_stopped(self) -> bool:
        """Whether time went on for long without a scan (and a further step's worth since the last look)."""
        now = self._node.clock.now()
        return now - self._acted > STALE and now - self._stepped >= STALE // 5

    def _drive(self, now: int) -> None:
        """Act at time `now` on the newest data, and say the command."""
        if self._behavior.uses_tf and not self._wait_for_transforms(now):
            return
        command = self._step(self._view(now), self._team_epoch(now))
        if command is not None:
            self._cmd_vel.put(command)

    def _wait_for_transforms(self, now: int) -> bool:
        """Let go of the lock until the transforms of `now` come; False if that time is over when it is taken again."""
        scan, jumps = self._scan, self._jumps
        self._waiting = True
        # Once they stay away, the next scan wakes the main loop without them.
        self._awaits_tf = self._node.wait(lambda: self._heard_tf >= now or self._scan is not scan, TF_PATIENCE)
        self._waiting = False
        return self._jumps == jumps and not self._part.active and not self._node.stopping

    def _has_inputs(self, tick: Tick) -> bool:
        """Lock-step: whether everything has come that the tick brings to this robot."""
        if self._id not in self._part.robots:
            return True
        stamp = ns_from_time(tick.stamp)
        scan, odom = self._scan, self._odom
        if scan is None or ns_from_time(scan.header.stamp) < stamp:
            return False
        if self._hears_odom and (odom is None or ns_from_time(odom.header.stamp) < stamp):
            return False
        if not self._hears_tf or names.AGGREGATOR not in tick.participants:
            # Without an aggregator in the round nobody has promised transforms.
            return True
        # A bundle of lock-step is whole; only at first the fixed transforms may still be on their way.
        return self._heard_tf >= stamp and (self._released or self._tree_reaches(stamp))

    def _act(self, tick: Tick) -> Twist | None:
        """Lock-step: this tick's command."""
        self._acted = ns_from_time(tick.stamp)
        return self._step(self._view(self._acted), tick.epoch)

    def _step(self, view: View, epoch: int) -> Twist | None:
        """The command at `view.now`, or None while the gate is shut; `epoch` is the GO that holds, 0 = none."""
        self._stepped = view.now
        if not self._may_drive(epoch, view):
            return None
        command, reason = decide(self._behavior, view)
        self._change(RobotState.RUNNING, reason)
        return command

    def _tree_reaches(self, stamp: int) -> bool:
        self._bundles.settle(names.MAP_FRAME, self._base)
        transform = self._buffer.latest_common_time(names.MAP_FRAME, self._base)
        return transform is not None and transform >= stamp

    def _view(self, now: int) -> View:
        dt = (now - self._stepped) / 1e9 if 0 < self._stepped < now else 0.0
        return View(
            now=now,
            dt=dt,
            robot_id=self._id,
            scan=self._scan,
            odom=self._odom,
            lookup=self._lookup,
            seed=self._options.seed,
        )

    def _lookup(self, target: str, source: str) -> tuple[Pose2, int] | None:
        self._bundles.settle(target, source)
        try:
            return self._buffer.lookup_pose2(target, source, 0)
        except TransformException:
            return None

    def _team_epoch(self, now: int) -> int:
        """The monitor's GO that holds at `now`; 0 = none yet."""
        team = self._team
        if team is None or team.state != TeamState.GO or now < ns_from_time(team.go_stamp):
            return 0
        return team.epoch

    def _may_drive(self, epoch: int, view: View) -> bool:
        """The start gate: READY when nothing is lacking, released by GO, and then for good."""
        if self._released:
            self._epoch = max(epoch, self._epoch)
            return True
        lacking = missing(view, self._behavior)
        if lacking:
            self._change(RobotState.BOOT, "waiting for " + ", ".join(lacking))
            return False
        if not epoch:
            self._change(RobotState.READY, "waiting for the monitor's GO (zteam-monitor; --no-gate drives at once)")
            return False
        self._released, self._epoch = True, epoch
        self._drop_idle_inputs()
        log.info("GO: driving")
        return True

    def _drop_idle_inputs(self) -> None:
        """Stop listening to what only the gate needed: every message wakes the process."""
        if not self._behavior.uses_odom:
            self._hears_odom = False
            self._odom_input.close()
        if not self._behavior.uses_tf:
            self._hears_tf = False
            self._tf_input.close()

    def _change(self, state: int, text: str) -> None:
        if (state, text) == (self._state, self._text):
            return
        if text and text != self._text:
            log.info("%s: %s", RobotState.TEXT[state], text)
        self._state, self._text = state, text
        self._publish_status()

    def _publish_status(self) -> None:
        self._status.put(
            RobotStatus(
                header=Header(time_from_ns(self._node.clock.now()), names.robot_name(self._id)),
                robot_id=self._id,
                is_ready=self._state in (RobotState.READY, RobotState.RUNNING),
                state=self._state,
                epoch=self._epoch,
                text=self._text,
            )
        )

    def halt(self) -> None:
        """The last words: wheels to zero, then the status; both leave before the session closes."""
        with self._node.changed:
            self._cmd_vel.put(Twist())
            self._state, self._text = RobotState.STOPPED, "stopped"
            self._publish_status()
        log.info("%s stopped", names.robot_name(self._id))


def run_robot(node: Node, make_behavior: Callable[[], Behavior], options: RobotOptions) -> None:
    """Be robot `options.robot_id` until asked to stop."""
    robot = RobotNode(node, make_behavior, options)
    node.become_present()
    # Only the process that holds the name may touch the wheels, so not before this.
    node.on_stop(robot.halt)
    if not options.gate:
        log.info("not waiting for GO (--no-gate)")
    robot.run()
