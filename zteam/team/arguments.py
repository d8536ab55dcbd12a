"""What a program may give to `zteam.run_team` and to the `team` fixture: anything else is refused in one line."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import BusOptions
from zteam.config.numbers import RobotId, Seconds
from zteam.config.problems import plain
from zteam.errors import UsageError

F = TypeVar("F", bound=Callable[..., Any])
ARGUMENTS: dict[str, tuple[Any, str]] = {
    "bus": (BusOptions, "BusOptions, such as BusOptions.from_environment()"),
    "chaos in_process lockstep": (bool, "True or False"),
    "expect processes": (list[str], "the names of processes, as a list"),
    "follow": (dict[int, int | str], "a dict by robot, as {1: 0}, where robot 1 follows robot 0"),
    "launch.arguments nodes run_team.arguments": (dict[str, Any], "a dict by name"),
    "lockstep_timeout": (Annotated[float, msgspec.Meta(ge=1e-3, le=3600.0)], "host seconds from 0.001 to 3600"),
    "map_resolution": (Annotated[float, msgspec.Meta(ge=1e-4, le=1e4)], "metres a cell from 0.0001 to 10000"),
    "name": (str, "the name of a process"),
    "params": (dict[int, dict[str, Any]], 'a dict by robot, as {0: {"speed": 0.2}}'),
    "robot_id": (RobotId, f"a robot id from 0 to {names.MAX_ROBOT_ID}"),
    "robots": (list[int], "a list of robot ids"),
    "run_team.chaos secure world": (str, "a path or a name"),
    "seconds timeout within": (Seconds, "seconds from 0 to 1e9"),
    "seed": (Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)], "a whole number of at most 64 bits"),
    "start.robots": (int | str | list[int], 'a number of robots, a list of ids, or ids as text such as "0,2-4"'),
    "team text": (str, "a text"),
    "tick until": (Annotated[int, msgspec.Meta(ge=0, le=10**12)], "a tick, a whole number from 0"),
}
"""By names of arguments, `call.name` where a call differs: the type, and what is asked for. Defaults are right, too."""
_ROWS = {name: row for words, row in ARGUMENTS.items() for name in words.split()}


def checks_arguments(place: str) -> Callable[[F], F]:
    """Let a function, or the methods of a class, refuse wrong arguments by a UsageError that begins with `place`. They
    get values of Python's own types, also where numpy's are given."""

    def decorate(checked: F) -> F:
        if inspect.isclass(checked):
            for name, method in list(vars(checked).items()):
                if inspect.isfunction(method) and not name.startswith("_"):
                    setattr(checked, name, decorate(method))
            return checked
        call, signature = checked.__name__, inspect.signature(checked)

        @functools.wraps(checked)
        def check(*args: Any, **kwargs: Any) -> Any:
            # In a test that fails pytest shows the lines of the test.
            __tracebackhide__ = True
            given = signature.bind(*args, **kwargs)
            for name, value in given.arguments.items():
                kind, wanted = _ROWS.get(f"{call}.{name}") or _ROWS.get(name) or (Any, "")
                if wanted and value is not signature.parameters[name].default:
                    try:
                        given.arguments[name] = msgspec.convert(plain(value), kind)
                    except msgspec.ValidationError:
                        raise UsageError(f"{place}{call}: {name} is {value!r:.60}: give {wanted}") from None
            return checked(*given.args, **given.kwargs)

        return check  # type: ignore[return-value]

    return decorate
