"""Message types as text, in the form of ROS 2's `.msg` files: what a foreign reader decodes zteam's bytes by."""

import typing
from functools import cache
from typing import Any, get_args, get_origin

from zteam.messages.cdr import wire_form
from zteam.messages.message import Message

RULE = "=" * 80
"""Above each type that another one holds."""


@cache
def definition_of(kind: type[Message]) -> str:
    """The type's fields, then those of all types that it holds, as in `ros2msg` schemas. Constants are left out.

    Raises UsageError for a field without a form on the wire.
    """
    parts: dict[type[Message], str] = {}
    _describe(kind, parts)
    first, *rest = parts.items()
    return first[1] + "".join(f"{RULE}\nMSG: {_short(held)}\n{text}" for held, text in rest)


def _describe(kind: type[Message], parts: dict[type[Message], str]) -> None:
    if kind in parts:
        return
    # Its place is before that of the types it holds.
    parts[kind] = ""
    hints = typing.get_type_hints(kind, include_extras=True)
    parts[kind] = "".join(f"{_field(hints[name], kind, name, parts)} {name}\n" for name in kind.__struct_fields__)


def _field(hint: Any, kind: type[Message], name: str, parts: dict[type[Message], str]) -> str:
    if get_origin(hint) is list:
        return _field(get_args(hint)[0], kind, name, parts) + "[]"
    if hint is str:
        return "string"
    if isinstance(hint, type) and issubclass(hint, Message):
        _describe(hint, parts)
        return _short(hint)
    base, count = wire_form(hint, f"{kind.__name__}.{name}")
    return f"{base}[{count.removesuffix(']')}]" if count else base


def _short(kind: type[Message]) -> str:
    return kind.ros_type.replace("/msg/", "/")
