"""What other processes ask of a robot: its parameters, to give its goal up, to stop; and of the launcher, to start one.
How they tell goals apart. The queries of a robot have the names of ROS's, but for the stop.

The query that gives a goal up is that of whatever takes a robot's goals: its navigation, or the behaviour go_to. What
sends a robot the goals of a list (`zteam goals`) answers the queries of the list.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Annotated, Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.clock import HOST_FACTOR, monotonic, pause, to_ns
from zteam.errors import BusError, QueryError, QueryTimeoutError, UsageError, ZteamError
from zteam.messages import NavigationState, PoseStamped
from zteam.monitor.observer import TeamObserver
from zteam.node.stopping import EngageRequest, ReleaseRequest, StopReply, ask_stopped
from zteam.robot.parameters import Parameter
from zteam.simulator.client import SimStatus, find_status

DESCRIBE = "describe_parameters"
SET = "set_parameters"
CANCEL = "cancel"
SAFETY = "safety"
CANCEL_LIMIT = 2.0
"""Host seconds for the answer to a request to cancel."""
ON_THE_WAY = frozenset({NavigationState.PLANNING, NavigationState.DRIVING, NavigationState.RECOVERING})
"""States of a goal that lasts."""
SETTLED = to_ns(1.0)
"""After this time (ns) a status is about a new goal for certain."""
GONE = 3.0
"""Host seconds for which what took a goal may be away: a router that ends takes all presence tokens along."""


START_LIMIT = 10.0
"""Host seconds for the launcher's answer; it makes a certificate first where the team has them."""


class StartRequest(Change):
    """`up/start`: start the process of a robot, with a behaviour that zteam knows and that needs no parameters."""

    robot: Annotated[int, msgspec.Meta(ge=0, le=names.MAX_ROBOT_ID)]
    behavior: str = ""
    """Empty: as the launcher started it before."""
    ends: bool = False
    """End it instead."""


def start_robot(bus: Bus, robot_id: int, behavior: str = "", *, ends: bool = False) -> None:
    """Ask the launcher to start a robot's process, which reports in its status and its log, or to end it. Raises
    BusError."""
    key = names.service_key(names.LAUNCHER, names.START)
    bus.ask(key, str, StartRequest(robot=robot_id, behavior=behavior, ends=ends), timeout=START_LIMIT)


class DescribeReply(msgspec.Struct):
    """The parameters of a robot's behaviour, and their values."""

    behavior: str
    """Its name, as `--behavior` takes it."""
    parameters: list[Parameter]
    values: dict[str, Any]
    """By name. A number that JSON lacks, such as infinity, is null."""


class SetRequest(Change, kw_only=True):
    """Give these parameters these values: all of them, or none if one is refused."""

    parameters: dict[str, Any]


class SetReply(msgspec.Struct):
    """The values of all parameters from the next step on."""

    values: dict[str, Any]
    refused: str = ""
    """Why nothing was set; empty if it was."""


class SafetyReply(msgspec.Struct):
    """Answer to `robot_N/safety`."""

    stops: int
    """How often the safety layer has begun to stop or to slow the robot since its process started, or since time jumped
    back."""


T = TypeVar("T")

ANSWER_LIMIT = 10.0
"""Host seconds for an answer, which waits for the step at hand in lock-step."""


class ParametersClient:
    """Reads and sets the parameters of the behaviours that run."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def describe(self, robot: str) -> DescribeReply:
        """The parameters of `robot_N` and their values. Raises BusError if there is no such robot."""
        return self._query(robot, DESCRIBE, DescribeReply)[robot]

    def describe_all(self) -> dict[str, DescribeReply]:
        """The parameters of all robots that answer, by name. Raises BusError if robots are there and none answers."""
        return self._query("*", DESCRIBE, DescribeReply)

    def set(self, robot: str, parameters: dict[str, Any]) -> dict[str, Any]:
        """Set all of these parameters of `robot_N` from its next step on; returns the values of all its parameters.

        Raises UsageError if one of them is refused: then none is set. Raises BusError if there is no such robot.
        """
        reply = self._query(robot, SET, SetReply, SetRequest(parameters=parameters))[robot]
        if reply.refused:
            raise UsageError(f"{robot}: {reply.refused}")
        return reply.values

    def _query(
        self, robot: str, service: str, reply_type: type[T], request: msgspec.Struct | None = None
    ) -> dict[str, T]:
        """The answers by robot: of one, or of all that there are."""
        asked = "all robots" if robot == "*" else robot
        try:
            answers = self._bus.query(names.service_key(robot, service), reply_type, request, timeout=ANSWER_LIMIT)
        except QueryTimeoutError:
            raise BusError(f"{asked}: no answer within {ANSWER_LIMIT:g} s: see 'zteam doctor'") from None
        except QueryError as error:
            raise BusError(f"{asked}: {error.why}") from None
        if not answers and robot != "*":
            raise BusError(f"no process {robot} with parameters: 'zteam param list' shows those that there are")
        return {key.removesuffix(f"/{service}"): reply for key, reply in answers}


def navigation_query(robot_id: int, service: str) -> str:
    """Key of a query of the navigation of robot `robot_id`; `info` tells which process it is."""
    return names.service_key(names.robot_key(robot_id, names.NAVIGATION), service)


def is_same_goal(one: PoseStamped, other: PoseStamped) -> bool:
    """Whether two messages are of one goal. Navigation may have resolved the frame of one."""
    return one.header.stamp == other.header.stamp and one.pose == other.pose


class CancelRequest(Change):
    """Give up the goal: the robot stops."""


class CancelReply(msgspec.Struct):
    """What became of the request. It counts from the next step on; the status then says `canceled`."""

    canceled: bool
    """Whether there was a goal to give up."""


class ListReply(msgspec.Struct):
    """The list of one robot."""

    is_paused: bool


_LIST_LIMIT = 1.0
"""Host seconds for an answer about a list, at which no step is waited for."""


def find_lists(bus: Bus) -> dict[int, bool]:
    """By robot that drives through a list: whether it is paused, and so for one of several."""
    found: dict[int, bool] = {}
    for key, reply in bus.find(names.all_robots_key(names.GOALS), ListReply, timeout=_LIST_LIMIT):
        if target := names.split_robot_key(key):
            found[target[0]] = found.get(target[0], False) or reply.is_paused
    return found


def pause_lists(bus: Bus, robots: Iterable[int] | None = None, *, paused: bool) -> list[int]:
    """Pause the lists of these robots or of all, or go on with them; those that have answered. Raises BusError."""
    lists: Collection[int] = find_lists(bus)
    service = names.PAUSE_GOALS if paused else names.RESUME_GOALS
    done = []
    for robot_id in sorted(lists if robots is None else set(robots) & set(lists)):
        if bus.query(names.robot_key(robot_id, service), ListReply, Change(), timeout=_LIST_LIMIT):
            done.append(robot_id)
    return done


CONFIRM_LIMIT = 1.0 * HOST_FACTOR
"""Host seconds for the processes that stop a robot to confirm it."""
SETTLE = 0.3
"""Host seconds for the presence tokens of all processes to come: one that hangs shows by nothing else."""
_ASKED_AT_ONCE = 32
"""Robots."""


class StopResult(msgspec.Struct):
    """What became of a request to stop or to release one robot."""

    robot: int
    is_stopped: bool
    """What was asked for."""
    confirmed: list[str]
    """The processes that have confirmed it: what commands the robot, and the simulator, which holds its body."""
    missing: list[str]
    """Those that are there and have not confirmed it within CONFIRM_LIMIT."""
    problem: str = ""
    """What else is wrong."""

    @property
    def is_done(self) -> bool:
        """Whether all processes that stop the robot have confirmed it."""
        return bool(self.confirmed) and not (self.missing or self.problem)

    def __str__(self) -> str:
        name, done = names.robot_name(self.robot), "stopped" if self.is_stopped else "released"
        if self.is_done:
            return f"{name}: {done}, confirmed by {', '.join(self.confirmed)}"
        parts = [f"confirmed by {', '.join(self.confirmed)}"] if self.confirmed else []
        if self.missing:
            parts.append(f"not confirmed by {', '.join(self.missing)} within {CONFIRM_LIMIT:g} s")
        return f"{name}: {'; '.join(filter(None, (*parts, self.problem)))}"


def need_done(results: Sequence[StopResult], error: type[ZteamError] = ZteamError) -> None:
    """Raise an error that names the processes that have not confirmed it."""
    failed = [str(result) for result in results if not result.is_done]
    if failed or not results:
        raise error("; ".join(failed) or "no robot is there")


class StopClient:
    """Stops and releases robots: those that are given, or all that are there."""

    def __init__(self, bus: Bus, alive: Callable[[], Iterable[str]] | None = None) -> None:
        """`alive()` are the names of the processes that are there, for callers that know them."""
        self._bus, self._alive = bus, alive or TeamObserver(bus).process_names
        self._settled = 0.0 if alive else monotonic() + SETTLE

    def engage(self, robots: Collection[int] | None = None) -> list[StopResult]:
        """Stop robots; for each, which processes have confirmed it. One query asks all: none has to be found first."""
        keys = [EngageRequest.wildcard] if robots is None else [names.robot_key(i, names.ENGAGE) for i in robots]
        return self._ask(robots, keys, EngageRequest(), stopped=True)

    def release(self, robots: Collection[int] | None = None) -> list[StopResult]:
        """Release robots; for each, which processes have confirmed it."""
        # Access control goes by keys: a wildcard would pass it.
        found = {robot_id for robot_id, _ in ask_stopped(self._bus, names.ALL_ROBOTS)} if robots is None else robots
        keys = [names.robot_key(robot_id, names.RELEASE) for robot_id in found]
        return self._ask(robots, keys, ReleaseRequest(), stopped=False)

    def _ask(
        self, robots: Collection[int] | None, keys: Sequence[str], request: Change, *, stopped: bool
    ) -> list[StopResult]:
        with ThreadPoolExecutor(_ASKED_AT_ONCE, "stop") as pool:
            asked = pool.map(partial(self._query, request), keys)
            status = pool.submit(find_status, self._bus, CONFIRM_LIMIT)
            answers, world = dict(zip(keys, asked, strict=True)), status.result()
        pause(max(0.0, self._settled - monotonic()))
        expected, confirmed = _expected(set(self._alive()), world), defaultdict[int, set[str]](set)
        for replies, _ in answers.values():
            for key, reply in replies:
                if target := names.split_robot_key(key):
                    expected[target[0]].add(reply.by)
                    if reply.is_stopped == stopped:
                        confirmed[target[0]].add(reply.by)
        results = []
        for robot_id in sorted(expected if robots is None else robots):
            lacking, done, problem = expected[robot_id] - confirmed[robot_id], sorted(confirmed[robot_id]), ""
            if not done:
                own = {EngageRequest.wildcard, *(names.robot_key(robot_id, s) for s in (names.ENGAGE, names.RELEASE))}
                problem = next((why for key, (_, why) in answers.items() if key in own and why), "")
            if not expected[robot_id] and not problem:
                problem = "nothing holds it: it has no process, and no simulator has its body"
            results.append(StopResult(robot_id, stopped, done, sorted(lacking), problem))
        return results

    def _query(self, request: Change, key: str) -> tuple[list[tuple[str, StopReply]], str]:
        """The answers with their keys, and why there are none."""
        try:
            return self._bus.query(key, StopReply, request, timeout=CONFIRM_LIMIT), ""
        except QueryTimeoutError:
            return [], ""
        except BusError as error:
            return [], error.why if isinstance(error, QueryError) else str(error)


def _expected(alive: Collection[str], world: SimStatus | None) -> defaultdict[int, set[str]]:
    """By robot, the processes that have to confirm: those that hold its name, and the simulator for robots in its
    world. A base without a process has none."""
    found = defaultdict[int, set[str]](set)
    for name in alive:
        robot_id, base_id = names.robot_id_of(name), names.base_robot_of(name)
        if robot_id is not None:
            found[robot_id].add(name)
        elif base_id is not None:
            found[base_id].update()
    # A simulator that does not answer may have the body of each.
    held = world.robots if world is not None else [*found] if names.SIMULATOR in alive else []
    for robot_id in held:
        found[robot_id].add(names.SIMULATOR)
    return found
