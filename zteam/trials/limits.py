"""Values at the bounds of a behaviour's parameters."""

from collections.abc import Iterator
from typing import Any

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.parameters import Parameter, parameters_of
from zteam.errors import UsageError
from zteam.trials.situations import LEADER

_INSIDE = 1e-3
"""How far inside a bound that does not belong to the allowed values, relative to 1 or to the bound."""
_SIGNS = {"ge": 0.0, "gt": 1.0, "le": 0.0, "lt": -1.0}


def bounds(kind: type[Behavior]) -> Iterator[tuple[str, Any]]:
    """(parameter, value) for each bound that a number has, and both values of a switch."""
    for parameter in parameters_of(kind.Params):
        for value in _extremes(parameter):
            yield parameter.name, value


def _extremes(parameter: Parameter) -> list[Any]:
    if parameter.type == "bool":
        return [False, True]
    return [
        _inside(bound, _SIGNS[limit], parameter.type == "int")
        for limit, bound in parameter.limits.items()
        if limit in _SIGNS
    ]


def _inside(bound: float, sign: float, is_whole: bool) -> float:
    return int(bound + sign) if is_whole else bound + sign * _INSIDE * max(1.0, abs(bound))


def given_params(spec: str, kind: type[Behavior], params: dict[str, Any]) -> dict[str, Any]:
    """`params`, and the leader if the behaviour needs one. Raises UsageError where another one is missing."""
    needed = [p.name for p in parameters_of(kind.Params) if p.required and p.name not in params]
    given = {"leader": LEADER, **params} if "leader" in needed else dict(params)
    missing = [name for name in needed if name not in given]
    if missing:
        raise UsageError(f"behaviour {spec} needs {', '.join(missing)}: give --param {missing[0]}=VALUE")
    return given
