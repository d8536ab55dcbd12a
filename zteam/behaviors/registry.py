"""Behaviours by name: our own, and anybody's."""

import importlib
import inspect
from typing import Any

import msgspec

from zteam.behaviors.avoid import Avoid
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.follow import Follow
from zteam.behaviors.forward import Forward
from zteam.behaviors.wander import Wander
from zteam.config import explain
from zteam.errors import UsageError

BEHAVIORS: dict[str, type[Behavior]] = {"forward": Forward, "avoid": Avoid, "wander": Wander, "follow": Follow}


def load_behavior(spec: str, params: dict[str, Any], robot_id: int | None = None) -> Behavior:
    """The behaviour called `spec`, a name of ours or `package.module:Class`, with its parameters checked.

    Give `robot_id` to have a robot refused that would follow itself. Raises UsageError.
    """
    kind = _find(spec)
    try:
        typed = msgspec.convert(params, kind.Params)
    except msgspec.ValidationError as error:
        raise UsageError(f"behaviour {spec}: {explain(error)}; it takes {_fields(kind.Params)}") from None
    behavior = kind(typed)
    if robot_id is not None and behavior.leader == robot_id:
        raise UsageError(f"behaviour {spec}: robot {robot_id} cannot follow itself; name another robot")
    return behavior


def _find(spec: str) -> type[Behavior]:
    if spec in BEHAVIORS:
        return BEHAVIORS[spec]
    module, colon, name = spec.partition(":")
    if not (colon and name.isidentifier() and all(part.isidentifier() for part in module.split("."))):
        raise UsageError(f"no behaviour {spec!r}: use {', '.join(BEHAVIORS)} or package.module:Class")
    try:
        found = getattr(importlib.import_module(module), name, None)
    except Exception as error:
        # Importing runs the user's own code: whatever it raises is the user's to mend, and one line is enough to know.
        raise UsageError(
            f"behaviour {spec!r}: cannot import {module}: {type(error).__name__}: {_one_line(error)} "
            "(is it installed, or its folder on PYTHONPATH?)"
        ) from error
    if found is None:
        raise UsageError(f"behaviour {spec!r}: module {module} has no {name}")
    if not (inspect.isclass(found) and issubclass(found, Behavior)):
        raise UsageError(f"behaviour {spec!r} is not a subclass of zteam.behaviors.Behavior")
    if not _takes_parameters(found):
        raise UsageError(f"behaviour {spec!r}: give it a class Params(msgspec.Struct, forbid_unknown_fields=True)")
    return found


def _takes_parameters(kind: type[Behavior]) -> bool:
    params = getattr(kind, "Params", None)
    return inspect.isclass(params) and issubclass(params, msgspec.Struct)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _fields(params: type[msgspec.Struct]) -> str:
    return ", ".join(params.__struct_fields__) or "no parameters"
