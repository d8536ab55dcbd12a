"""The parameters of the robot's behaviour: those that hold, and the queries that tell and set them."""

import logging
from typing import Any

from zteam import names
from zteam.bus import NoRequest
from zteam.errors import UsageError
from zteam.node.process_node import ProcessNode
from zteam.robot.behaviors import Behavior
from zteam.robot.behaviors.registry import parameters_of, read_params, values_of
from zteam.robot.client import DESCRIBE, SET, DescribeReply, SetReply, SetRequest

log = logging.getLogger("zteam")


class BehaviorParameters:
    """Holds what the behaviour was given. The driver takes it at the beginning of a step, so no step sees it change."""

    def __init__(self, node: ProcessNode, kind: type[Behavior], name: str, given: dict[str, Any]) -> None:
        """`name` is that of the behaviour, as `--behavior` takes it; `given` are its parameters at the start."""
        self._node, self._kind, self._name = node, kind, name
        self.given = given
        """The parameters that were given at the start or set since, by name: never changed, only replaced (under
        `node.changed`). They outlast a jump back in time."""
        node.bus.serve(names.service_key(node.name, DESCRIBE), NoRequest, lambda _: self._describe())
        node.bus.serve(names.service_key(node.name, SET), SetRequest, self._set)

    def read(self, given: dict[str, Any]) -> Any:
        """These parameters as the behaviour's `Params`, for the behaviour alone. Raises UsageError."""
        return read_params(self._name, self._kind, given, names.robot_id_of(self._node.name))

    def make_behavior(self, given: dict[str, Any]) -> Behavior:
        """A new behaviour with these parameters."""
        return self._kind(self.read(given))

    def _describe(self) -> DescribeReply:
        return DescribeReply(self._name, parameters_of(self._kind.Params), values_of(self.read(self.given)))

    def _set(self, request: SetRequest) -> SetReply:
        with self._node.changed:
            before = values_of(self.read(self.given))
            given = {**self.given, **request.parameters}
            try:
                values = values_of(self.read(given))
                unknown = [name for name in request.parameters if name not in values]
                if unknown:
                    # `Params` lacks it and does not forbid it: at the start it is ignored.
                    takes = ", ".join(values) or "no parameters"
                    raise UsageError(f"behaviour {self._name}: {unknown[0]}: unknown key; {self._name} takes {takes}")
            except UsageError as error:
                return SetReply(before, refused=str(error))
            self.given = given
        for name in request.parameters:
            log.info("parameter %s is %r, was %r", name, values[name], before[name])
        return SetReply(values)
