"""What has come for one robot: the newest scan, odometry, transforms and team status. It knows no bus."""

from collections.abc import Mapping

from zteam import names
from zteam.base import Base, BaseOverride, base_of
from zteam.behaviors.behavior import NO_BASES, DeclaredInput, FindPose, View
from zteam.messages import BaseInfo, LaserScan, Odometry, TeamState, TeamStatus, TFMessage, ns_from_time
from zteam.nodes.robot.base_input import BaseInput
from zteam.nodes.robot.declared import DeclaredInputs
from zteam.nodes.robot.mux import Mux
from zteam.tf import Buffer
from zteam.tf.lazy_bundles import Bundles


class Inputs:
    """The newest data of robot `robot_id`. Stamps are in ns.

    The caller holds a lock for everything but `lookup`, which any thread may call.
    """

    def __init__(
        self, robot_id: int, override: BaseOverride | None = None, declared: list[DeclaredInput] | None = None
    ) -> None:
        """`override` holds instead of what `base_info` tells; `declared` is what the behaviour declares."""
        self.base_input = BaseInput(robot_id, override or BaseOverride())
        self.mux = Mux()
        self.declared = DeclaredInputs(declared or [])
        self.scan: LaserScan | None = None
        self.scan_stamp = 0
        """Stamp of the newest scan; 0 = none."""
        self.scan_interval = 0.1
        """Seconds between the newest two scans; Stage's tick before."""
        self.odom: Odometry | None = None
        self.odom_stamp = 0
        """Stamp of the newest odometry; 0 = none."""
        self.team: TeamStatus | None = None
        self.tf_stamp = 0
        """Stamp of the newest bundle of transforms; 0 = none."""
        self.bases: Mapping[int, Base] = NO_BASES
        """The bases of the robots by id: of all that have told theirs; in lock-step of those of the tick."""
        self._told: dict[int, Base] = {}
        self._robots: frozenset[int] | None = None
        """Whose bases `bases` has, in lock-step."""
        self._id = robot_id
        self._base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self._buffer = Buffer()
        self._bundles = Bundles(self._buffer, names.TF)
        self.lookup: FindPose = self._bundles.find_pose2
        """The newest `target_from_source` in the plane and its stamp; None if it is unknown."""

    def take_scan(self, scan: LaserScan) -> None:
        """A scan has come."""
        before, self.scan, self.scan_stamp = self.scan_stamp, scan, ns_from_time(scan.header.stamp)
        if 0 < before < self.scan_stamp:
            self.scan_interval = (self.scan_stamp - before) / 1e9

    def take_odom(self, odom: Odometry) -> None:
        """Odometry has come."""
        self.odom, self.odom_stamp = odom, ns_from_time(odom.header.stamp)

    def take_bundle(self, bundle: bytes | TFMessage) -> None:
        """A message of `tf` has come. Raises DecodeError if its bytes are none."""
        self.tf_stamp = self._bundles.take(bundle) or self.tf_stamp

    def take_static(self, message: TFMessage) -> None:
        """The whole set of fixed transforms has come: a start pose that a localiser took over is not in it any more."""
        self._buffer.set_all_static(message.transforms, names.TF)
        self._bundles.forget_paths()

    def take_base(self, robot_id: int, message: BaseInfo) -> None:
        """`base_info` of any robot of the team has come."""
        if robot_id == self._id:
            self.base_input.take(message)
        self._told[robot_id] = base_of(message)
        self.bases, self._robots = dict(self._told), None

    def has_bases(self, robots: frozenset[int]) -> bool:
        """Whether the bases of all robots of a tick have come; from then on `bases` has theirs alone."""
        if self._robots is not robots:
            if not robots <= self._told.keys():
                return False
            self.bases, self._robots = {i: self._told[i] for i in sorted(robots)}, robots
        return True

    def complete_for(self, stamp: int, *, tf: bool = True, connected: bool = False) -> bool:
        """Whether all needed data of time `stamp` has come, and `base_info` at all.

        `tf` = False leaves the transforms out. With `connected` the transforms must lead from the map to the robot: the
        fixed ones may come later than the first bundle.
        """
        if not self.base_input.has_come or self.scan is None or self.scan_stamp < stamp:
            return False
        if self.odom is None or self.odom_stamp < stamp:
            return False
        return not tf or (self.tf_stamp >= stamp and (not connected or self._is_connected(stamp)))

    def _is_connected(self, stamp: int) -> bool:
        self._bundles.settle(names.MAP_FRAME, self._base)
        newest = self._buffer.latest_common_time(names.MAP_FRAME, self._base)
        return newest is not None and newest >= stamp

    def go_epoch(self, now: int) -> int:
        """The monitor's GO that holds at time `now`; 0 = none yet."""
        team = self.team
        if team is None or team.state != TeamState.GO or now < ns_from_time(team.go_stamp):
            return 0
        return team.epoch

    def view(self, now: int, dt: float, team: tuple[int, ...], seed: int = 1, *, is_first: bool = False) -> View:
        """What the behaviour sees at time `now` (ns), `dt` seconds after its last step.

        In the first tick of lock-step (`is_first`) no declared input has come: chance says what came before it.
        """
        return View(
            now=now,
            dt=dt,
            robot_id=self._id,
            scan=self.scan,
            odom=self.odom,
            lookup=self.lookup,
            base=self.base_input.base,
            bases=self.bases,
            team=team,
            inputs=self.declared.nothing if is_first else self.declared.view(now),
            seed=seed,
        )

    def forget(self) -> None:
        """Time jumped back: forget everything but the base, the fixed transforms and GO."""
        # First: a look-up on another thread must not bring old bundles into the empty buffer.
        self._bundles.clear()
        self._buffer.clear()
        self.mux.forget()
        self.declared.forget()
        self.scan = self.odom = None
        self.scan_stamp = self.odom_stamp = self.tf_stamp = 0
