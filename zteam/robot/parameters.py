"""The parameters of a behaviour as plain data: what it takes, and what it has."""

import enum
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

_LIMITS = ("ge", "gt", "le", "lt", "multiple_of", "pattern", "min_length", "max_length")
"""Attributes of msgspec.Meta that limit a value."""


class Parameter(msgspec.Struct, frozen=True):
    """One field of a `Params`."""

    name: str
    type: str
    """As it is written in Python: `float`, `int`, `bool`, `str`, `list[float]`, `float | None`, …"""
    limits: dict[str, Any] = {}
    """What limits its value, by the names of msgspec.Meta: `ge` and `le` are the lowest and the highest value."""
    description: str = ""
    """Its unit and what it does, from msgspec.Meta."""
    required: bool = False
    """Whether it has to be given."""
    default: Any = None
    """As plain data; None also where it is required."""


def parameters_of(kind: type[msgspec.Struct]) -> list[Parameter]:
    """The parameters that a behaviour with these `Params` takes, in their order."""
    types = get_type_hints(kind)
    return [_parameter(field, _type_text(types[field.name])) for field in msgspec.structs.fields(kind)]


def values_of(params: msgspec.Struct) -> dict[str, Any]:
    """The values of all parameters as plain data, by name."""
    return {field.encode_name: _plain(getattr(params, field.name)) for field in msgspec.structs.fields(type(params))}


def _parameter(field: msgspec.structs.FieldInfo, type_text: str) -> Parameter:
    metas = list(_metas(field.type))
    default = None if field.default is msgspec.NODEFAULT else field.default
    if field.default_factory is not msgspec.NODEFAULT:
        default = field.default_factory()
    return Parameter(
        name=field.encode_name,
        type=type_text,
        limits={name: value for meta in metas for name in _LIMITS if (value := getattr(meta, name)) is not None},
        description=next((meta.description for meta in metas if meta.description), ""),
        required=field.required,
        default=_plain(default),
    )


def _plain(value: Any) -> Any:
    return msgspec.to_builtins(value, enc_hook=str)


def _metas(annotation: Any) -> list[msgspec.Meta]:
    """What is annotated to a type, or to a member of a union."""
    parts = get_args(annotation) if get_origin(annotation) in (Annotated, Union, UnionType) else ()
    own = [meta for meta in parts if isinstance(meta, msgspec.Meta)]
    return own + [meta for part in parts for meta in _metas(part)]


def _type_text(annotation: Any) -> str:
    """A type without what is annotated to it, or its choices."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return " | ".join(map(repr, parts))
    if origin in (Union, UnionType):
        return " | ".join(map(_type_text, parts))
    if isinstance(annotation, type) and issubclass(annotation, enum.Enum):
        return " | ".join(repr(choice.value) for choice in annotation)
    if parts:
        return f"{_type_text(origin)}[{', '.join(map(_type_text, parts))}]"
    if annotation in (NoneType, ...):
        return "None" if annotation is NoneType else "..."
    return getattr(annotation, "__name__", str(annotation))
