"""What one robot's navigation publishes."""

import logging
import math

import numpy as np

from zteam import messages, names
from zteam.errors import log
from zteam.geometry import Pose2, Velocity, quaternion_from_yaw
from zteam.messages.planar import pose_message
from zteam.navigation.planning import costmap as costs
from zteam.navigation.planning.costmap import Costmap, place
from zteam.navigation.planning.grid import Floats, GridMap
from zteam.navigation.planning.maps import map_message
from zteam.navigation.planning.parameters import Parameters
from zteam.navigation.process.costmaps import Costmaps
from zteam.navigation.process.localisers import Localiser
from zteam.navigation.process.navigator import STOP, Navigator
from zteam.node.node import Node

_VALUES = np.array([1 + (97 * (cost - 1)) // 251 for cost in range(256)]).astype(np.int8)
"""Costs as values of an OccupancyGrid, as Costmap2DPublisher of Nav2 has them: 99 inscribed, 100 lethal, -1 unknown."""
_VALUES[costs.FREE_SPACE], _VALUES[costs.INSCRIBED_INFLATED_OBSTACLE :] = 0, (99, 100, -1)

_MOST_COSTMAPS = 2.0
"""Hz."""
_PLANAR = [0, 1, 5, 6, 7, 11, 30, 31, 35]
"""Of x, y and yaw in the covariance of a pose: that has z, roll and pitch too."""
_CDR_POSE = np.dtype([("pose", "<f8", 7), ("next", "V16")])
"""A geometry_msgs/Pose of a path in CDR, and the header of the next one, which fills it up to a multiple of 8 bytes."""
_LOCAL_PLAN = 3.0
"""Metres of the path before the robot that are its local plan."""
_LEAST_SPEED = 0.05
"""m/s: an estimate of the time that remains is not made from less."""


class _ShownCostmap:
    """A latched key that is only written while it has subscribers: its messages are large."""

    def __init__(self, node: Node, key: str, frequency: float) -> None:
        # A latched publisher does not know whether it has any.
        self._asked = node.publisher(key, messages.OccupancyGrid)
        self._publisher = node.publisher(key, messages.OccupancyGrid, latched=True)
        self._interval = 1.0 / min(_MOST_COSTMAPS, frequency) if frequency else math.inf
        self.due = -math.inf
        """When the next one may be sent, in seconds."""

    def show(self, now: int, costmap: Costmap) -> None:
        """Send a costmap, if that is due, as Nav2 shows it: 99 inscribed, 100 lethal, -1 unknown."""
        if not self._asked.has_subscribers:
            self.due = -math.inf
        elif now / 1e9 >= self.due - 1e-6:
            self.due = now / 1e9 + self._interval
            grid = GridMap(costmap.frame, _VALUES[costmap.costs])
            self._publisher.put_owned(map_message(grid, messages.time_from_ns(now)))


class Outputs:
    """The publishers of one robot. Times are in ns unless they say seconds."""

    def __init__(self, node: Node, robot_id: int, parameters: Parameters) -> None:
        def key(topic: str) -> str:
            return names.robot_key(robot_id, topic)

        self._odom = names.robot_frame(robot_id, names.ODOM)
        self._base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self._command = node.publisher(key(names.CMD_VEL_NAV), messages.TwistStamped)
        self._tf = node.publisher(key(names.TF), messages.TFMessage)
        self._status = node.publisher(key(names.NAVIGATION_STATUS), messages.NavigationStatus)
        self._plan = node.publisher(key(names.PLAN), messages.Path, latched=True)
        self._local_plan = node.publisher(key(names.LOCAL_PLAN), messages.Path)
        self._pose = node.publisher(key(names.AMCL_POSE), messages.PoseWithCovarianceStamped, latched=True)
        self._cloud = node.publisher(key(names.PARTICLE_CLOUD), messages.PoseArray)
        self._footprint = node.publisher(key(names.PUBLISHED_FOOTPRINT), messages.PolygonStamped)
        self._global = _ShownCostmap(node, key(names.GLOBAL_COSTMAP), parameters.global_window.publish_frequency)
        self._local = _ShownCostmap(node, key(names.LOCAL_COSTMAP), parameters.local_window.publish_frequency)
        self._drives = self._clouded = False
        self._mean_speed = 0.0
        self._name = names.robot_name(robot_id)
        self._logged: tuple[object, ...] = ()
        self.forget()

    def forget(self) -> None:
        """Time jumped back."""
        self._told: tuple[object, ...] = ()
        self._told_at = -(10**18)
        self._planned: object = None
        self._placed = False
        """Whether the pose was sent; the next one comes with the next scan that the localiser takes in."""
        self._holds_at = 0
        """The stamp of the newest transform that was sent."""
        self._global.due = self._local.due = -math.inf

    def drive(self, now: int, velocity: Velocity, *, active: bool) -> None:
        """Send the command of a robot on its way; when it is there, one zero velocity more, then none."""
        if active or self._drives:
            twist = messages.Twist(messages.Vector3(velocity.x, velocity.y), messages.Vector3(0.0, 0.0, velocity.turn))
            header = messages.Header(messages.time_from_ns(now), self._base)
            self._command.put_owned(messages.TwistStamped(header, twist))
        self._drives = active
        if not active:
            self._mean_speed = 0.0
        elif velocity != STOP:
            # About that of the last three seconds.
            self._mean_speed += 0.03 * (abs(velocity.x) - self._mean_speed) if self._mean_speed else abs(velocity.x)

    def stop(self) -> None:
        """The process ends: a last zero velocity."""
        if self._drives:
            self._command.put(messages.TwistStamped(messages.Header(messages.Time(), self._base)))

    def localise(self, now: int, ahead: int, localiser: Localiser) -> None:
        """Send where the robot is; `ahead` is how long from `now` on the transform is to hold."""
        if localiser.map_from_odom is None:
            return
        x, y, yaw = localiser.map_from_odom
        transform = messages.Transform(messages.Vector3(x, y), messages.Quaternion(*quaternion_from_yaw(yaw)))
        # After a step that came late `ahead` was long, and no frame may have two samples of one time.
        self._holds_at = max(now + ahead, self._holds_at + 1)
        header = _header(self._holds_at)
        self._tf.put_owned(messages.TFMessage([messages.TransformStamped(header, self._odom, transform)]))
        if localiser.pose is None:
            return
        if localiser.updated or not self._placed:
            self._placed = True
            covariance = np.zeros(36)
            covariance[_PLANAR] = localiser.covariance.ravel()
            estimate = messages.PoseWithCovariance(pose_message(localiser.pose), covariance)
            self._pose.put_owned(messages.PoseWithCovarianceStamped(_header(now), estimate))
        if self._cloud.has_subscribers and (localiser.updated or not self._clouded):
            poses = [pose_message(Pose2(*row)) for row in localiser.particles().tolist()]
            self._cloud.put_owned(messages.PoseArray(_header(now), poses))
        self._clouded = self._cloud.has_subscribers

    def show(self, now: int, navigator: Navigator, pose: Pose2 | None, costmaps: Costmaps) -> None:
        """Send the plan, and what else is for looking at."""
        if navigator.path is not self._planned:
            self._planned = navigator.path
            self._plan.put_owned(_path_content(now, np.empty((0, 3)) if navigator.path is None else navigator.path))
        if pose is None:
            return
        if navigator.path is not None and self._local_plan.has_subscribers:
            along = round(_LOCAL_PLAN / costmaps.whole.frame.resolution)
            left = max(1, round(navigator.distance_remaining / costmaps.whole.frame.resolution))
            self._local_plan.put_owned(_path_content(now, navigator.path[-left:][:along]))
        if self._footprint.has_subscribers:
            corners = [messages.Point32(x, y) for x, y in place(costmaps.local.footprint, *pose).tolist()]
            self._footprint.put_owned(messages.PolygonStamped(_header(now), messages.Polygon(corners)))

    def show_costmaps(self, now: int, costmaps: Costmaps) -> None:
        """Send those that are due."""
        self._global.show(now, costmaps.whole)
        self._local.show(now, costmaps.local)

    def log(self, navigator: Navigator) -> None:
        news = navigator.state, navigator.text
        if news != self._logged and navigator.state is not messages.NavigationState.IDLE:
            self._logged = news
            level = logging.WARNING if navigator.state is messages.NavigationState.ABORTED else logging.INFO
            text = ": ".join(filter(None, (navigator.state.name.lower(), navigator.text)))
            log.log(level, "%s: %s", self._name, text)

    def tell(self, now: int, navigator: Navigator) -> None:
        """Send the status if it has changed, and once a second."""
        news = navigator.state, navigator.message, navigator.text, navigator.recoveries
        if news == self._told and now - self._told_at < 1_000_000_000:
            return
        self._told, self._told_at = news, now
        remaining = navigator.distance_remaining
        seconds = remaining / max(self._mean_speed, _LEAST_SPEED) if remaining else 0.0
        whole = int(seconds)
        eta = messages.Duration(whole, int((seconds - whole) * 1e9))
        state, message, text, recoveries = news
        status = messages.NavigationStatus(_header(now), int(state), message, remaining, eta, recoveries, text)
        self._status.put_owned(status)


def _header(now: int) -> messages.Header:
    return messages.Header(messages.time_from_ns(now), names.MAP_FRAME)


def _path_content(now: int, path: Floats) -> bytes:
    """A nav_msgs/Path in CDR: to make a message of each of its poses takes longer than to plan them."""
    header, poses = _header(now), np.zeros(len(path), _CDR_POSE)
    first = messages.encode(messages.Path(header, [messages.PoseStamped(header)] * min(1, len(path))))
    pose, half, poses["next"] = poses["pose"], 0.5 * path[:, 2], np.void(first[4:20])
    pose[:, :2], pose[:, 5], pose[:, 6] = path[:, :2], np.sin(half), np.cos(half)
    return first[:20] + len(path).to_bytes(4, "little") + first[24:44] + poses.tobytes()[:-16]
