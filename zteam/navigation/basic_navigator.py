"""`zteam.BasicNavigator`: Nav2's simple commander for one robot, for scripts and for nodes of one's own."""

import math
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from zteam import messages, names
from zteam.bus import Bus, BusOptions, connect
from zteam.clock import Every, monotonic
from zteam.errors import BusError, UsageError, log
from zteam.geometry import Pose2
from zteam.messages.planar import is_finite
from zteam.navigation.client import NavigationClient, TaskResult, find_robot_id, goal_message
from zteam.node.node import Node
from zteam.simulator.client import team_clock

AnyPose = messages.PoseStamped | Pose2
"""A pose: a message in any frame, or x, y (m), yaw (rad) in `map`."""

_LOOK = 0.1
"""Host seconds that `isTaskComplete` waits for the end, as Nav2's does."""
_PATIENCE = 3.0
"""Host seconds after which it says what a goal waits for: navigation may speak once a second."""
_POSE_LIMIT = 5.0
"""Host seconds for navigation to hear an initial pose."""
_COVARIANCE = np.diag([0.25, 0.25, 0.0, 0.0, 0.0, math.radians(15.0) ** 2]).ravel()
_COVARIANCE.flags.writeable = False
"""Of an initial pose: rviz's, half a metre and 15 degrees."""


class NavigationFeedback(msgspec.Struct, frozen=True):
    """How far the robot is; the names are those of Nav2's actions."""

    distance_remaining: float
    """Metres of the path that lie before it; NaN where they are not known."""
    estimated_time_remaining: messages.Duration
    navigation_time: messages.Duration
    """Since the goal was sent, in the team's time."""
    number_of_recoveries: int
    current_waypoint: int
    """The index of the goal in `followWaypoints`; 0 for one goal."""
    text: str
    """Why the robot does not get on; empty where there is nothing to say."""


class BasicNavigator:
    """Sends one robot to goals, with the method names of Nav2's BasicNavigator.

    `link` is a Bus, or the zteam.Node whose `step` and callbacks use it; without it a session is opened, which `close`
    or the end of a `with` ends. In a script the world goes on while the script waits. In a node nothing waits: make it
    before `node.run(step)`, and ask `isTaskComplete` in each step. Then goals are sent in the node's tick, and a run
    in lock-step repeats.
    """

    def __init__(self, robot: int | str, link: Bus | Node | None = None) -> None:
        """`robot` is its id or name. Raises UsageError for a name that is no robot's, BusError without a router."""
        robot_id = find_robot_id(str(robot))
        self._own_bus = connect(BusOptions.from_environment()) if link is None else None
        link = link or self._own_bus
        assert link is not None
        self._node = link if isinstance(link, Node) else None
        self._clock = link.clock if isinstance(link, Node) else team_clock(link)
        self._client = NavigationClient(link, robot_id, self._clock.now)
        # In host seconds.
        self._nag, self._waits_since = Every(10.0), math.inf
        key = names.robot_key(robot_id, names.INITIAL_POSE)
        self._initial_pose = link.publisher(key, messages.PoseWithCovarianceStamped)

    def __enter__(self) -> "BasicNavigator":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the session, if it is the navigator's own. The robot drives on: `cancelTask` stops it."""
        if self._own_bus is not None:
            self._own_bus.close()

    @property
    def is_active(self) -> bool:
        """Whether something takes goals: the robot's navigation, or the behaviour go_to that it runs."""
        return bool(self._client.taker)

    @property
    def reason(self) -> str:
        """Why the task ended as it did, or why the robot does not get on; empty where there is nothing to say."""
        watch = self._client.watch
        return "" if watch is None else self._client.waits_for or watch.text

    def waitUntilNav2Active(self, timeout: float | None = None) -> None:  # noqa: N802
        """Wait until the robot's navigation is there. Raises BusError after `timeout` host seconds.

        Raises UsageError in a node, where it would hold the world: see `is_active`.
        """
        if self._node is not None:
            raise UsageError("waitUntilNav2Active would hold the world: in a node look at is_active in each step")
        self._wait(lambda: self.is_active, timeout, "navigation is not there")

    def _wait(self, ready: Callable[[], bool], timeout: float | None, trouble: str) -> None:
        end = math.inf if timeout is None else monotonic() + timeout
        while not ready():
            if monotonic() >= end:
                raise BusError(f"{trouble} within {timeout:g} s: waiting for {self._client.lack or 'it'}")
            self._client.wait(ready, min(_LOOK, max(0.0, end - monotonic())))
            self._complain(self._client.lack)

    def setInitialPose(self, initial_pose: AnyPose) -> None:  # noqa: N802
        """Tell the localiser where the robot is. Navigation must be there to hear it (`waitUntilNav2Active`).

        In a script it waits for 5 s at most; then, and in a node at once, it raises BusError if nothing hears it.
        """
        place = _message(initial_pose)
        limit = _POSE_LIMIT if self._node is None else 0.0
        self._wait(lambda: self._initial_pose.has_subscribers, limit, "nothing hears the initial pose")
        header = messages.Header(messages.time_from_ns(self._clock.now()), place.header.frame_id)
        estimate = messages.PoseWithCovariance(place.pose, _COVARIANCE)
        self._initial_pose.put(messages.PoseWithCovarianceStamped(header, estimate))

    def goToPose(self, pose: AnyPose) -> bool:  # noqa: N802
        """Send a goal. It takes the place of the task before, and waits for navigation if that is not there yet.

        Returns True, as Nav2's does for a goal that is accepted; one that navigation refuses ends with FAILED.
        """
        return self.followWaypoints([pose])

    def followWaypoints(self, poses: Sequence[AnyPose]) -> bool:  # noqa: N802
        """Send goals, each when the one before is reached. The task fails with the first that is not reached."""
        goals = [_message(pose) for pose in poses]
        if not goals:
            raise UsageError("followWaypoints: give at least one pose")
        self._client.send(goals[0], goals[1:])
        return True

    def isTaskComplete(self) -> bool:  # noqa: N802
        """Whether the task has ended, or there is none. In a script it waits for up to 0.1 s, in a node not at all."""
        self._client.look()
        if self._node is None:
            self._client.wait(lambda: self._client.is_over, _LOOK)
        if not (is_over := self._client.is_over):
            self._complain(self._client.waits_for)
        return is_over

    def _complain(self, lack: str) -> None:
        self._waits_since = min(self._waits_since, monotonic()) if lack else math.inf
        if lack and monotonic() - self._waits_since >= _PATIENCE and self._nag.due():
            log.warning("%s: waiting for %s", self._client.name, lack)

    def getFeedback(self) -> NavigationFeedback | None:  # noqa: N802
        """How far the robot is; None while navigation has said nothing of the goal."""
        watch = self._client.watch
        if watch is None or watch.status is None:
            return None
        status, sent = watch.status, messages.ns_from_time(watch.goal.header.stamp)
        since = messages.time_from_ns(max(0, self._clock.now() - sent))
        left, eta = status.distance_remaining, status.estimated_time_remaining
        taken = messages.Duration(since.sec, since.nanosec)
        return NavigationFeedback(left, eta, taken, status.recoveries, self._client.waypoint, status.text)

    def getResult(self) -> TaskResult:  # noqa: N802
        """How the task ended; UNKNOWN while it lasts, and without one."""
        is_over, watch = self._client.is_over, self._client.watch
        return watch.result if watch is not None and is_over else TaskResult.UNKNOWN

    def cancelTask(self) -> None:  # noqa: N802
        """Give the task up: the robot stops, and the result is CANCELED. Raises BusError if that cannot be asked for.

        In a node the question is asked on a thread of its own, because an answer comes only after the step.
        """
        if not (self._client.withdraw() or self._client.is_over):
            self._client.cancel() if self._node is None else self._client.cancel_later()


def _message(place: AnyPose) -> messages.PoseStamped:
    """The goal as a message. Raises UsageError for what is no pose."""
    if isinstance(place, Pose2):
        place = goal_message(place)
    if not isinstance(place, messages.PoseStamped):
        raise UsageError(f"a pose is a PoseStamped or a Pose2, not a {type(place).__name__}")
    if not is_finite(place.pose) or not place.header.frame_id:
        raise UsageError(f"a pose needs finite numbers and a frame, such as header.frame_id = {names.MAP_FRAME!r}")
    return place
