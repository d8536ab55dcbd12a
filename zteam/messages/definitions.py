"""What a message type consists of: one description, from which its CDR bytes, its JSON and its text are made."""

from functools import cache
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from zteam.errors import UsageError
from zteam.messages.message import Message

RULE = "=" * 80
"""Above each type that another one holds."""
_NUMBERS = {"bool", "int8", "uint8", "int32", "uint32", "uint64", "float32", "float64"}
_IN_ARRAYS = _NUMBERS - {"uint32", "uint64"}
_COUNTS = {None: "", 0: "[]"}


class Field(NamedTuple):
    """One field of a message type."""

    name: str
    ros_name: str
    """ROS's name of what it holds, such as `float32`, `string` or `std_msgs/Header`."""
    kind: Any
    """`str` or a message type; None for numbers."""
    length: int | None
    """How many: None for a single one, 0 for any number."""

    @property
    def is_message(self) -> bool:
        """Whether it is one message."""
        return self.length is None and self.kind not in (None, str)


@cache
def fields_of(kind: type[Message]) -> tuple[Field, ...]:
    """The fields of a type in wire order. Raises UsageError for one without a form on the wire."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple(_field(name, hints[name], f"{kind.__name__}.{name}") for name in kind.__struct_fields__)


def _field(name: str, hint: Any, place: str) -> Field:
    if get_origin(hint) is list:
        return _field(name, get_args(hint)[0], place)._replace(length=0)
    if hint is str:
        return Field(name, "string", str, None)
    if isinstance(hint, type) and issubclass(hint, Message):
        return Field(name, _short(hint), hint, None)
    form = next((each for each in get_args(hint)[1:] if isinstance(each, str)), "")
    base, bracket, count = form.partition("[")
    if base not in (_IN_ARRAYS if bracket else _NUMBERS):
        raise UsageError(
            f"{place}: {hint} has no form on the wire; use float64, Float64Seq and others of zteam.messages, "
            "str, a message type, or a list of these"
        )
    return Field(name, base, None, int(count.removesuffix("]") or 0) if bracket else None)


@cache
def definition_of(kind: type[Message]) -> str:
    """The type's fields as in ROS 2's `.msg` files, then those of all types that it holds, as in `ros2msg` schemas.

    A foreign reader decodes zteam's bytes by it. Constants are left out.
    """
    texts: dict[type[Message], str] = {}

    def describe(held: Any) -> None:
        if held not in (None, str, *texts):
            fields = fields_of(held)
            counts = (_COUNTS.get(each.length, f"[{each.length}]") for each in fields)
            texts[held] = "".join(f"{each.ros_name}{n} {each.name}\n" for each, n in zip(fields, counts, strict=True))
            for each in fields:
                describe(each.kind)

    describe(kind)
    first, *others = texts.items()
    return first[1] + "".join(f"{RULE}\nMSG: {_short(each)}\n{text}" for each, text in others)


def _short(kind: type[Message]) -> str:
    return kind.ros_type.replace("/msg/", "/")
