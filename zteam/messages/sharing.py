"""Messages within one process, without their bytes: a receiver gets what `decode` would make of what `encode` makes.

For every type functions are generated as Python source and compiled on first use. The message that `share` makes has
nothing in common with the sender's that could still change: numbers have the wire's precision, and sequences are
read-only. `adopt` takes the sender's own message instead, and changes only what the wire would change.
"""

import struct
import typing
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from zteam.errors import DecodeError, EncodeError
from zteam.messages.cdr import Source, build_expression, finite_check, truth
from zteam.messages.message import Message
from zteam.messages.wire_fields import SIZES, fields_of

M = TypeVar("M", bound=Message)

LARGEST = 32 * 1024 * 1024
"""Bytes, about. A larger message goes as its bytes, so that its receivers see how large it is."""


def share(message: M) -> M:
    """The message as its receivers are to see it. An array that is read-only is taken as it is, any other is copied.

    Raises EncodeError as `encode` does, and DecodeError where `decode` refuses the bytes, or they are very many.
    """
    try:
        made, size = _sharer(type(message))(message, 0)
    except (struct.error, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise EncodeError(f"cannot encode {type(message).__name__}: {error}") from None
    if size > LARGEST:
        raise DecodeError(f"its {size} bytes are too many to be shared")
    return typing.cast(M, made)


def adopt(message: M) -> M:
    """This very message as its receivers are to see it: the sender changes it no more, nor anything it holds.

    Its float32 fields are narrowed, and its arrays become read-only. The sender answers for the rest: numbers are plain
    ones that fit their fields, and finite where they must be (`check_adopted`).
    """
    change = _adopter(type(message))
    if change is not None:
        change(message)
    if _checks:
        _compare(message, share(message))
    return message


_checks: list[bool] = []
"""Not empty: what is adopted is checked."""


def check_adopted() -> None:
    """Let `adopt` raise EncodeError for a message that `share` would make otherwise. It costs time: use it in tests."""
    _checks.append(True)


def _compare(given: Any, due: Any) -> None:
    """Raise EncodeError unless both are the same, types and precision included."""
    if type(given) is not type(due):
        raise EncodeError(f"{given!r} was handed over where a {type(due).__name__} is due")
    if isinstance(due, Message):
        for field in due.__struct_fields__:
            _compare(getattr(given, field), getattr(due, field))
    elif isinstance(due, list):
        for mine, other in zip(given, due, strict=True):
            _compare(mine, other)
    elif isinstance(due, np.ndarray):
        if given.dtype != due.dtype or given.flags.writeable:
            raise EncodeError("an array was handed over that can be written, or has another type")
    elif given != due and given == given:
        raise EncodeError(f"{given!r} was handed over where {due!r} is due")


def _sequence(value: Any, dtype: np.dtype[Any], count: int | None) -> NDArray[Any]:
    """A read-only array of one dimension, of `count` numbers unless that is None."""
    array: NDArray[Any] = value
    if type(array) is not np.ndarray or array.dtype != dtype or array.flags.writeable:
        array = np.array(np.ascontiguousarray(value, dtype))
        array.flags.writeable = False
    if array.ndim != 1:
        raise ValueError("a sequence has one dimension")
    if count is not None and len(array) != count:
        raise ValueError(f"an array of {count} numbers is due")
    return array


@cache
def _sharer(kind: Any) -> Callable[[Any, int], tuple[Any, int]]:
    """Makes the message anew, and adds its size to a number."""
    source = Source()
    if kind is str:
        source.add("return m, n + 4 + len(m.encode())")
        return source.compile("def f(m, n):", "share str")
    values: dict[str, str] = {}
    codes, numbers, finite, size = "", [], [], 0
    rest: list[str] = []
    for number, (field, place, detail) in enumerate(fields_of(kind, "m")):
        value = values[place] = f"v{number}"
        if field == "number":
            code, is_bool, must_be_finite = detail
            codes += "?" if is_bool else code
            size += SIZES[code]
            numbers.append((value, f"{source.name('B', truth)}({place})" if is_bool else place))
            finite += [value] if must_be_finite else []
        elif field == "str":
            rest.append(f"{value} = {place}; n += len({value}.encode())")
        elif field == "list":
            sharer = source.name("R", _sharer(detail))
            rest += [f"{value} = []", f"for e in {place}: e, n = {sharer}(e, n); {value}.append(e)"]
        else:
            dtype, count = (detail, None) if field == "sequence" else detail
            taken = f"{source.name('Q', _sequence)}({place}, {source.name('D', np.dtype('<' + dtype))}, {count})"
            rest.append(f"{value} = {taken}; n += {value}.nbytes")
    if numbers:
        packer = source.name("S", struct.Struct("<" + codes))
        packed = f"{packer}.pack({', '.join(place for _, place in numbers)})"
        source.add(f"{', '.join(value for value, _ in numbers)}, = {packer}.unpack({packed})")
    for line in rest:
        source.add(line)
    if finite:
        source.add(finite_check(finite))
    source.add(f"return {build_expression(kind, 'm', values, source)}, n + {size}")
    return source.compile("def f(m, n):", f"share {kind.__name__}")


@cache
def _adopter(kind: Any) -> Callable[[Any], None] | None:
    """Changes the message itself; None for a type of which nothing is to be changed."""
    if kind is str:
        return None
    source = Source()
    narrow = []
    for field, place, detail in fields_of(kind, "m"):
        if field == "number" and detail[0] == "f":
            narrow.append(place)
        elif field == "list" and (adopter := _adopter(detail)) is not None:
            source.add(f"for e in {place}: {source.name('R', adopter)}(e)")
        elif field in ("sequence", "array"):
            dtype, count = (detail, None) if field == "sequence" else detail
            name = source.name("D", np.dtype("<" + dtype))
            source.add(f"a = {place}")
            source.add(f"if type(a) is np.ndarray and a.dtype is {name}: a.setflags(write=False)")
            source.add(f"else: {place} = {source.name('Q', _sequence)}(a, {name}, {count})")
    if narrow:
        packer = source.name("S", struct.Struct(f"<{len(narrow)}f"))
        source.add(f"{', '.join(narrow)}, = {packer}.unpack({packer}.pack({', '.join(narrow)}))")
    return source.compile("def f(m):", f"adopt {kind.__name__}") if source.lines else None
