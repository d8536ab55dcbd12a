"""A robot's navigation as other processes have it: requests, goals and what becomes of each, and a client.

Goals are taken by the robot's navigation, or by the behaviour go_to that the robot runs; both say the same of them.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.clock import monotonic, wait_until
from zteam.errors import BusError, log
from zteam.geometry import Pose2
from zteam.messages import Header, NavigationState, NavigationStatus, PoseStamped, RobotStatus, time_from_ns
from zteam.messages.planar import pose2_of, pose_message
from zteam.node.node import Node
from zteam.robot import client as robot_client
from zteam.robot.client import CANCEL, GONE, ON_THE_WAY, SETTLED, CancelReply, CancelRequest, is_same_goal

GLOBAL_LOCALIZATION = "global_localization"
NAVIGATION, GO_TO = "navigation", "go_to"
"""What takes goals."""


class GlobalLocalizationRequest(Change):
    """Forget where the robot is: spread the particles over all of the map that is free."""


class GlobalLocalizationReply(msgspec.Struct):
    """`refused` says why nothing was done, such as for a localiser without particles; empty if it was."""

    refused: str = ""


class TaskResult(IntEnum):
    """How a task ended; UNKNOWN while it lasts. The values are Nav2's."""

    UNKNOWN = 0
    SUCCEEDED = 1
    CANCELED = 2
    FAILED = 3


_ENDS: dict[int, TaskResult] = {
    NavigationState.SUCCEEDED: TaskResult.SUCCEEDED,
    NavigationState.ABORTED: TaskResult.FAILED,
    NavigationState.CANCELED: TaskResult.CANCELED,
}


def find_robot_id(text: str) -> int:
    """The id of a robot that a user names by its id or its name. Raises UsageError."""
    found = names.robot_id_of(text)
    return names.parse_robot_id(text) if found is None else found


def goal_message(pose: Pose2, frame: str = names.MAP_FRAME) -> PoseStamped:
    """A planar pose (m, rad) in a frame as a message."""
    return PoseStamped(Header(frame_id=frame), pose_message(pose))


def goal_text(goal: PoseStamped) -> str:
    """A goal for users: `x 3.2, y 4, yaw 1.57`, with its frame if that is not the map's."""
    frame = goal.header.frame_id
    where = "" if frame in ("", names.MAP_FRAME) else f" in {frame}"
    x, y, yaw = (round(number, 3) + 0.0 for number in pose2_of(goal.pose))
    return f"x {x:g}, y {y:g}, yaw {yaw:g}{where}"


@dataclass
class GoalWatch:
    """One goal from its sending to its end."""

    goal: PoseStamped
    status: NavigationStatus | None = None
    """The newest that is about this goal."""
    result: TaskResult = TaskResult.UNKNOWN
    text: str = ""
    """Why it ended as it did, or why the robot makes no progress."""
    is_replaced: bool = False
    """Whether it ended because another goal took its place."""

    @property
    def ended(self) -> bool:
        return self.result != TaskResult.UNKNOWN

    def receive(self, status: NavigationStatus) -> None:
        """The robot said something, about this goal or another one. After the end nothing counts."""
        if self.ended:
            return
        if is_same_goal(status.goal, self.goal):
            self.status, self.text = status, status.text
            if status.state in _ENDS:
                self.end(_ENDS[status.state], status.text)
        elif self.status is not None:
            # It had taken this goal: what it has now came later.
            if status.state == NavigationState.IDLE:
                self.end(TaskResult.FAILED, "navigation began anew and has forgotten the goal")
            else:
                self.replace(status.goal)

    def replace(self, goal: PoseStamped) -> None:
        self.is_replaced |= not self.ended
        self.end(TaskResult.FAILED, f"another goal took its place: {goal_text(goal)}")

    def end(self, result: TaskResult, text: str) -> None:
        if not self.ended:
            self.result, self.text = result, text


class NavigationClient:
    """Sends goals to one robot, one after the other; a new one takes the place of the one before. Watches and cancels.

    Only `cancel` waits. A goal is kept until there is something that takes it. `look` is to be called now and then.
    """

    def __init__(self, link: Bus | Node, robot_id: int, now: Callable[[], int], *, yields: bool = False) -> None:
        """A node handles what comes in its own time. `now()` is the team's time (ns).
        With `yields`, nothing is sent while a goal of another sender lasts, and the presence of the robot's navigation
        is enough for a goal to be sent: chance may lose its first status, and the next one comes a second later.
        """
        bus = self._bus = link.bus if isinstance(link, Node) else link
        self.robot_id, self._now = robot_id, now
        self.name = names.robot_name(robot_id)
        self.watch: GoalWatch | None = None
        """The newest goal."""
        self.is_pending = False
        """Whether the newest goal is still to be sent."""
        self._further: deque[PoseStamped] = deque()
        """Goals that follow the newest one, each when the one before is reached."""
        self.waypoint = 0
        """The place of the newest goal among those that were sent with it."""
        self.taker = ""
        """NAVIGATION, GO_TO, or empty while nothing is known to take goals."""
        self.is_stopped = False
        """Whether the robot is stopped (`zteam stop`), as far as it has told: it drives on when it is released."""
        self._behavior = ""
        """What the robot runs, as far as it has told."""
        self._held: set[str] = set()
        """The presence tokens of the robot's navigation and of its own process."""
        self._gone_since: float | None = None
        """When the process that takes the goals went away, in host seconds."""
        self._changed = threading.Condition()
        self._stamp = 0  # of the newest goal: no two have the same
        self._yields, self._other_came = yields, 0
        self._other: PoseStamped | None = None
        """The goal of another sender while it lasts, with `yields`; and when it came, in ns of the team's time."""
        key = names.robot_key(robot_id, names.GOAL_POSE)
        self._publisher = bus.publisher(key, PoseStamped, to_others=yields)
        if yields:
            link.subscribe(key, PoseStamped, self._on_other_goal)
        link.subscribe(names.robot_key(robot_id, names.NAVIGATION_STATUS), NavigationStatus, self._on_status)
        link.subscribe(names.robot_key(robot_id, names.STATUS), RobotStatus, self._on_robot)
        self._navigation = names.navigation_name(robot_id)
        tokens = names.tokens_key(self._navigation), names.tokens_key(self.name)
        bus.watch_tokens(tokens, self._on_token)

    @property
    def lack(self) -> str:
        """What is missing for goals to be taken, and the way out; empty if something takes them."""
        if self.taker:
            return ""
        if self._holds(self._navigation):
            return f"the first status of {self._navigation}, which runs: see 'zteam doctor'"
        runs = f"; it runs the behaviour {self._behavior}, which takes no goals" if self._behavior else ""
        return f"the navigation of {self.name}: start 'zteam-nav --id {self.robot_id}'{runs}"

    @property
    def is_over(self) -> bool:
        """Whether the newest goal has ended, and none follows it; also without a goal."""
        with self._changed:
            return self.watch is None or self.watch.ended

    @property
    def has_subscribers(self) -> bool:
        """Whether a goal that is sent now reaches another process."""
        return self._publisher.has_subscribers

    def _holds(self, process: str) -> bool:
        return any(key.startswith(f"{process}/") for key in self._held)

    @property
    def _taking_process(self) -> str:
        return self.name if self.taker == GO_TO else self._navigation

    @property
    def waits_for(self) -> str:
        """What the goal waits for to be sent, and the way out; empty if it is sent."""
        if not self.is_pending or self.lack:
            return self.lack if self.is_pending else ""
        if self._other is not None:
            return f"the end of another goal: {goal_text(self._other)}"
        key = names.robot_key(self.robot_id, names.GOAL_POSE)
        return "" if self.has_subscribers else f"something that subscribes to {key}"

    @property
    def _sent(self) -> GoalWatch | None:
        """The newest goal, unless it is still to be sent."""
        return None if self.is_pending else self.watch

    def send(self, goal: PoseStamped, further: Iterable[PoseStamped] = ()) -> GoalWatch:
        """Send a goal, stamped when it leaves, and then the `further` ones. Returns its watch."""
        with self._changed:
            if self.watch is not None:
                self.watch.end(TaskResult.FAILED, "a new goal took its place")
            watch = self.watch = GoalWatch(goal)
            self._further, self.waypoint, self.is_pending = deque(further), 0, True
        self._flush()
        return watch

    def _flush(self) -> None:
        with self._changed:
            if self.watch is None or not self.is_pending or self.waits_for:
                return
            self._stamp = max(self._now(), self._stamp + 1)
            goal = self.watch.goal
            header = Header(time_from_ns(self._stamp), goal.header.frame_id)
            goal = self.watch.goal = PoseStamped(header, goal.pose)
            self.is_pending = False
        # Without the lock: in memory, handlers of others run within.
        self._publisher.put(goal)

    def look(self) -> None:
        """Send what could not be sent before, and find out whether what took the goal is gone."""
        self._flush()
        with self._changed:
            if self._gone_since is None or monotonic() - self._gone_since < GONE:
                return
            gone, self.taker, self._gone_since = self._taking_process, "", None
            if (own := self._sent) is not None:
                own.end(TaskResult.FAILED, f"the process {gone} is gone")

    def wait(self, ready: Callable[[], bool], limit: float) -> None:
        """Wait until `ready()`, which each news may change, for `limit` host seconds at most."""
        with self._changed:
            wait_until(self._changed, ready, limit)

    def withdraw(self) -> bool:
        """Give up what is not sent yet; returns whether that is the newest goal too."""
        with self._changed:
            self._further.clear()
            watch = self.watch
            if watch is None or not self.is_pending:
                return False
            self.is_pending = False
            watch.end(TaskResult.CANCELED, "before it was sent")
            return True

    def cancel(self) -> bool:
        """Give the goal up; whether there was one. It waits, so no handler or `step` may call it. Raises BusError."""
        if self.withdraw():
            return True
        key = robot_client.navigation_query(self.robot_id, CANCEL)
        answers = self._bus.query(key, CancelReply, CancelRequest(), timeout=robot_client.CANCEL_LIMIT)
        if not answers:
            raise BusError(f"{self.name} has no navigation: zteam-nav --id {self.robot_id}")
        return any(answer.canceled for _, answer in answers)

    def cancel_later(self, level: int = logging.WARNING) -> threading.Thread:
        """`cancel` on a thread of its own, for those that may not wait; what goes wrong is logged at this level."""

        def cancel() -> None:
            try:
                self.cancel()
            except BusError as error:
                log.log(level, "%s: the goal cannot be canceled: %s", self.name, error)

        thread = threading.Thread(target=cancel, name=f"cancel {self.name}", daemon=True)
        thread.start()
        return thread

    def _on_other_goal(self, _key: str, goal: PoseStamped) -> None:
        with self._changed:
            self._other, self._other_came, own = goal, self._now(), self._sent
            # Both were sent at about the same time, and navigation may have heard one's own last.
            again = own is not None and not own.ended and own.status is None
            if own is not None:
                own.replace(goal)
        if again:
            self._publisher.put(goal)

    def _on_status(self, _key: str, status: NavigationStatus) -> None:
        # A behaviour says whose robot's it is; navigation wins over it, whichever speaks first.
        is_behavior = status.header.frame_id == self.name
        with self._changed:
            if is_behavior and (self.taker == NAVIGATION or self._holds(self._navigation)):
                return
            self.taker, self._gone_since = GO_TO if is_behavior else NAVIGATION, None
            if (own := self._sent) is not None:
                own.receive(status)
                if self._further and own.result == TaskResult.SUCCEEDED:
                    self.watch, self.is_pending = GoalWatch(self._further.popleft()), True
                    self.waypoint += 1
            if self._yields:
                self._follow_other(status)
            self._changed.notify_all()
        self._flush()

    def _follow_other(self, status: NavigationStatus) -> None:
        """The robot said something, about the goal of another sender, one's own or a third one."""
        own, other, now = self._sent, self._other, self._now()
        if status.state in ON_THE_WAY and not (own is not None and is_same_goal(status.goal, own.goal)):
            self._other, self._other_came = status.goal, now
        elif other is not None and (is_same_goal(status.goal, other) or not 0 <= now - self._other_came < SETTLED):
            # Before it has settled, navigation may still speak of the goal before.
            self._other = None

    def _on_robot(self, _key: str, status: RobotStatus) -> None:
        with self._changed:
            self._behavior, self.is_stopped = status.behavior, status.is_stopped
            self._changed.notify_all()

    def _on_token(self, key: str, alive: bool) -> None:
        with self._changed:
            (self._held.add if alive else self._held.discard)(key)
            if self._yields and self._holds(self._navigation):
                self.taker = NAVIGATION
            here = not self.taker or self._holds(self._taking_process)
            self._gone_since = None if here else self._gone_since or monotonic()
            self._changed.notify_all()
