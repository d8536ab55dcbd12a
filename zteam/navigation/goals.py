"""The process of `zteam goals`: robots reach the goals of a file in turn, and all robots at the same time."""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, repeat
from pathlib import Path
from typing import Any, NamedTuple

from zteam import names
from zteam.bus import Change, NoRequest
from zteam.clock import monotonic, to_seconds
from zteam.config.numbers import parse_number
from zteam.config.resources import read_yaml
from zteam.errors import ConfigError, UsageError, did_you_mean, log
from zteam.geometry import FAR, Pose2, turn_problem
from zteam.messages import NavigationStatus, Odometry, Tick
from zteam.navigation.client import GoalWatch, NavigationClient, TaskResult, find_robot_id, goal_message
from zteam.node.node import Node
from zteam.robot.client import ListReply

_CANCEL_LIMIT = 1.0
"""Host seconds for all robots to give up their goals when the process ends."""
_EXAMPLE = "{robot: 1, x: 3.0, y: 4.0, yaw: 1.57}"
_KEYS = ("robot", "x", "y", "yaw")


class FileGoal(NamedTuple):
    robot: int | None
    """None: any robot of those that share the goals."""
    pose: Pose2
    """In map."""
    line: int


def read_goals(path: Path, *, spread: bool = False) -> list[FileGoal]:
    """The goals of a YAML list; with `spread` they need no robot. Raises ConfigError with a line for each mistake."""
    root = read_yaml(path, "file of goals", 2 * 2**20, ConfigError, load=_compose)
    if root is None or root.id != "sequence" or not root.value:
        raise ConfigError(f"{path}:{_line(root) if root else 1}: a list of goals is expected, such as - {_EXAMPLE}")
    goals, mistakes = list[FileGoal](), list[str]()
    for node in root.value:
        try:
            goals.append(_read_goal(node, spread))
        except UsageError as error:
            mistakes.append(f"{path}:{_line(node)}: {error}")
    if mistakes:
        raise ConfigError("\n".join(mistakes))
    return goals


def _compose(data: bytes) -> Any:
    """The nodes of a YAML document: not their values, for YAML makes 8 of `010` and 90 of `1:30`."""
    import yaml

    return yaml.compose(data.decode("utf-8-sig"), yaml.SafeLoader)


def _line(node: Any) -> int:
    return int(node.start_mark.line) + 1


def _read_goal(node: Any, spread: bool) -> FileGoal:
    """The goal of a node of YAML. Raises UsageError."""
    if node.id != "mapping":
        raise UsageError(f"a goal is expected, such as {_EXAMPLE}")
    found: dict[str, Any] = {}
    for key, value in node.value:
        # A list or table counts as no text: that of nested aliases may have no end.
        name, text = (part.value if isinstance(part.value, str) else "" for part in (key, value))
        if name in found:
            raise UsageError(f"{name} is given twice")
        found[name] = _value(name, text)
    for name in _KEYS[1:3] if spread else _KEYS[:3]:
        if name not in found:
            hint = ", or name the robots that share the goals: --spread 0-3" if name == "robot" else ""
            raise UsageError(f"the key {name} is missing{hint}")
    return FileGoal(found.get("robot"), Pose2(found["x"], found["y"], found.get("yaw", 0.0)), _line(node))


def _value(name: str, text: str) -> float:
    if name not in _KEYS:
        raise UsageError(f"unknown key {name!r:.40}{did_you_mean(name, _KEYS)}; known: {', '.join(_KEYS)}")
    if name == "robot":
        return find_robot_id(text)
    value = parse_number(text, -FAR, FAR, f"{name} in {'radians' if name == 'yaw' else 'metres'}")
    if name == "yaw" and (problem := turn_problem(value)):
        raise UsageError(f"yaw: {problem}")
    return value


class Rounds:
    """The goals of a file: each robot's own in their order, and those that several robots share."""

    def __init__(self, goals: Sequence[FileGoal], spread: Sequence[int] = (), rounds: int | None = 1) -> None:
        """`spread` are the robots that share the goals without a robot; `rounds` None = for ever."""
        self.robots = sorted({*spread, *(goal.robot for goal in goals if goal.robot is not None)})
        """The robots that may get a goal."""
        shared = [goal for goal in goals if goal.robot is None]
        own = {i: [goal for goal in goals if goal.robot == i] for i in self.robots}
        self.counts = {i: len(own[i]) + (len(shared) if i in spread else 0) for i in self.robots}
        """The number of goals that each robot may get in one round."""
        turns = _rounds_of(shared, rounds)
        # A robot that has no goal of its own left takes those that it shares.
        self._next = {i: chain(_rounds_of(own[i], rounds), turns if i in spread else ()) for i in self.robots}

    def take(self, robot_id: int) -> FileGoal | None:
        """The next goal of this robot: its own first, then those that it shares; None if there is none."""
        return next(self._next[robot_id], None)

    def put_back(self, robot_id: int, goal: FileGoal) -> None:
        self._next[robot_id] = chain((goal,), self._next[robot_id])


def _rounds_of(goals: Sequence[FileGoal], rounds: int | None) -> Iterator[FileGoal]:
    """Goals in their order, again and again for so many rounds."""
    return chain.from_iterable(repeat(goals, rounds) if rounds is not None else repeat(goals) if goals else ())


class Ended(NamedTuple):
    robot: int
    goal: FileGoal
    watch: GoalWatch
    seconds: float
    """In the team's time."""


@dataclass
class Errand:
    """What one robot is about."""

    client: NavigationClient
    goal: FileGoal | None = None
    watch: GoalWatch | None = None
    sent: int = 0
    """When, in ns."""
    reached: int = 0
    failed: int = 0
    """Goals that were aborted or canceled."""
    failures: int = 0
    """Of them, those since the last goal that was reached."""
    is_paused: bool = False
    asked_pause: bool = False
    """Whether it is paused, or is to be with a tick of lock-step that comes."""
    """Whether the robot is to get no further goal for now."""
    is_over: bool = False
    """Whether there is no further goal for it."""


class Dispatcher:
    """Gives robots goals until there are no more, and tells of each that has ended.

    A goal of another sender goes before: its end is waited for, and then the goal that it replaced is sent again.
    All of it is done in `step`, so that a run in lock-step repeats.
    """

    def __init__(self, node: Node, rounds: Rounds) -> None:
        self._node, self._rounds = node, rounds
        self._ended: list[Ended] = []
        clients = [NavigationClient(node, i, node.clock.now, yields=True) for i in rounds.robots]
        self.errands = {client.robot_id: Errand(client) for client in clients}
        """By robot."""
        self.is_done = False
        """Whether there are no more goals."""
        # Without a simulator a base's data decides that time is the host's; what the robots say does not.
        self._odometry = node.subscribe(names.all_robots_key(names.ODOM), Odometry, lambda key, odom: None)
        self._told: set[int] = set()
        """The robots of which a status of their goals has come, whenever it counts."""
        self._is_first = False
        """Whether the first tick of lock-step is open."""
        node.bus.subscribe(names.all_robots_key(names.NAVIGATION_STATUS), NavigationStatus, self._on_told)
        for robot_id, errand in self.errands.items():
            self._serve_list(robot_id, errand)
        node.need(self._lacks)
        node.on_stop(self._cancel_all)

    def _serve_list(self, robot_id: int, errand: Errand) -> None:
        """Answer for the list of a robot. While it is paused, the robot gets no further goal of the list; the one that
        it has stays, unless it is canceled."""
        node = self._node
        node.bus.serve(names.robot_key(robot_id, names.GOALS), NoRequest, lambda _: ListReply(errand.asked_pause))
        for topic, paused in ((names.PAUSE_GOALS, True), (names.RESUME_GOALS, False)):
            check, change = partial(self._agree_to_pause, errand, paused), partial(self._pause, errand, paused)
            node.serve_change(names.robot_key(robot_id, topic), Change, check, change, after_step=True)

    def _agree_to_pause(self, errand: Errand, paused: bool, _request: Change) -> tuple[ListReply, bool]:
        errand.asked_pause = paused
        return ListReply(paused), True

    def _pause(self, errand: Errand, paused: bool, _request: Change) -> None:
        changed, errand.is_paused = paused != errand.is_paused, paused
        if changed:
            text = "no further goal until 'zteam goals --resume'" if paused else "the list goes on"
            log.info("%s: %s", errand.client.name, text)

    def _on_told(self, key: str, _status: NavigationStatus) -> None:
        target = names.split_robot_key(key)
        with self._node.changed:
            self._told.update(() if target is None else target[:1])

    def _lacks(self, tick: Tick) -> list[str]:
        """Keys of goals that nothing takes yet, in the first tick: chance must not decide when the first are sent."""
        self._is_first = tick.tick == 1
        if not self._is_first or all(names.navigated_robot_of(name) is None for name in tick.participants):
            return []
        return [
            names.robot_key(i, names.GOAL_POSE)
            for i, errand in self.errands.items()
            if not (errand.client.has_subscribers and (errand.client.taker or i in self._told))
        ]

    @property
    def all_reached(self) -> bool:
        return not any(errand.failed for errand in self.errands.values())

    def take_ended(self) -> list[Ended]:
        with self._node.changed:
            ended, self._ended = self._ended, []
            return ended

    def step(self, now: int) -> None:
        """Take what has ended, and send what comes next."""
        self._odometry.close()
        if self._is_first:
            # What a robot has said of itself until now came by chance.
            return
        for errand in self.errands.values():
            if errand.is_paused and errand.goal is not None and errand.client.withdraw():
                self._rounds.put_back(errand.client.robot_id, errand.goal)
                errand.goal = errand.watch = None
            errand.client.look()
            if errand.watch is not None and errand.watch.is_replaced:
                if not errand.is_paused:
                    errand.watch = errand.client.send(errand.watch.goal)
            elif errand.watch is not None and errand.watch.ended:
                self._end(errand, now)
            if errand.watch is None and not errand.is_paused:
                self._send_next(errand, now)
        if all(errand.is_over for errand in self.errands.values()):
            self.is_done = True
            self._node.stop.request("all goals have ended")

    def _end(self, errand: Errand, now: int) -> None:
        assert errand.goal is not None and errand.watch is not None
        watch, errand.watch = errand.watch, None
        if watch.result == TaskResult.SUCCEEDED:
            errand.reached, errand.failures = errand.reached + 1, 0
        else:
            # A goal that was canceled to pause the list is no reason to give the list up.
            is_users = errand.is_paused and watch.result == TaskResult.CANCELED
            errand.failed, errand.failures = errand.failed + 1, errand.failures + (not is_users)
        self._ended.append(Ended(errand.client.robot_id, errand.goal, watch, to_seconds(now - errand.sent)))

    def _send_next(self, errand: Errand, now: int) -> None:
        robot_id = errand.client.robot_id
        gives_up = errand.failures >= self._rounds.counts[robot_id] > 0
        if gives_up and errand.goal is not None:
            log.warning("%s: no more goals: it reached none of the last %d", errand.client.name, errand.failures)
        errand.goal = None if gives_up else self._rounds.take(robot_id)
        errand.is_over = errand.goal is None
        if errand.goal is not None:
            errand.sent = now
            errand.watch = errand.client.send(goal_message(errand.goal.pose))

    def _cancel_all(self) -> None:
        """The process ends before its goals have: the robots stop."""
        # In a team that ends, navigation may be gone before.
        under_way = [errand.client for errand in self.errands.values() if errand.watch is not None]
        threads = [client.cancel_later(logging.DEBUG) for client in under_way]
        end = monotonic() + _CANCEL_LIMIT
        for thread in threads:
            thread.join(max(0.0, end - monotonic()))
