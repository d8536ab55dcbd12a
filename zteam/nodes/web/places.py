"""Where the robots and their sensors are: from the transforms, or from the simulator's ground truth without them."""

from collections.abc import Iterable
from typing import TypeVar

from zteam import names
from zteam.errors import DecodeError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import Message, Odometry, Pose, TFMessage, decode, ns_from_time
from zteam.nodes.web.newest import Newest
from zteam.tf import Buffer, TransformException
from zteam.tf.lazy_bundles import Bundles

M = TypeVar("M", bound=Message)


class Places:
    """Reads what has come since the last look. One thread makes all calls."""

    def __init__(self, newest: Newest) -> None:
        self._newest = newest
        self.buffer = Buffer()
        self._bundles = Bundles(self.buffer, names.TF)
        self._taken = 0
        """The number of the newest bundle that was taken."""
        self._taken_static = 0
        self.stamp = 0
        """Nanoseconds of the newest poses."""
        self.number = 0
        """Of the newest poses' message."""
        self.time = 0.0
        """Host time at which these came."""
        self.from_truth = False

    def _take_static(self) -> None:
        arrival = self._newest.get(names.TF_STATIC)
        if arrival is None or arrival.number == self._taken_static:
            return
        self._taken_static = arrival.number
        message = decoded(TFMessage, arrival.content)
        if message is not None:
            self.buffer.set_all_static(message.transforms, names.TF)
            self._bundles.forget_paths()
            if self._taken:
                # Where odometry begins may be another place now.
                self.number = max(self.number, arrival.number)

    def clear(self) -> None:
        """Time was set back: what was known of the other time does not count."""
        self.buffer.clear()
        self._bundles.clear()

    def look(self, robots: Iterable[int]) -> dict[int, Pose2]:
        """The pose in `map` of each of these robots whose pose is known."""
        self._take_static()
        if self._take_bundle():
            self.from_truth = False
        if not self._taken:
            return self._look_at_truth(robots)
        found = {}
        for robot_id in robots:
            pose = self.pose_of(names.robot_frame(robot_id, names.BASE_FOOTPRINT))
            if pose is not None:
                found[robot_id] = pose
        return found

    def _take_bundle(self) -> bool:
        arrival = self._newest.get(names.TF)
        if arrival is None or arrival.number == self._taken:
            return False
        try:
            stamp = self._bundles.take(arrival.content)  # type: ignore[arg-type]
        except DecodeError:
            return False
        if stamp and stamp < self.stamp:
            self.clear()
            self._bundles.take(arrival.content)  # type: ignore[arg-type]
        self.stamp = stamp or self.stamp
        self._taken = self.number = arrival.number
        self.time = arrival.time
        return True

    def pose_of(self, frame: str, stamp: int = 0) -> Pose2 | None:
        """The pose of a frame in `map` at `stamp` (ns), or its newest where it is not known for then."""
        try:
            if stamp and stamp != self.stamp:
                self._bundles.settle(names.MAP_FRAME, frame)
                return self.buffer.lookup_pose2(names.MAP_FRAME, frame, stamp)[0]
        except TransformException:
            pass
        newest = self._bundles.find_pose2(names.MAP_FRAME, frame)
        return None if newest is None else newest[0]

    def _look_at_truth(self, robots: Iterable[int]) -> dict[int, Pose2]:
        found = {}
        for robot_id in robots:
            arrival = self._newest.get(names.robot_key(robot_id, names.GROUND_TRUTH))
            message = None if arrival is None else decoded(Odometry, arrival.content)
            if arrival is None or message is None:
                continue
            found[robot_id] = pose2_of(message.pose.pose)
            if arrival.number > self.number:
                self.number, self.time = arrival.number, arrival.time
                self.stamp = ns_from_time(message.header.stamp)
        self.from_truth = bool(found)
        return found


def pose2_of(pose: Pose) -> Pose2:
    """The planar part of a pose."""
    turn = pose.orientation
    return Pose2(pose.position.x, pose.position.y, yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))


def decoded(kind: type[M], content: bytes | Message) -> M | None:
    """The message in what came; None if it is none of this type."""
    if isinstance(content, bytes):
        try:
            return decode(kind, content)
        except DecodeError:
            return None
    return content if isinstance(content, kind) else None
