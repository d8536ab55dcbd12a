"""Goals for one robot: sent to its navigation, or to its behaviour go_to where it has none; watched and canceled."""

import logging
import threading
from collections.abc import Callable
from typing import Protocol, TypeVar

from zteam import names
from zteam.bus import Bus
from zteam.bus.transport import Closeable
from zteam.clock import monotonic
from zteam.errors import BusError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import Message, NavigationStatus, PoseStamped, RobotStatus, time_from_ns
from zteam.services.goal_taker import GO_TO, GoalTaker
from zteam.services.goals import GoalWatch, OtherGoal, TaskResult, goal_message, stamped, status_of_go_to
from zteam.services.navigation import CANCEL, CancelReply, CancelRequest, navigation_query
from zteam.services.transforms_client import TransformClient
from zteam.tf import TransformException

log = logging.getLogger("zteam")

M = TypeVar("M", bound=Message)

CANCEL_LIMIT = 2.0
"""Host seconds for the answer to a request to cancel."""


class Link(Protocol):
    """How messages come: a Bus, or a node, which handles them in its time."""

    def subscribe(self, key_expr: str, message_type: type[M], callback: Callable[[str, M], None], /) -> Closeable:
        """Call `callback(key, message)` for each message."""


class NavigationClient:
    """Sends goals to one robot, one after the other; a new one takes the place of the one before.

    Only `cancel` waits. A goal is kept until there is something that takes it. `look` is to be called now and then.
    """

    def __init__(
        self,
        bus: Bus,
        robot_id: int,
        now: Callable[[], int],
        *,
        link: Link | None = None,
        on_change: Callable[[], None] = lambda: None,
        yields: bool = False,
    ) -> None:
        """`now()` is the team's time (ns). `on_change()` is called from the bus's threads when there is news.
        With `yields`, nothing is sent while a goal of another sender lasts.
        """
        self._bus, self.robot_id, self._now, self._on_change = bus, robot_id, now, on_change
        self.name = names.robot_name(robot_id)
        self.watch: GoalWatch | None = None
        """The newest goal."""
        self.is_pending = False
        """Whether the newest goal is still to be sent."""
        self.taker = GoalTaker(robot_id, monotonic())
        self._lock = threading.RLock()
        self._stamp = 0  # of the newest goal: no two have the same
        self._other, self._yields = OtherGoal(), yields
        link = link or bus
        key = names.robot_key(robot_id, names.GOAL_POSE)
        self._publisher = bus.publisher(key, PoseStamped, to_others=yields)
        if yields:
            link.subscribe(key, PoseStamped, self._on_other_goal)
        link.subscribe(names.robot_key(robot_id, names.NAVIGATION_STATUS), NavigationStatus, self._on_navigation)
        link.subscribe(names.robot_key(robot_id, names.STATUS), RobotStatus, self._on_robot)
        tokens = names.tokens_key(names.navigation_name(robot_id)), names.tokens_key(self.name)
        bus.watch_tokens(tokens, self._on_token)

    @property
    def waits_for(self) -> str:
        """What the goal waits for to be sent, and the way out; empty if it is sent."""
        if not self.is_pending:
            return ""
        key = names.robot_key(self.robot_id, names.GOAL_POSE)
        return self.taker.lack or self._other.lack or f"something that subscribes to {key}"

    def send(self, goal: PoseStamped) -> GoalWatch:
        """Send a goal, stamped when it leaves; its watch tells what becomes of it."""
        with self._lock:
            if self.watch is not None:
                self.watch.end(TaskResult.FAILED, "a new goal took its place")
            watch = self.watch = GoalWatch(goal)
            self.is_pending = True
        self._flush()
        return watch

    def _flush(self) -> None:
        """Send the newest goal, if that is due."""
        with self._lock:
            waits = self.taker.lack or self._other.lack
            if waits or not (self.is_pending and self.watch and self._publisher.has_subscribers):
                return
            self._stamp = max(self._now(), self._stamp + 1)
            goal = self.watch.goal = stamped(self.watch.goal, self._stamp)
            self.is_pending = False
        # Without the lock: in memory, handlers of others run within.
        self._publisher.put(goal)

    def look(self) -> None:
        """Send what could not be sent before, and find out whether what took the goal is gone."""
        self._flush()
        with self._lock:
            gone = self.taker.take_loss(monotonic())
            if gone and self.watch is not None and not self.is_pending:
                self.watch.end(TaskResult.FAILED, f"the process {gone} is gone")

    def cancel(self) -> bool:
        """Give the goal up; returns whether there was one. It waits, so no handler and no `step` may call it.

        Raises BusError if nothing can cancel it.
        """
        with self._lock:
            watch = self.watch
            if watch is not None and self.is_pending:
                self.is_pending = False
                watch.end(TaskResult.CANCELED, "before it was sent")
                return True
        if self.taker.kind == GO_TO:
            self._send_here()
            return True
        key = navigation_query(self.robot_id, CANCEL)
        answers = self._bus.query(key, CancelReply, CancelRequest(), timeout=CANCEL_LIMIT)
        if not answers:
            raise BusError(f"{self.name} has no navigation: zteam-nav --id {self.robot_id}")
        return answers[0][1].canceled

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

    def _send_here(self) -> None:
        """Let the robot stay where it is: the behaviour go_to knows no other way to give a goal up."""
        here = _place_of(self._bus, self.robot_id)
        with self._lock:
            if self.watch is not None:
                self.watch.end(TaskResult.CANCELED, "")
        self._publisher.put(goal_message(here, stamp=time_from_ns(self._now())))

    def _on_other_goal(self, _key: str, goal: PoseStamped) -> None:
        with self._lock:
            again = self._other.hear(goal, None if self.is_pending else self.watch, self._now())
        if again:
            self._publisher.put(goal)

    def _on_navigation(self, _key: str, status: NavigationStatus) -> None:
        with self._lock:
            self.taker.take_navigation()
            if self.watch is not None and not self.is_pending:
                self.watch.take(status)
            if self._yields:
                self._other.take(status, None if self.is_pending else self.watch, self._now())
        self._flush()
        self._on_change()

    def _on_robot(self, _key: str, status: RobotStatus) -> None:
        with self._lock:
            self.taker.take_behavior(status.behavior, monotonic())
            if self.taker.kind == GO_TO and self.watch is not None and not self.is_pending:
                told = status_of_go_to(status, self.watch.goal)
                if told is not None:
                    self.watch.take(told)
            if self.taker.kind == GO_TO:
                self._other.take_go_to(status)
        self._flush()
        self._on_change()

    def _on_token(self, key: str, alive: bool) -> None:
        with self._lock:
            self.taker.take_token(key, alive, monotonic())
        self._on_change()


def _place_of(bus: Bus, robot_id: int) -> Pose2:
    """Where a robot is in `map`. Raises BusError."""
    base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
    try:
        found = TransformClient(bus).lookup_transform(names.MAP_FRAME, base).transform
    except TransformException as error:
        raise BusError(f"{names.robot_name(robot_id)} cannot be told to stay where it is: {error}") from None
    turn = found.rotation
    return Pose2(found.translation.x, found.translation.y, yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))
