"""What other processes ask of a robot: its parameters, and to give its goal up; and how they tell goals apart. The
queries have the names of ROS's.

The query that gives a goal up is that of whatever takes a robot's goals: its navigation, or the behaviour go_to.
"""

from typing import Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.clock import to_ns
from zteam.errors import BusError, UsageError
from zteam.messages import NavigationState, PoseStamped
from zteam.robot.behaviors.registry import Parameter

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
_TIMED_OUT = "Timeout"
"""Zenoh's own word."""
_ALL = "*"


class ParametersClient:
    """Reads and sets the parameters of the behaviours that run."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def describe(self, robot: str) -> DescribeReply:
        """The parameters of `robot_N` and their values. Raises BusError if there is no such robot."""
        return self._ask(robot, DESCRIBE, DescribeReply)

    def describe_all(self) -> dict[str, DescribeReply]:
        """The parameters of all robots that answer, by name. Raises BusError if robots are there and none answers."""
        answers = self._query(_ALL, DESCRIBE, DescribeReply)
        return {key.removesuffix(f"/{DESCRIBE}"): reply for key, reply in answers}

    def set(self, robot: str, parameters: dict[str, Any]) -> dict[str, Any]:
        """Set all of these parameters of `robot_N` from its next step on; returns the values of all its parameters.

        Raises UsageError if one of them is refused: then none is set. Raises BusError if there is no such robot.
        """
        reply = self._ask(robot, SET, SetReply, SetRequest(parameters=parameters))
        if reply.refused:
            raise UsageError(f"{robot}: {reply.refused}")
        return reply.values

    def _ask(self, robot: str, service: str, reply_type: type[T], request: msgspec.Struct | None = None) -> T:
        answers = self._query(robot, service, reply_type, request)
        if not answers:
            raise self._missing(robot)
        return answers[0][1]

    def _query(
        self, robot: str, service: str, reply_type: type[T], request: msgspec.Struct | None = None
    ) -> list[tuple[str, T]]:
        key = names.service_key(robot, service)
        try:
            return self._bus.query(key, reply_type, request, timeout=ANSWER_LIMIT)
        except BusError as error:
            why = str(error).removeprefix(f"{key}: ")
            if why == _TIMED_OUT:
                silent = "no robot answers" if robot == _ALL else f"{robot}: does not answer"
                raise BusError(f"{silent} within {ANSWER_LIMIT:g} s: see 'zteam doctor'") from None
            raise BusError(why if robot == _ALL else f"{robot}: {why}") from None

    def _missing(self, robot: str) -> BusError:
        try:
            known = sorted(self.describe_all(), key=lambda name: names.robot_id_of(name) or 0)
        except BusError as error:
            return BusError(f"no process {robot} with parameters; {error}")
        if not known:
            return BusError(f"no process {robot}, and no other robot is there: start a team with 'zteam up'")
        return BusError(f"no process {robot} with parameters; there is {', '.join(known)}")


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
