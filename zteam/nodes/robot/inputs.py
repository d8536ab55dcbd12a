"""What has come for one robot: the newest scan, odometry, transforms and team status. It knows no bus."""

from zteam import names
from zteam.base import BaseOverride
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Odometry, TeamState, TeamStatus, TFMessage, ns_from_time
from zteam.nodes.robot.base_input import BaseInput
from zteam.tf import Buffer, TransformException
from zteam.tf.lazy_bundles import Bundles


class Inputs:
    """The newest data of robot `robot_id`. Stamps are in ns.

    The caller holds a lock for everything but `lookup`, which any thread may call.
    """

    def __init__(self, robot_id: int, override: BaseOverride | None = None) -> None:
        """`override` holds instead of what `base_info` tells."""
        self.base_input = BaseInput(robot_id, override or BaseOverride())
        self.scan: LaserScan | None = None
        self.odom: Odometry | None = None
        self.team: TeamStatus | None = None
        self.tf_stamp = 0
        """Stamp of the newest bundle of transforms; 0 = none."""
        self.needs_odom = True
        """Whether a tick is complete only with its odometry."""
        self.needs_tf = True
        """Whether a tick is complete only with its transforms."""
        self._base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self._buffer = Buffer()
        self._bundles = Bundles(self._buffer, names.TF)

    @property
    def scan_stamp(self) -> int:
        """Stamp of the newest scan; 0 = none."""
        return 0 if self.scan is None else ns_from_time(self.scan.header.stamp)

    @property
    def odom_stamp(self) -> int:
        """Stamp of the newest odometry; 0 = none."""
        return 0 if self.odom is None else ns_from_time(self.odom.header.stamp)

    def take_bundle(self, payload: bytes) -> None:
        """A message of `tf` has come. Raises DecodeError if its bytes are none."""
        self.tf_stamp = self._bundles.take(payload) or self.tf_stamp

    def take_static(self, message: TFMessage) -> None:
        """The whole set of fixed transforms has come: a start pose that a localiser took over is not in it any more."""
        self._buffer.set_all_static(message.transforms, names.TF)
        self._bundles.forget_paths()

    def complete_for(self, stamp: int, *, tf: bool = True, connected: bool = False) -> bool:
        """Whether all needed data of time `stamp` has come, and `base_info` at all.

        `tf` = False leaves the transforms out. With `connected` the transforms must lead from the map to the robot: the
        fixed ones may come later than the first bundle.
        """
        if not self.base_input.has_come or self.scan is None or self.scan_stamp < stamp:
            return False
        if self.needs_odom and (self.odom is None or self.odom_stamp < stamp):
            return False
        if not (tf and self.needs_tf):
            return True
        return self.tf_stamp >= stamp and (not connected or self._is_connected(stamp))

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

    def lookup(self, target: str, source: str) -> tuple[Pose2, int] | None:
        """The newest `target_from_source` in the plane and its stamp; None if it is unknown."""
        self._bundles.settle(target, source)
        try:
            return self._buffer.lookup_pose2(target, source, 0)
        except TransformException:
            return None

    def forget(self) -> None:
        """Time jumped back: forget everything but the base, the fixed transforms and GO."""
        # First: a look-up on another thread must not bring old bundles into the empty buffer.
        self._bundles.clear()
        self._buffer.clear()
        self.scan = self.odom = None
        self.tf_stamp = 0
