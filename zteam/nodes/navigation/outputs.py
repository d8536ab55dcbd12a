"""What one robot's navigation publishes."""

import logging
import math
from typing import Generic, TypeVar

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import (
    Duration,
    Header,
    Message,
    NavigationState,
    NavigationStatus,
    OccupancyGrid,
    Path,
    PolygonStamped,
    PoseArray,
    PoseWithCovarianceStamped,
    TFMessage,
    Time,
    TwistStamped,
    time_from_ns,
)
from zteam.nodes.navigation import to_messages
from zteam.nodes.navigation.costmaps import Costmaps
from zteam.nodes.navigation.localisers import Localiser
from zteam.nodes.navigation.navigator import Navigator
from zteam.nodes.navigation.way import STOP
from zteam.planning.controller import Velocity
from zteam.planning.parameters import Parameters
from zteam.runtime.step_node import StepNode

log = logging.getLogger("zteam")

M = TypeVar("M", bound=Message)

_MOST_COSTMAPS = 2.0
"""Hz."""
_LOCAL_PLAN = 3.0
"""Metres of the path before the robot that are its local plan."""
_LEAST_SPEED = 0.05
"""m/s: an estimate of the time that remains is not made from less."""


class _Watched(Generic[M]):
    """A latched key that is only written while it has subscribers: its messages are large."""

    def __init__(self, node: StepNode, key: str, kind: type[M]) -> None:
        # A latched publisher does not know whether it has any.
        self._asked = node.publisher(key, kind)
        self._publisher = node.publisher(key, kind, latched=True)
        self.due = -math.inf
        """When the next one may be sent, in seconds."""

    def is_due(self, now: float) -> bool:
        """Whether a message is to be made now."""
        if not self._asked.has_subscribers:
            self.due = -math.inf
        return self._asked.has_subscribers and now >= self.due - 1e-6

    def put(self, message: M, due: float) -> None:
        """Send; the next one is due at `due` (s)."""
        self._publisher.hand_over(message)
        self.due = due


class Outputs:
    """The publishers of one robot. Times are in ns unless they say seconds."""

    def __init__(self, node: StepNode, robot_id: int, parameters: Parameters) -> None:
        def key(topic: str) -> str:
            return names.robot_key(robot_id, topic)

        self._odom = names.robot_frame(robot_id, names.ODOM)
        self._base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self._parameters = parameters
        self._command = node.publisher(key(names.CMD_VEL_NAV), TwistStamped)
        self._tf = node.publisher(key(names.TF), TFMessage)
        self._status = node.publisher(key(names.NAVIGATION_STATUS), NavigationStatus)
        self._plan = node.publisher(key(names.PLAN), Path, latched=True)
        self._local_plan = node.publisher(key(names.LOCAL_PLAN), Path)
        self._pose = node.publisher(key(names.AMCL_POSE), PoseWithCovarianceStamped, latched=True)
        self._cloud = node.publisher(key(names.PARTICLE_CLOUD), PoseArray)
        self._footprint = node.publisher(key(names.PUBLISHED_FOOTPRINT), PolygonStamped)
        self._global = _Watched(node, key(names.GLOBAL_COSTMAP), OccupancyGrid)
        self._local = _Watched(node, key(names.LOCAL_COSTMAP), OccupancyGrid)
        self._drives = False
        self._planned: object = None
        self._placed = False
        """Whether the pose was sent; the next one comes with the next scan that the localiser takes in."""
        self._clouded = False
        self._told: tuple[object, ...] = ()
        self._told_at = -(10**18)
        self._mean_speed = 0.0
        self._name, self._logged = names.robot_name(robot_id), ""

    def forget(self) -> None:
        """Time jumped back."""
        self._told, self._told_at, self._planned, self._placed = (), -(10**18), None, False
        self._global.due = self._local.due = -math.inf

    def drive(self, now: int, velocity: Velocity, *, active: bool) -> None:
        """Send the command of a robot on its way; when it is there, one zero velocity more, then none."""
        if active or self._drives:
            self._command.hand_over(to_messages.velocity_message(time_from_ns(now), self._base, velocity))
        self._drives = active
        if not active:
            self._mean_speed = 0.0
        elif velocity != STOP:
            # About that of the last three seconds.
            self._mean_speed += 0.03 * (abs(velocity.x) - self._mean_speed) if self._mean_speed else abs(velocity.x)

    def stop(self) -> None:
        """The process ends: a last zero velocity."""
        if self._drives:
            self._command.put(TwistStamped(Header(Time(), self._base)))

    def localise(self, now: int, ahead: int, localiser: Localiser) -> None:
        """Send where the robot is; `ahead` is how long from `now` on the transform is to hold."""
        stamp = time_from_ns(now)
        if localiser.map_from_odom is not None:
            self._tf.hand_over(
                to_messages.transform_message(time_from_ns(now + ahead), self._odom, localiser.map_from_odom)
            )
        if localiser.pose is None or localiser.map_from_odom is None:
            return
        if localiser.updated or not self._placed:
            self._placed = True
            self._pose.hand_over(to_messages.pose_estimate_message(stamp, localiser.pose, localiser.covariance))
        if self._cloud.has_subscribers and (localiser.updated or not self._clouded):
            self._cloud.hand_over(to_messages.poses_message(stamp, localiser.particles()))
        self._clouded = self._cloud.has_subscribers

    def show(self, now: int, navigator: Navigator, pose: Pose2 | None, costmaps: Costmaps) -> None:
        """Send the plan, and what else is for looking at."""
        stamp, seconds = time_from_ns(now), now / 1e9
        if navigator.path is not self._planned:
            self._planned = navigator.path
            shown = Path(to_messages.header_of(stamp))
            if navigator.path is not None:
                shown = to_messages.path_message(stamp, navigator.path)
            self._plan.hand_over(shown)
        if pose is None:
            return
        if navigator.path is not None and self._local_plan.has_subscribers:
            along = round(_LOCAL_PLAN / costmaps.whole.frame.resolution)
            left = max(1, round(navigator.distance_remaining / costmaps.whole.frame.resolution))
            rest = navigator.path[-left:][:along]
            self._local_plan.hand_over(to_messages.path_message(stamp, rest))
        if self._footprint.has_subscribers:
            self._footprint.hand_over(to_messages.footprint_message(stamp, costmaps.footprint, pose))
        for watched, costmap, window in (
            (self._global, costmaps.whole, self._parameters.global_window),
            (self._local, costmaps.local, self._parameters.local_window),
        ):
            if watched.is_due(seconds):
                interval = 1.0 / min(_MOST_COSTMAPS, window.publish_frequency)
                watched.put(to_messages.costmap_message(stamp, costmap), seconds + interval)

    def log(self, navigator: Navigator) -> None:
        """Log how it goes, in few lines."""
        news = f"{navigator.state.name.lower()}{': ' if navigator.text else ''}{navigator.text}"
        if news != self._logged and navigator.state is not NavigationState.IDLE:
            self._logged = news
            level = logging.WARNING if navigator.state is NavigationState.ABORTED else logging.INFO
            log.log(level, "%s: %s", self._name, news)

    def tell(self, now: int, navigator: Navigator) -> None:
        """Send the status if it has changed, and once a second."""
        news = navigator.state, navigator.message, navigator.text, navigator.recoveries
        if news == self._told and now - self._told_at < 1_000_000_000:
            return
        self._told, self._told_at = news, now
        remaining = navigator.distance_remaining
        seconds = remaining / max(self._mean_speed, _LEAST_SPEED) if remaining else 0.0
        whole = int(seconds)
        self._status.hand_over(
            NavigationStatus(
                to_messages.header_of(time_from_ns(now)),
                int(navigator.state),
                navigator.message,
                remaining,
                Duration(whole, int((seconds - whole) * 1e9)),
                navigator.recoveries,
                navigator.text,
            )
        )
