"""What a program may give to `zteam.run_team` and to the `team` fixture: anything else is refused in one line."""

import functools
import inspect
import os
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from typing import Annotated, Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import BusOptions
from zteam.config.numbers import MAX_SECONDS
from zteam.config.option import SEEDS
from zteam.errors import UsageError

F = TypeVar("F", bound=Callable[..., Any])


def _number(low: float, high: float, what: str) -> tuple[Any, str]:
    kind = ", a whole number" if isinstance(low, int) else ""
    return Annotated[type(low), msgspec.Meta(ge=low, le=high)], f"{what}{kind} from {low:g} to {high:g}"


_NAME = str, "the name of a process"
_SWITCH = bool, "True or False"
_WITHIN = _number(0.0, MAX_SECONDS, "seconds")
ARGUMENTS: dict[str, tuple[Any, str]] = {
    "bus": (BusOptions, "BusOptions, such as BusOptions.from_environment()"),
    "chaos": _SWITCH,
    "expect": (list[str], "a list of the names of nodes"),
    "follow": (dict[int, int | str], "a dict by robot, as {1: 0}, where robot 1 follows robot 0"),
    "in_process": _SWITCH,
    "launch.arguments": (dict[str, Any], "a dict by name"),
    "lockstep": _SWITCH,
    "lockstep_timeout": _number(1e-3, 3600.0, "host seconds"),
    "map_resolution": _number(1e-4, 1e4, "metres a cell"),
    "name": _NAME,
    "nodes": (dict[str, Any], "a dict by name, as {'planner': 'my_nodes:planner'}"),
    "params": (dict[int, dict[str, Any]], 'a dict by robot, as {0: {"speed": 0.2}}'),
    "processes": (list[str], "the names of processes"),
    "robot_id": _number(0, names.MAX_ROBOT_ID, "a robot id"),
    "robots": (list[int], "a list of robot ids"),
    "run_team.arguments": (dict[str, Any], "a dict by name"),
    "run_team.chaos": (str, "the file of a plan of faults"),
    "run_team.nodes": (dict[str, Callable[..., Any]], "a dict by name of functions 'def main(node): …'"),
    "secure": (str, "a folder for certificates"),
    "seconds": _WITHIN,
    "seed": _number(*SEEDS),
    "start.robots": (int | str | list[int], 'a number of robots, a list of ids, or ids as text such as "0,2-4"'),
    "team": (str, "a team file, or the name of a shipped one"),
    "text": (str, "a text"),
    "tick": _number(0, 10**12, "a tick"),
    "timeout": _WITHIN,
    "until": _number(2, 10**12, "a tick"),
    "within": _WITHIN,
    "world": (str, "a world file, or the name of a shipped one"),
}
"""By name of an argument, or `call.name` where a call differs: its type, and what is asked for. A default may be given,
too."""


def checks_arguments(place: str) -> Callable[[F], F]:
    """Let a function, or each method of a class that users call, check its arguments; `place` begins their errors. What
    they get are values of Python's own types, also where numpy's are given. They raise UsageError."""

    def decorate(checked: F) -> F:
        if not inspect.isclass(checked):
            return _checking(checked, place)
        for name, method in list(vars(checked).items()):
            if inspect.isfunction(method) and not name.startswith("_"):
                setattr(checked, name, _checking(method, place))
        return checked

    return decorate


def _checking(function: F, place: str) -> F:
    call, signature = function.__name__, inspect.signature(function)
    rows = {name: ARGUMENTS.get(f"{call}.{name}", ARGUMENTS.get(name)) for name in signature.parameters}
    kinds = {name: row for name, row in rows.items() if row}

    @functools.wraps(function)
    def check(*args: Any, **kwargs: Any) -> Any:
        try:
            given = signature.bind(*args, **kwargs)
        except TypeError:
            # Python's own words name the function.
            return function(*args, **kwargs)
        for name, (kind, wanted) in kinds.items():
            value = given.arguments.get(name, default := signature.parameters[name].default)
            if value is not default:
                try:
                    given.arguments[name] = msgspec.convert(_plain(value), kind)
                except msgspec.ValidationError:
                    raise UsageError(f"{place}{call}: {name} is {value!r:.60}: give {wanted}") from None
        return function(*given.args, **given.kwargs)

    return check if kinds else function  # type: ignore[return-value]


def _plain(value: Any) -> Any:
    """The value as msgspec reads it: it knows no numbers of numpy, no ranges and no paths."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Real) and not isinstance(value, bool):
        return int(value) if isinstance(value, Integral) else float(value)
    if isinstance(value, Mapping):
        return {_plain(key): _plain(inner) for key, inner in value.items()}
    is_list = isinstance(value, Iterable) and not isinstance(value, str | bytes | type)
    return [_plain(inner) for inner in value] if is_list else value
