"""The wire's view of message types: every type as a flat list of fields, in ROS 2's order."""

import typing
from typing import Any, get_args, get_origin

from zteam.errors import UsageError
from zteam.messages.message import Message

CODES = {
    "bool": "B", "int8": "b", "uint8": "B", "int32": "i", "uint32": "I", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
SIZES = {"B": 1, "b": 1, "i": 4, "I": 4, "Q": 8, "f": 4, "d": 8}
DTYPES = {"bool": "b1", "int8": "i1", "uint8": "u1", "int32": "i4", "float32": "f4", "float64": "f8"}

_MAY_BE_INFINITE = {
    "LaserScan.range_max", "Range.min_range", "Range.max_range", "Range.range",
    "BaseInfo.acc_lim_x", "BaseInfo.decel_lim_x", "BaseInfo.acc_lim_theta",
    "BaseInfo.acc_lim_y", "BaseInfo.decel_lim_reverse",
}  # fmt: skip
"""Scalars that may be inf or NaN: fixed-distance rangers, lasers and bases without a limit. In any other, a NaN makes
the payload undecodable."""

Field = tuple[str, str, Any]
"""(kind, expression, detail); kinds: number, str, sequence, array, list."""


def wire_form(hint: Any, place: str) -> tuple[str, str]:
    """What a field annotated with `hint` holds, and how many: ("float32", "") one, "n" so many, "]" any number.

    Raises UsageError that names `place` for an annotation that says nothing about the wire.
    """
    arguments = get_args(hint)
    base, bracket, count = "", "", ""
    if len(arguments) == 2 and isinstance(arguments[1], str):
        base, bracket, count = arguments[1].partition("[")
    if base not in (DTYPES if bracket else CODES):
        raise UsageError(
            f"{place}: {hint} has no form on the wire; use float64, Float64Seq and others of zteam.messages, "
            "str, a message type, or a list of these"
        )
    return base, count if count in ("", "]") else count.removesuffix("]")


def fields_of(message_type: type[Message], expression: str) -> list[Field]:
    """The type's fields in wire order, nested messages flattened."""
    found: list[Field] = []
    hints = typing.get_type_hints(message_type, include_extras=True)
    for name in message_type.__struct_fields__:
        hint, place = hints[name], f"{expression}.{name}"
        if get_origin(hint) is list:
            found.append(("list", place, get_args(hint)[0]))
        elif hint is str:
            found.append(("str", place, None))
        elif isinstance(hint, type) and issubclass(hint, Message):
            found.extend(fields_of(hint, place))
        else:
            base, count = wire_form(hint, f"{message_type.__name__}.{name}")
            if not count:
                finite = base.startswith("float") and f"{message_type.__name__}.{name}" not in _MAY_BE_INFINITE
                found.append(("number", place, (CODES[base], base == "bool", finite)))
            elif count == "]":
                found.append(("sequence", place, DTYPES[base]))
            else:
                found.append(("array", place, (DTYPES[base], int(count))))
    return found


def least_size(kind: Any) -> int:
    """The fewest bytes that an element of a list can take."""
    if kind is str:
        return 4
    least = 0
    for field_kind, _, detail in fields_of(kind, "m"):
        if field_kind == "number":
            least += SIZES[detail[0]]
        elif field_kind == "array":
            least += int(detail[0][1]) * int(detail[1])
        else:
            least += 4
    return least
