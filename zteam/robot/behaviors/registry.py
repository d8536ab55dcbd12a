"""Behaviours by name: the shipped ones, those of installed packages, and the user's own (`package.module:Class`)."""

import importlib
import inspect
import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeGuard

import msgspec

from zteam.clock import wall_ns
from zteam.config.entry_points import BEHAVIORS as GROUP
from zteam.config.entry_points import load_offered, offered
from zteam.config.problems import problems_of
from zteam.errors import UsageError, check_call, did_you_mean
from zteam.robot.behaviors.behavior import Behavior, check_inputs
from zteam.robot.behaviors.follow import Follow
from zteam.robot.behaviors.formation import Formation
from zteam.robot.behaviors.go_to import GoTo
from zteam.robot.behaviors.path import FollowPath
from zteam.robot.behaviors.wander import Avoid, Forward, Idle, Wander
from zteam.robot.parameters import Parameter, parameters_of

_ZTEAM = str(Path(__file__).parents[2])
_OF_ROS = ("rospy", "rclpy", "tf", "tf2_ros", "geometry_msgs", "sensor_msgs", "nav_msgs", "std_msgs")
"""Modules of ROS that users import out of habit."""


def explain(error: BaseException) -> str:
    """`file:line: Type: text (way out)` of an error that importing a user's module raised; the line is the user's."""
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if is_own(frame.filename)]
    # The text of a SyntaxError names the line.
    place = f"{own[-1].filename}:{own[-1].lineno}: " if own and not isinstance(error, SyntaxError) else ""
    return f"{place}{error_text(error)}{_way_out(error)}"


def error_text(error: BaseException) -> str:
    """The type of an error and what it says, on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


def is_own(filename: str) -> bool:
    """Whether a file of code is the user's own, and neither zteam's, Python's nor an installed package's."""
    return not filename.startswith(("<frozen", _ZTEAM, sys.prefix, sys.base_prefix))


def _way_out(error: BaseException) -> str:
    if not isinstance(error, ImportError) or error.name is None:
        return ""
    if error.name.partition(".")[0] in _OF_ROS:
        return " (zteam works without ROS: its message types are in zteam.messages, transforms in zteam.tf)"
    if isinstance(error, ModuleNotFoundError):
        return " (is it beside the team file, in the current folder or on PYTHONPATH?)"
    return " (docs/api.md has its names; message types are in zteam.messages)" if error.name == "zteam" else ""


BEHAVIORS: dict[str, type[Behavior]] = {
    "idle": Idle,
    "forward": Forward,
    "avoid": Avoid,
    "wander": Wander,
    "follow": Follow,
    "path": FollowPath,
    "go_to": GoTo,
    "formation": Formation,
}
_STEP = "def step(self, view): return Twist(Vector3(0.2))"


def load_behavior(spec: str, params: dict[str, Any], robot_id: int | None = None) -> Behavior:
    """The behaviour called `spec` with its parameters checked.

    `spec` is a shipped name, an entry point `zteam.behaviors` of an installed package, or `package.module:Class`. With
    `robot_id`, a robot that would follow itself is refused. Raises UsageError.
    """
    kind = find_behavior(spec)
    return kind(read_params(spec, kind, params, robot_id))


def read_params(spec: str, kind: type[Behavior], params: dict[str, Any], robot_id: int | None = None) -> Any:
    """The parameters of the behaviour `spec` as its `Params`. Raises UsageError that names every mistake."""
    problems = problems_of(params, kind.Params, takes=f"{spec} takes")
    if problems:
        raise UsageError(f"behaviour {spec}: {'; '.join(map(str, problems))}")
    read = msgspec.convert(params, kind.Params)
    if robot_id is not None and getattr(read, "leader", None) == robot_id:
        raise UsageError(f"behaviour {spec}: robot {robot_id} cannot follow itself; name another robot")
    return read


def look_in(folders: Iterable[str | Path]) -> None:
    """Look for the user's modules in these folders too ("" is the current one), after all that is installed."""
    for folder in map(str, folders):
        if folder not in sys.path:
            sys.path.append(folder)


_looked = wall_ns()
_loaded: set[str] = set()
"""Modules that a user has named for a run, and those that came with them."""


def read_anew() -> None:
    """Forget the user's loaded modules if one was edited since the last call, so that the next import reads the files
    again. A notebook is one process for many runs."""
    global _looked
    before, _looked = _looked, wall_ns()
    files = {name: getattr(sys.modules.get(name), "__file__", None) for name in _loaded - {"__main__"}}
    own = {name: Path(file) for name, file in files.items() if file and is_own(file)}
    if any(file.is_file() and file.stat().st_mtime_ns > before for file in own.values()):
        for name in own:
            sys.modules.pop(name, None)


def find_behavior(spec: str) -> type[Behavior]:
    """The class called `spec`. Imports its module. Raises UsageError."""
    if spec in BEHAVIORS:
        return BEHAVIORS[spec]
    module, colon, name = spec.partition(":")
    if module.endswith(".py"):
        file, folder = Path(module), Path(module).parent
        is_package = (folder / "__init__.py").is_file() and not folder.is_absolute()
        meant = ".".join([*(folder.parts if is_package else ()), file.stem])
        path = "" if is_package or folder == Path() else f", with the folder on the path (--path {folder})"
        raise UsageError(f"no behaviour {spec!r} (did you mean {meant}:{name or 'CLASS'}{path}?)")
    if colon and name.isidentifier() and all(part.isidentifier() for part in module.split(".")):
        return _checked(spec, load_named(f"behaviour {spec!r}", module, name, _is_behavior))
    found = load_offered(GROUP, spec)
    if found is not None:
        return _checked(spec, found)
    known = behavior_names()
    meant = did_you_mean(spec, known)
    raise UsageError(f"no behaviour {spec!r}{meant}: use {', '.join(known)} or package.module:Class")


def load_named(what: str, module: str, name: str, offers: Callable[[Any], bool] = callable) -> Any:
    """What the user's `module` calls `name`, for `what`. Raises UsageError with the names of what it `offers` there."""
    before = {*sys.modules}
    try:
        imported = importlib.import_module(module)
    except (Exception, SystemExit) as error:
        # Importing runs the user's own code, which may raise anything. One line is enough to mend it.
        raise UsageError(f"{what}: cannot import {module}: {explain(error)}") from error
    _loaded.update({*sys.modules} - before, {module})
    found = getattr(imported, name, None)
    if found is None:
        place = getattr(imported, "__file__", None) or "built in"
        known = [key for key, value in vars(imported).items() if offers(value)]
        own = [key for key in known if str(getattr(vars(imported)[key], "__module__", "")).startswith(module)]
        way_out = did_you_mean(name, own) or (f"; it has {', '.join(own)}" if own else "")
        if module == "__main__":
            way_out = "; what a notebook or a script defines is in its own process alone: write it into a file"
        files = (Path(folder, f"{module}.py") for folder in sys.path)
        hidden = next((file for file in files if is_own(str(file)) and file.is_file()), None)
        if hidden is not None and not is_own(str(place)):
            way_out = f"; it hides your {hidden}: give that file another name"
        raise UsageError(f"{what}: module {module} ({place}) has no {name}{way_out}")
    return found


def _is_behavior(found: Any) -> TypeGuard[type[Behavior]]:
    return inspect.isclass(found) and issubclass(found, Behavior)


def _checked(spec: str, found: Any) -> type[Behavior]:
    """`found` itself, if it is a behaviour with a type for its parameters. Raises UsageError."""
    if not _is_behavior(found):
        raise UsageError(f"behaviour {spec!r} is not a subclass of zteam.behaviors.Behavior")
    params = getattr(found, "Params", None)
    if not (inspect.isclass(params) and issubclass(params, msgspec.Struct)):
        raise UsageError(f"behaviour {spec!r}: give it a class Params(msgspec.Struct, forbid_unknown_fields=True)")
    check_inputs(f"behaviour {spec!r}: inputs", found.inputs)
    if found.step is Behavior.step:
        raise UsageError(f"behaviour {spec!r} has no step: {_STEP}")
    text = "its __init__ must take the parameters: def __init__(self, params): super().__init__(params)"
    check_call(found, 1, f"behaviour {spec!r}: {text}")
    check_call(found.step, 2, f"behaviour {spec!r}: its step must take the view: {_STEP}")
    return found


class BehaviorInfo(msgspec.Struct):
    """One behaviour."""

    name: str
    """As `--behavior` takes it."""
    source: str
    """Its class, as `package.module:Class`."""
    summary: str
    """The first paragraph of the docstring of its class, on one line."""
    parameters: list[Parameter]


def behavior_names() -> list[str]:
    """The behaviours that come with zteam, then those of installed packages."""
    return [*BEHAVIORS, *(name for name in offered(GROUP) if name not in BEHAVIORS)]


def describe_behavior(spec: str) -> BehaviorInfo:
    """The behaviour called `spec`. Imports its module. Raises UsageError."""
    kind = find_behavior(spec)
    # Its own docstring: that of the base class would say nothing of it.
    paragraph = (vars(kind).get("__doc__") or "").strip().partition("\n\n")[0]
    source = f"{kind.__module__}:{kind.__qualname__}"
    return BehaviorInfo(spec, source, " ".join(paragraph.split()), parameters_of(kind.Params))
