"""Behaviours by name: the shipped ones, those of installed packages, and the user's own (`package.module:Class`)."""

import importlib
import inspect
import sys
from collections.abc import Iterable
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import msgspec

from zteam.behaviors.avoid import Avoid
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.follow import Follow
from zteam.behaviors.formation import Formation
from zteam.behaviors.forward import Forward
from zteam.behaviors.go_to import GoTo
from zteam.behaviors.idle import Idle
from zteam.behaviors.import_errors import explain
from zteam.behaviors.inputs import check_inputs
from zteam.behaviors.path import FollowPath
from zteam.behaviors.wander import Wander
from zteam.entry_points import BEHAVIORS as GROUP
from zteam.entry_points import load_offered, offered
from zteam.errors import UsageError, did_you_mean
from zteam.problems import Problem, problems_of

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
DETERMINISTIC = frozenset({"idle", "forward", "avoid", "follow", "path", "go_to", "formation"})
"""Those that draw no random numbers: with them, every seed gives the same run."""


def load_behavior(spec: str, params: dict[str, Any], robot_id: int | None = None) -> Behavior:
    """The behaviour called `spec` with its parameters checked.

    `spec` is a shipped name, an entry point `zteam.behaviors` of an installed package, or `package.module:Class`. With
    `robot_id`, a robot that would follow itself is refused. Raises UsageError.
    """
    kind = find_behavior(spec)
    return kind(read_params(spec, kind, params, robot_id))


def read_params(spec: str, kind: type[Behavior], params: dict[str, Any], robot_id: int | None = None) -> Any:
    """The parameters of the behaviour `spec` as its `Params`. Raises UsageError that names every mistake."""
    problems = parameter_problems(spec, kind, params)
    if problems:
        raise UsageError(f"behaviour {spec}: {'; '.join(map(str, problems))}")
    read = msgspec.convert(params, kind.Params)
    if robot_id is not None and getattr(read, "leader", None) == robot_id:
        raise UsageError(f"behaviour {spec}: robot {robot_id} cannot follow itself; name another robot")
    return read


def parameter_problems(
    spec: str, kind: type[Behavior], params: dict[str, Any], near: Iterable[str] = ()
) -> list[Problem]:
    """Every mistake in the parameters of the behaviour `spec`; `near` are other words that a key may stand for."""
    return problems_of(params, kind.Params, takes=f"{spec} takes", near=near)


def look_in(folders: Iterable[str | Path]) -> None:
    """Look for the user's modules in these folders too ("" is the current one), after all that is installed."""
    for folder in map(str, folders):
        if folder not in sys.path:
            sys.path.append(folder)


def find_behavior(spec: str) -> type[Behavior]:
    """The class called `spec`. Imports its module. Raises UsageError."""
    if spec in BEHAVIORS:
        return BEHAVIORS[spec]
    module, colon, name = spec.partition(":")
    if colon and module.endswith(".py"):
        meant = f"{module.removesuffix('.py').replace('/', '.')}:{name}"
        raise UsageError(f"no behaviour {spec!r} (did you mean {meant}?): a module is named without .py")
    if colon and name.isidentifier() and all(part.isidentifier() for part in module.split(".")):
        return _checked(spec, _import(spec, module, name))
    found = load_offered(GROUP, spec)
    if found is not None:
        return _checked(spec, found)
    known = [*BEHAVIORS, *offered(GROUP)]
    raise UsageError(f"no behaviour {spec!r}{_suggestion(spec, known)}: use {', '.join(known)} or package.module:Class")


def _import(spec: str, module: str, name: str) -> Any:
    """What is called `name` in the user's `module`. Raises UsageError."""
    try:
        imported = importlib.import_module(module)
    except (Exception, SystemExit) as error:
        # Importing runs the user's own code, which may raise anything. One line is enough to mend it.
        raise UsageError(f"behaviour {spec!r}: cannot import {module}: {explain(error)}") from error
    found = getattr(imported, name, None)
    if found is None:
        known = [name for name, value in vars(imported).items() if _is_behavior(value) and value is not Behavior]
        hint = did_you_mean(name, known) or (f"; it has {', '.join(known)}" if known else "")
        place = getattr(imported, "__file__", None) or "built in"
        raise UsageError(f"behaviour {spec!r}: module {module} ({place}) has no {name}{hint}")
    return found


def _checked(spec: str, found: Any) -> type[Behavior]:
    """`found` itself, if it is a behaviour with a type for its parameters. Raises UsageError."""
    if not _is_behavior(found):
        raise UsageError(f"behaviour {spec!r} is not a subclass of zteam.behaviors.Behavior")
    if not _takes_parameters(found):
        raise UsageError(f"behaviour {spec!r}: give it a class Params(msgspec.Struct, forbid_unknown_fields=True)")
    try:
        inspect.signature(found).bind(None)
    except TypeError:
        text = "its __init__ must take the parameters: def __init__(self, params): super().__init__(params)"
        raise UsageError(f"behaviour {spec!r}: {text}") from None
    try:
        check_inputs(found.inputs)
    except UsageError as error:
        raise UsageError(f"behaviour {spec!r}: {error}") from None
    if found.step is Behavior.step:
        raise UsageError(f"behaviour {spec!r} has no step: {_STEP}")
    try:
        inspect.signature(found.step).bind(None, None)
    except TypeError:
        raise UsageError(f"behaviour {spec!r}: its step must take the view: {_STEP}") from None
    return found  # type: ignore[no-any-return]


def _suggestion(spec: str, known: Iterable[str]) -> str:
    """What may have been meant: a known name, or a class in the module of that name, which is not imported."""
    spec = spec.removesuffix(".py")
    near = did_you_mean(spec, known)
    module, dot, name = spec.rpartition(".")
    if dot and name[:1].isupper():
        return f" (did you mean {module}:{name}?)"
    if near or not spec.isidentifier():
        return near
    place = PathFinder.find_spec(spec)
    if place is None or place.origin is None or not place.origin.endswith(".py"):
        return ""
    return f" (did you mean {' or '.join(f'{spec}:{name}' for name in _classes_in(Path(place.origin)))}?)"


def _classes_in(path: Path) -> list[str]:
    """Names of the classes in a source file that look like behaviours; `Class` where none does."""
    import ast

    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return ["Class"]
    found = []
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            methods = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
            bases = {ast.unparse(base).rpartition(".")[2] for base in node.bases}
            if "step" in methods or "Behavior" in bases:
                found.append(node.name)
    return found or ["Class"]


def _is_behavior(found: object) -> bool:
    return inspect.isclass(found) and issubclass(found, Behavior)


def _takes_parameters(kind: type[Behavior]) -> bool:
    params = getattr(kind, "Params", None)
    return inspect.isclass(params) and issubclass(params, msgspec.Struct)
