"""Goals for one robot in turn: the next is sent when the one before is reached. No call but `cancel` waits."""

import threading
from collections.abc import Callable, Sequence

from zteam.bus import Bus
from zteam.messages import PoseStamped
from zteam.services.navigation import GoalWatch, Link, NavigationClient, TaskResult


class Tour:
    """It ends with its last goal, or with the first that is not reached."""

    def __init__(self, bus: Bus, robot_id: int, now: Callable[[], int], link: Link) -> None:
        """`now()` is the team's time (ns)."""
        self.changed = threading.Condition(threading.RLock())
        """Notified when there is news."""
        self.index = 0
        """Of the newest goal."""
        self.watch: GoalWatch | None = None
        """Of the newest goal."""
        self.begin = 0
        """When it was sent, in ns."""
        self._now = now
        self._goals: Sequence[PoseStamped] = ()
        self._is_sending = False
        self.client = NavigationClient(bus, robot_id, now, link=link, on_change=self.advance)

    def start(self, goals: Sequence[PoseStamped]) -> None:
        """Begin with the first of these goals, in the place of what was before."""
        with self.changed:
            self._goals, self.index, self._is_sending = goals, 0, True
        self._send(goals[0])

    def _send(self, goal: PoseStamped) -> None:
        # Without the lock: in memory, handlers of others run within, and navigation may answer at once.
        begin = self._now()
        watch = self.client.send(goal)
        with self.changed:
            self.watch, self.begin, self._is_sending = watch, begin, False
        self.advance()

    def advance(self) -> None:
        """Something may have changed: send the next goal if it is due."""
        goal = None
        with self.changed:
            if self._has_next and not self._is_sending:
                self.index += 1
                self._is_sending, goal = True, self._goals[self.index]
            self.changed.notify_all()
        if goal is not None:
            self._send(goal)

    @property
    def _has_next(self) -> bool:
        reached = self.watch is not None and self.watch.result == TaskResult.SUCCEEDED
        return reached and self.index + 1 < len(self._goals)

    @property
    def is_over(self) -> bool:
        """Whether it has ended, or never begun."""
        with self.changed:
            return not self._is_sending and not self._has_next and (self.watch is None or self.watch.ended)

    @property
    def result(self) -> TaskResult:
        """How it ended; UNKNOWN while it lasts, and before the first."""
        with self.changed:
            return self.watch.result if self.watch is not None and self.is_over else TaskResult.UNKNOWN

    def cut(self) -> None:
        """Let the newest goal be the last."""
        with self.changed:
            self._goals = self._goals[: self.index + 1]
