"""The parameters of robots as calls, for `zteam param` and users' programs."""

from typing import Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.errors import BusError, UsageError
from zteam.services.parameters import DESCRIBE, SET, DescribeReply, SetReply, SetRequest

T = TypeVar("T")

ANSWER_LIMIT = 10.0
"""Host seconds for an answer, which waits for the step at hand in lock-step."""
_TIMED_OUT = "Timeout"
"""Zenoh's own word."""


class ParametersClient:
    """Reads and sets the parameters of the behaviours that run."""

    def __init__(self, bus: Bus, answer_limit: float = ANSWER_LIMIT) -> None:
        """`answer_limit` is host seconds."""
        self._bus = bus
        self._limit = answer_limit

    def describe(self, robot: str) -> DescribeReply:
        """The parameters of `robot_N` and their values. Raises BusError if there is no such robot."""
        return self._ask(robot, DESCRIBE, DescribeReply)

    def describe_all(self) -> dict[str, DescribeReply]:
        """The parameters of all robots, by name."""
        answers = self._bus.query(names.service_key("*", DESCRIBE), DescribeReply, timeout=self._limit)
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
        key = names.service_key(robot, service)
        try:
            answers = self._bus.query(key, reply_type, request, timeout=self._limit)
        except BusError as error:
            why = str(error).removeprefix(f"{key}: ")
            if why == _TIMED_OUT:
                why = f"does not answer within {self._limit:g} s: see 'zteam doctor'"
            raise BusError(f"{robot}: {why}") from None
        if not answers:
            raise self._missing(robot)
        return answers[0][1]

    def _missing(self, robot: str) -> BusError:
        known = sorted(self.describe_all(), key=lambda name: names.robot_id_of(name) or 0)
        if not known:
            return BusError(f"no process {robot}, and no other robot is there: start a team with 'zteam up'")
        return BusError(f"no process {robot} with parameters; there is {', '.join(known)}")
