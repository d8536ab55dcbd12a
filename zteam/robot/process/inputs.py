"""What has come for one robot, and what of it counts. It knows no bus."""

import math
from collections.abc import Mapping, Set
from types import MappingProxyType
from typing import Any

from zteam import names
from zteam.clock import FREEZES, monotonic, to_ns
from zteam.errors import log
from zteam.geometry import Pose2
from zteam.messages import BaseInfo, Header, LaserScan, Message, Odometry, RobotDriver, RobotStatus, TFMessage, Twist
from zteam.messages.base import DEFAULT_BASE, Base, BaseOverride, base_of, override_base
from zteam.messages.geometry_msgs import TransformStamped, TwistStamped, bases_stamp
from zteam.messages.std_msgs import ns_from_time
from zteam.robot.behaviors.behavior import DeclaredInput
from zteam.robot.view import SILENT_AFTER, TeamPoses, View
from zteam.transforms import Buffer, TransformException
from zteam.transforms.lasers import LaserMounts

BASE_INFO_LIMIT = 2.0
"""Host seconds from its first scan on for which a robot in real time waits for `base_info`. The simulator publishes it
before the first scan; a base that does not publish it never will."""


SOURCES: dict[str, tuple[str, type[Message]]] = {
    RobotDriver.TELEOP: (names.CMD_VEL_TELEOP, Twist),
    RobotDriver.NAVIGATION: (names.CMD_VEL_NAV, TwistStamped),
}
"""The topic below `robot_N/` and its type of what may drive instead of the behaviour; the highest priority first."""
TIMEOUT = to_ns(0.5)
"""Nanoseconds of the process's clock without a velocity after which a source no longer drives."""


class TransformInputs:
    """What `tf` and `tf_static` have brought. The robots of one process share one, as all get the same messages."""

    def __init__(self) -> None:
        self.stamp = 0
        """Of the newest bundle of transforms, in ns; 0 = none."""
        self.buffer = Buffer()
        self._bundle: TFMessage | None = None
        """The one that was taken last."""
        self._found: dict[tuple[str, str, int], tuple[Pose2, int] | None] = {}
        """The answers of `find_pose`, of the newest messages: these put another dictionary in its place."""
        self._teams: dict[tuple[str, ...], TeamPoses] = {}
        """Those of `find_poses`, by the bases of the robots, in the same way."""
        self._asked: tuple[Mapping[int, int], tuple[str, ...]] = {}, ()
        """The rows of the robots that were asked for last, and their bases."""

    def on_bundle(self, bundle: TFMessage, now: int = 0) -> None:
        """A message of `tf` has come at time `now` (ns), 0 = not known."""
        if bundle is self._bundle:
            # It came for another robot of this process.
            return
        self.buffer.set_transforms(bundle.transforms, names.TF, now)
        self._bundle, self._found, self._teams = bundle, {}, {}
        self.stamp = bases_stamp(bundle) or self.stamp

    def on_static(self, message: TFMessage) -> None:
        """The whole set of fixed transforms has come: a start pose that a localiser took over is not in it any more."""
        self.buffer.set_all_static(message.transforms, names.TF)
        self._found, self._teams = {}, {}

    def find_poses(self, rows: Mapping[int, int]) -> TeamPoses:
        """The newest poses of these robots in `map`: the same object until something comes."""
        teams, (asked, frames) = self._teams, self._asked
        if asked != rows:
            frames = tuple(names.robot_frame(robot, names.BASE_FOOTPRINT) for robot in rows)
            self._asked = rows, frames
        if frames not in teams:
            teams[frames] = TeamPoses(rows, *self.buffer.find_poses2(names.MAP_FRAME, frames))
        return teams[frames]

    def find_pose(self, target_frame: str, source_frame: str, time: int = 0) -> tuple[Pose2, int] | None:
        """`target_from_source` at `time`, or the newest, in the plane and its stamp; None if it is unknown. Any thread
        may call it."""
        found, frames = self._found, (target_frame, source_frame, time)
        if frames not in found:
            try:
                found[frames] = self.buffer.lookup_pose2(target_frame, source_frame, time)
            except TransformException:
                found[frames] = None
        return found[frames]

    def forget(self) -> None:
        """Time jumped back: forget what moves."""
        self.buffer.clear()
        self._bundle, self._found, self._teams, self.stamp = None, {}, {}, 0


class RobotInputs:
    """The newest of what comes for robot `robot_id`: data, velocities, what its behaviour declares. Stamps are in ns.

    The caller holds a lock for everything but `transforms.find_pose`, which any thread may call.
    """

    def __init__(
        self,
        robot_id: int,
        override: BaseOverride | None = None,
        declared: list[DeclaredInput] | None = None,
        transforms: TransformInputs | None = None,
    ) -> None:
        """`override` holds instead of what `base_info` tells; `declared` is what the behaviour declares.

        `transforms` are those of this process, its own ones otherwise.
        """
        self._id, self._base = robot_id, names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self._override = override or BaseOverride()
        self.base = override_base(DEFAULT_BASE, self._override)
        """DEFAULT_BASE and the override until the own `base_info` has come."""
        self._given_up, self._waits_since = False, 0.0
        """Whether the robot does without `base_info`; host time of its first scan in real time, 0 before."""
        self.declared = declared or []
        self._of_behavior = self._none_declared()
        """By the name of a declared input: the newest message or None, or the newest messages by robot."""
        self._shown: dict[str, Mapping[int, Message]] = {}
        """What a view shows of the latter, until the next message comes."""
        self._heard: dict[int, tuple[int, float]] = {}
        """When each robot's newest status came, in ns and in host time."""
        self._velocities: dict[str, tuple[Twist, int]] = {}
        """The newest velocity and its stamp, by the driver."""
        self.scan: LaserScan | None = None
        self.scan_stamp = 0
        """0 = none."""
        self.scan_interval, self._last_interval = 0.1, math.inf
        """Seconds between scans: the shorter one of the newest two intervals; Stage's tick before."""
        self.odom: Odometry | None = None
        self.transforms = transforms or TransformInputs()
        self._fixed = Buffer()
        """The fixed frames that the base itself publishes: a robot needs no aggregator to know where its laser is."""
        self._has_fixed = False
        self._lasers = LaserMounts(robot_id, self.transforms.buffer, self._fixed)
        self._told: dict[int, Base] = {}
        """The bases of the robots that have told theirs, by id."""
        self._known: tuple[tuple[int, ...], Set[int] | None] | None = None
        """What the next two hold for: the team and the robots of the tick; None once another base has come."""
        self._bases: Mapping[int, Base] = {}
        self._rows: Mapping[int, int] = {}
        """By the robots' ids: the bases that count, and the rows of their poses."""

    def on_scan(self, scan: LaserScan) -> None:
        before, self.scan, self.scan_stamp = self.scan_stamp, scan, ns_from_time(scan.header.stamp)
        if 0 < before < self.scan_stamp:
            # A single long one is an outage.
            last, self._last_interval = self._last_interval, (self.scan_stamp - before) / 1e9
            self.scan_interval = min(last, self._last_interval)

    def on_odom(self, odom: Odometry) -> None:
        self.odom = odom

    def on_base_info(self, robot_id: int, message: BaseInfo) -> None:
        """`base_info` of any robot of the team has come."""
        if robot_id == self._id:
            self.base = override_base(base_of(message), self._override)
        self._told[robot_id], self._known = base_of(message), None

    def on_fixed(self, message: TFMessage) -> None:
        """Fixed frames of the own base have come, of one of its processes: they are merged by child frame."""
        self._has_fixed, own = True, names.robot_name(self._id)
        for transform in message.transforms:
            parent, child = (names.resolve_frame(own, f) for f in (transform.header.frame_id, transform.child_frame_id))
            self._fixed.set_transform_static(TransformStamped(Header(frame_id=parent), child, transform.transform), own)

    def on_velocity(self, driver: str, _key: str, message: Any, stamp: int) -> None:
        """A velocity that came at `stamp` (ns) counts: in lock-step that of the tick in which it was sent. The bus
        drops those that are not finite."""
        self._velocities[driver] = (message.twist if isinstance(message, TwistStamped) else message), stamp

    def choose(self, now: int) -> tuple[str, Twist] | None:
        """The velocity mux, as ROS's twist_mux: the first of SOURCES heard within TIMEOUT of `now` (ns) drives.

        Its velocity, too; None where the behaviour drives.
        """
        for driver in SOURCES:
            if driver in self._velocities and abs(now - self._velocities[driver][1]) <= TIMEOUT:
                return driver, self._velocities[driver][0]
        return None

    def on_declared(self, declared: DeclaredInput, key: str, message: Message, stamp: int) -> None:
        """A message of a declared input that has come on `key` at time `stamp` (ns) counts."""
        if not declared.of_all_robots:
            self._of_behavior[declared.name] = message
        elif target := names.split_robot_key(key):
            self._of_behavior[declared.name][target[0]] = message
            self._shown.pop(declared.name, None)
            if isinstance(message, RobotStatus):
                self._heard[target[0]] = stamp, monotonic()

    def silent(self, now: int | None, heard_from: float = 0.0) -> Set[int]:
        """The robots whose newest status is older than SILENT_AFTER at time `now` (ns); or, if that is None, by
        host time, where they could be heard from `heard_from` on.
        """
        found: list[int] = []
        if now is not None and self._heard and (now - min(self._heard.values())[0]) / 1e9 <= SILENT_AFTER:
            # Mostly none is.
            return frozenset()
        for robot, (stamp, heard) in self._heard.items():
            age = monotonic() - max(heard, heard_from) if now is None else (now - stamp) / 1e9
            if age > SILENT_AFTER:
                found.append(robot)
        return frozenset(found)

    def _none_declared(self) -> dict[str, Any]:
        return {declared.name: {} if declared.of_all_robots else None for declared in self.declared}

    def missing(self) -> list[str]:
        """As nouns for the robot's status: `base_info`, while it has to come before the robot is ready, and stamps."""
        if self.scan is not None and not self.scan_stamp:
            return [f"a time stamp in its scans ({names.scan_key(self._id, 0)}), which have 0"]
        key = names.robot_key(self._id, names.BASE_INFO)
        return [] if self._id in self._told or self._given_up else [f"its footprint ({key})"]

    def wait_no_longer(self) -> None:
        """A scan is acted on in real time: from BASE_INFO_LIMIT after the first one on, do without `base_info`."""
        if self._id in self._told or self._given_up:
            return
        self._waits_since = self._waits_since or monotonic()
        if monotonic() - max(self._waits_since, FREEZES.look()) > BASE_INFO_LIMIT:
            self._given_up, key = True, names.robot_key(self._id, names.BASE_INFO)
            log.warning("no %s: an erratic's footprint and limits hold where 'base' does not set them", key)

    def has_bases(self, robots: frozenset[int]) -> bool:
        """Whether the bases of all robots of a tick have come."""
        return robots <= self._told.keys()

    def lacking(self, stamp: int, *, tf: bool = True, connected: bool = False) -> list[str]:
        """The keys whose data of time `stamp` has not come, or at all that of `base_info` and the base's fixed frames.

        `tf` = False leaves the transforms out. With `connected` the transforms must lead from the map to the robot: the
        fixed ones may come later than the first bundle.
        """
        lacking = []
        if self._id not in self._told:
            lacking.append(names.robot_key(self._id, names.BASE_INFO))
        if not self._has_fixed:
            lacking.append(names.robot_key(self._id, names.TF_STATIC))
        if self.scan is None or self.scan_stamp < stamp:
            lacking.append(names.robot_key(self._id, names.BASE_SCAN))
        if self.odom is None or ns_from_time(self.odom.header.stamp) < stamp:
            lacking.append(names.robot_key(self._id, names.ODOM))
        if tf and not lacking:
            newest: int | None = self.transforms.stamp
            if connected and self.transforms.stamp >= stamp:
                newest = self.transforms.buffer.latest_common_time(names.MAP_FRAME, self._base)
            lacking = [names.TF] if newest is None or newest < stamp else []
        return lacking

    def view(
        self,
        now: int,
        dt: float,
        team: tuple[int, ...],
        seed: int = 1,
        *,
        is_first: bool = False,
        silent: Set[int] = frozenset(),
        robots: Set[int] | None = None,
    ) -> View:
        """What the behaviour sees at time `now` (ns), `dt` seconds after its last step. For `silent` see there.

        `robots` are those of the tick in lock-step: no other base counts then.

        In the first tick of lock-step (`is_first`) no declared input has come: chance says what came before it.
        """
        if self._known != (team, robots):
            self._known = team, robots
            self._bases = {i: base for i, base in sorted(self._told.items()) if robots is None or i in robots}
            self._rows = {i: row for row, i in enumerate(sorted({self._id, *team, *self._bases}))}
        seen = None if self.scan is None else self._lasers.level(self.scan)
        for name, newest in self._of_behavior.items():
            if isinstance(newest, dict) and name not in self._shown:
                # A copy: the behaviour may look at it while messages come.
                self._shown[name] = MappingProxyType(dict(sorted(newest.items())))
        declared = self._none_declared() if is_first else {**self._of_behavior, **self._shown}
        view = View(
            now=now,
            dt=dt,
            robot_id=self._id,
            scan=seen and seen.scan,
            laser=seen.laser if seen else (0.0, 0.0),
            scan_needs=seen.problem.noun if seen and seen.problem else "",
            odom=self.odom,
            lookup=self.transforms.find_pose,
            base=self.base,
            bases=self._bases,
            team=team,
            inputs=MappingProxyType(declared),
            silent=silent,
            seed=seed,
        )
        vars(view)["poses"] = self.transforms.find_poses(self._rows)
        return view

    def forget(self) -> None:
        """Time jumped back: forget everything but the base, the fixed transforms and GO."""
        self.transforms.forget()
        self._of_behavior, self._shown, self._heard = self._none_declared(), {}, {}
        self._velocities.clear()
        self.scan = self.odom = None
        self.scan_stamp = 0
