"""Hypothesis strategies that several tests share."""

import typing
from typing import Any, get_args, get_origin

import numpy as np
from hypothesis import strategies as st

from zteam.messages import Message

_INTEGERS = {"int8", "uint8", "int32", "uint32", "uint64"}


def _scalar(wire: str) -> st.SearchStrategy[Any]:
    if wire == "bool":
        return st.booleans()
    if wire in _INTEGERS:
        limits = np.iinfo(wire)
        return st.integers(int(limits.min), int(limits.max))
    width = int(wire.removeprefix("float"))
    return st.floats(allow_nan=False, allow_infinity=False, width=width)


def _field(hint: Any) -> st.SearchStrategy[Any]:
    if isinstance(hint, type) and issubclass(hint, Message):
        return messages(hint)
    if get_origin(hint) is list:
        return st.lists(_field(get_args(hint)[0]), max_size=3)
    if hint is str:
        return st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)
    wire = get_args(hint)[1]
    base, bracket, count = wire.partition("[")
    if not bracket:
        return _scalar(base)
    if base == "bool":
        return st.lists(st.booleans(), max_size=40).map(lambda flags: np.array(flags, bool))
    size = st.integers(0, 40) if count == "]" else st.just(int(count[:-1]))
    return size.flatmap(
        lambda n: st.binary(min_size=n * np.dtype(base).itemsize, max_size=n * np.dtype(base).itemsize).map(
            lambda raw: np.frombuffer(raw, base)
        )
    )


def messages(kind: type[Message]) -> st.SearchStrategy[Any]:
    """Random messages of one type; sequences of numbers hold any bits, NaN included."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return st.builds(kind, **{name: _field(hints[name]) for name in kind.__struct_fields__})
