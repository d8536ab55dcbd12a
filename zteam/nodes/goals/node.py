"""The process that sends goals: it gives each robot its next goal when the last one has ended."""

import logging
from typing import NamedTuple

from zteam import names
from zteam.clock import monotonic, to_seconds
from zteam.messages import Odometry
from zteam.nodes.goals.file import FileGoal
from zteam.nodes.goals.rounds import Rounds
from zteam.runtime.node import Node
from zteam.services.navigation import GoalWatch, NavigationClient, TaskResult, goal_message

log = logging.getLogger("zteam")

_CANCEL_LIMIT = 1.0
"""Host seconds for all robots to give up their goals when the process ends."""


class Ended(NamedTuple):
    """A goal that has ended."""

    robot: int
    goal: FileGoal
    watch: GoalWatch
    seconds: float
    """From its sending to its end, in the team's time."""


class Errand:
    """What one robot is about."""

    def __init__(self, client: NavigationClient) -> None:
        self.client = client
        self.goal: FileGoal | None = None
        self.watch: GoalWatch | None = None
        self.sent = 0
        """When, in ns."""
        self.reached = 0
        """Goals."""
        self.failed = 0
        """Goals that were aborted or canceled."""
        self.failures = 0
        """Of them, those since the last goal that was reached."""

    @property
    def is_idle(self) -> bool:
        """Whether it has no goal."""
        return self.watch is None


class Dispatcher:
    """Gives robots goals until there are no more, and tells of each that has ended.

    A goal of another sender goes before: its end is waited for, and then the goal that it replaced is sent again.
    All of it is done in `step`, so that a run in lock-step repeats.
    """

    def __init__(self, node: Node, rounds: Rounds) -> None:
        self._node, self._rounds = node, rounds
        self._ended: list[Ended] = []
        self.errands = {i: Errand(self._client(i)) for i in rounds.robots}
        """By robot."""
        self.is_done = False
        """Whether there are no more goals."""
        # Without a simulator a base's data decides that time is the host's; what the robots say does not.
        self._odometry = node.subscribe(names.all_robots_key(names.ODOM), Odometry, lambda key, odom: None)
        node.on_stop(self._cancel_all)

    def _client(self, robot_id: int) -> NavigationClient:
        return NavigationClient(self._node.bus, robot_id, self._node.clock.now, link=self._node, yields=True)

    @property
    def all_reached(self) -> bool:
        """Whether every goal that has ended was reached."""
        return not any(errand.failed for errand in self.errands.values())

    def take_ended(self) -> list[Ended]:
        """The goals that have ended since the last call."""
        with self._node.changed:
            ended, self._ended = self._ended, []
            return ended

    def step(self, now: int) -> None:
        """Take what has ended, and send what comes next."""
        self._odometry.close()
        for errand in self.errands.values():
            errand.client.look()
            if errand.watch is not None and errand.watch.is_replaced:
                errand.watch = errand.client.send(errand.watch.goal)
            elif errand.watch is not None and errand.watch.ended:
                self._end(errand, now)
            if errand.watch is None:
                self._send_next(errand, now)
        if all(errand.is_idle for errand in self.errands.values()):
            self.is_done = True
            self._node.stop.request("all goals have ended")

    def _end(self, errand: Errand, now: int) -> None:
        assert errand.goal is not None and errand.watch is not None
        watch, errand.watch = errand.watch, None
        if watch.result == TaskResult.SUCCEEDED:
            errand.reached, errand.failures = errand.reached + 1, 0
        else:
            errand.failed, errand.failures = errand.failed + 1, errand.failures + 1
        self._ended.append(Ended(errand.client.robot_id, errand.goal, watch, to_seconds(now - errand.sent)))

    def _send_next(self, errand: Errand, now: int) -> None:
        robot_id = errand.client.robot_id
        if errand.failures >= self._rounds.count(robot_id) > 0:
            if errand.goal is not None:
                log.warning("%s: no more goals: it reached none of the last %d", errand.client.name, errand.failures)
            errand.goal = None
            return
        errand.goal = self._rounds.take(robot_id)
        if errand.goal is not None:
            errand.sent = now
            errand.watch = errand.client.send(goal_message(errand.goal.pose))

    def _cancel_all(self) -> None:
        """The process ends before its goals have: the robots stop."""
        # In a team that ends, navigation may be gone before.
        under_way = [errand.client for errand in self.errands.values() if not errand.is_idle]
        threads = [client.cancel_later(logging.DEBUG) for client in under_way]
        end = monotonic() + _CANCEL_LIMIT
        for thread in threads:
            thread.join(max(0.0, end - monotonic()))
