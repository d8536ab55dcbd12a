"""Which goal a robot gets next. Pure."""

from collections.abc import Sequence

from zteam.nodes.goals.file import FileGoal, robots_of


class _Turn:
    """Some goals in their order, again and again for so many rounds."""

    def __init__(self, goals: Sequence[FileGoal], rounds: int | None) -> None:
        self._goals = goals
        self._left = None if rounds is None else rounds * len(goals)
        self._next = 0
        self.count = len(goals)

    def take(self) -> FileGoal | None:
        if not self._goals or self._left == 0:
            return None
        goal = self._goals[self._next]
        self._next = (self._next + 1) % len(self._goals)
        if self._left is not None:
            self._left -= 1
        return goal


class Rounds:
    """The goals of a file: each robot's own in their order, and those that several robots share."""

    def __init__(self, goals: Sequence[FileGoal], spread: Sequence[int] = (), rounds: int | None = 1) -> None:
        """`spread` are the robots that share the goals without a robot; `rounds` None = for ever."""
        self.robots = sorted({*robots_of(goals), *spread})
        """The robots that may get a goal."""
        self._own = {i: _Turn([goal for goal in goals if goal.robot == i], rounds) for i in self.robots}
        self._shared = _Turn([goal for goal in goals if goal.robot is None], rounds)
        self._spread = frozenset(spread)

    def take(self, robot_id: int) -> FileGoal | None:
        """The next goal of this robot: its own first, then those that it shares; None if there is none."""
        own = self._own[robot_id].take()
        if own is None and robot_id in self._spread:
            return self._shared.take()
        return own

    def count(self, robot_id: int) -> int:
        """The number of goals that this robot may get in one round."""
        return self._own[robot_id].count + (self._shared.count if robot_id in self._spread else 0)
