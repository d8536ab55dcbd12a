"""The CDR codec (XCDR1, OMG DDS-XTypes 7.4.1): ROS 2's own bytes, generated from the message types.

A payload is a 4-byte header (00 01 = little endian, 00 00 = big endian, two option bytes) and the fields in order,
each aligned to its own size counted from the end of the header. For every type one encoder and two decoders are
generated as Python source and compiled on first use: neighbouring numbers become one `struct` call, number sequences
are views into the payload. On the wire everything is little endian; both are read.
"""

import struct
import typing
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

from zteam.errors import DecodeError, EncodeError, UsageError
from zteam.messages.message import Message

M = TypeVar("M", bound=Message)

_CODES = {
    "bool": "B", "int8": "b", "uint8": "B", "int32": "i", "uint32": "I", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_SIZES = {"B": 1, "b": 1, "i": 4, "I": 4, "Q": 8, "f": 4, "d": 8}
_DTYPES = {"bool": "b1", "int8": "i1", "uint8": "u1", "int32": "i4", "float32": "f4", "float64": "f8"}

_MAY_BE_INFINITE = {
    "LaserScan.range_max", "Range.min_range", "Range.max_range", "Range.range",
    "BaseInfo.acc_lim_x", "BaseInfo.decel_lim_x", "BaseInfo.acc_lim_theta",
    "BaseInfo.acc_lim_y", "BaseInfo.decel_lim_reverse",
}  # fmt: skip
"""Scalars that may be inf or NaN: fixed-distance rangers, lasers and bases without a limit. In any other, a NaN makes
the payload undecodable."""

_Field = tuple[str, str, Any]
"""(kind, expression, detail); kinds: number, str, numbers (a sequence, or an array of fixed length), list."""
_HEADER = b"\x00\x01\x00\x00"
_MAX_PADDING = 3
"""XCDR1 writers may pad a payload to a multiple of four."""


def encode(message: Message) -> bytes:
    """The message's CDR bytes, little endian. Raises EncodeError for a value that does not fit its field."""
    parts = [_HEADER]
    try:
        _writer(type(message))(message, parts, len(_HEADER))
    except (struct.error, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise EncodeError(f"cannot encode {type(message).__name__}: {error}") from None
    return b"".join(parts)


def decode(message_type: type[M], payload: bytes) -> M:
    """The message in `payload`; its number sequences are read-only views of the payload.

    Raises DecodeError, and nothing else, for anything that is no such message: too short, garbage behind it, a
    length that the payload does not have, a text that is not UTF-8, a number that is not finite where it must be.
    """
    size = len(payload)
    if size < len(_HEADER):
        raise DecodeError(f"{size} bytes are too few for {message_type.__name__}")
    if payload[0] != 0 or payload[1] > 1:
        raise DecodeError(f"not CDR: it begins with {payload[:2].hex()}")
    try:
        message, end = _reader(message_type, "<" if payload[1] else ">")(payload, len(_HEADER), size)
    except (struct.error, UnicodeDecodeError, ValueError, OverflowError) as error:
        raise DecodeError(f"not a {message_type.__name__}: {error}") from None
    if size - end > _MAX_PADDING:
        raise DecodeError(f"{size - end} bytes of garbage behind it")
    return message  # type: ignore[no-any-return]


def wire_form(hint: Any, place: str) -> tuple[str, str]:
    """What a field annotated with `hint` holds, and how many: ("float32", "") one, "n" so many, "]" any number.

    Raises UsageError that names `place` for an annotation that says nothing about the wire.
    """
    arguments = get_args(hint)
    base, bracket, count = "", "", ""
    if len(arguments) == 2 and isinstance(arguments[1], str):
        base, bracket, count = arguments[1].partition("[")
    if base not in (_DTYPES if bracket else _CODES):
        raise UsageError(
            f"{place}: {hint} has no form on the wire; use float64, Float64Seq and others of zteam.messages, "
            "str, a message type, or a list of these"
        )
    return base, count if count in ("", "]") else count.removesuffix("]")


def _fields_of(message_type: type[Message], expression: str) -> list[_Field]:
    """The type's fields in wire order, nested messages flattened."""
    found: list[_Field] = []
    hints = typing.get_type_hints(message_type, include_extras=True)
    for name in message_type.__struct_fields__:
        hint, place = hints[name], f"{expression}.{name}"
        if get_origin(hint) is list:
            found.append(("list", place, get_args(hint)[0]))
        elif hint is str:
            found.append(("str", place, None))
        elif isinstance(hint, type) and issubclass(hint, Message):
            found.extend(_fields_of(hint, place))
        else:
            base, count = wire_form(hint, f"{message_type.__name__}.{name}")
            if not count:
                finite = base.startswith("float") and f"{message_type.__name__}.{name}" not in _MAY_BE_INFINITE
                found.append(("number", place, (_CODES[base], base == "bool", finite)))
            else:
                found.append(("numbers", place, (_DTYPES[base], None if count == "]" else int(count))))
    return found


@cache
def _runs(codes: str, order: str) -> tuple[struct.Struct, ...]:
    """Structs for the numbers `codes`, one for each position modulo 8 (counted with the header) it may start at."""
    variants = []
    for start in range(8):
        position, layout = start - len(_HEADER), order
        for code in codes:
            padding = -position % _SIZES[code]
            layout += "x" * padding + code
            position += padding + _SIZES[code]
        variants.append(struct.Struct(layout))
    return tuple(variants)


class _Source:
    """A generated function: its lines and the objects they use."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.names: dict[str, Any] = {"np": np, "DecodeError": DecodeError}

    def add(self, line: str) -> None:
        self.lines.append("    " + line)

    def name(self, stem: str, value: Any) -> str:
        """A new name that begins with `stem` for an object."""
        name = f"{stem}{len(self.names)}"
        self.names[name] = value
        return name

    def compile(self, head: str, label: str) -> Callable[..., Any]:
        """The function; `head` is its first line, and tracebacks show `label`."""
        code = "\n".join([head, *self.lines])
        exec(compile(code, f"<cdr {label}>", "exec"), self.names)
        return typing.cast(Callable[..., Any], self.names["f"])


def _write(source: _Source, fields: list[_Field]) -> None:
    """Lines that append the fields to `parts` and move `p`, the position counted with the header."""
    run: list[tuple[str, str]] = []

    def flush() -> None:
        if run:
            packers = source.name("S", _runs("".join(code for code, _ in run), "<"))
            source.add(f"b = {packers}[p & 7].pack({', '.join(value for _, value in run)})")
            source.add("parts.append(b); p += len(b)")
            run.clear()

    for number, (kind, place, detail) in enumerate(fields):
        if kind == "number":
            run.append((detail[0], f"{source.name('B', _truth)}({place})" if detail[1] else place))
        elif kind == "str":
            source.add(f"s{number} = {place}.encode() + b'\\0'")
            run.append(("I", f"len(s{number})"))
            flush()
            source.add(f"parts.append(s{number}); p += len(s{number})")
        elif kind == "numbers":
            dtype, count = detail
            source.add(f"a{number} = np.ascontiguousarray({place}, {source.name('D', np.dtype('<' + dtype))})")
            if count is None:
                source.add(f"if a{number}.ndim != 1: raise ValueError('a sequence has one dimension')")
                run.append(("I", f"len(a{number})"))
            else:
                source.add(f"if a{number}.shape != ({count},): raise ValueError('an array of {count} numbers is due')")
            flush()
            if count is not None or int(dtype[1]) > 4:
                # A length leaves the position at a multiple of 4. An empty sequence is not aligned.
                gap = f"({len(_HEADER)} - p) % {int(dtype[1])} if len(a{number}) else 0"
                source.add(f"n = {gap}; parts.append(bytes(n)); p += n")
            source.add(f"b = a{number}.tobytes(); parts.append(b); p += len(b)")
        else:
            run.append(("I", f"len({place})"))
            flush()
            writer = source.name("W", _writer(detail))
            source.add(f"for e in {place}: p = {writer}(e, parts, p)")
    flush()


def _truth(value: Any) -> bool:
    """A truth value, numpy's too: what a comparison of numpy numbers gives goes into a `Bool` as it is."""
    if isinstance(value, bool | np.bool_) or value in (0, 1):
        return bool(value)
    raise ValueError(f"{value!r} is neither true nor false")


@cache
def _writer(kind: Any) -> Callable[..., Any]:
    """Appends the bytes of a message, or of a text, to `parts` from position `p` on, and returns that after it."""
    source = _Source()
    _write(source, [("str", "m", None)] if kind is str else _fields_of(kind, "m"))
    source.add("return p")
    return source.compile("def f(m, parts, p):", f"write {kind.__name__}")


def _read(source: _Source, fields: list[_Field], order: str) -> dict[str, str]:
    """Lines that read the fields from `buf` at `p`, up to `end`; the variable that holds each place's value."""
    values: dict[str, str] = {}
    run: list[tuple[str, str]] = []
    checks: list[str] = []

    def flush() -> None:
        if run:
            unpackers = source.name("S", _runs("".join(code for code, _ in run), order))
            source.add(f"s = {unpackers}[p & 7]")
            source.add(f"{', '.join(value for _, value in run)}, = s.unpack_from(buf, p); p += s.size")
            run.clear()
        for check in checks:
            source.add(check)
        checks.clear()

    finite: list[str] = []
    for number, (kind, place, detail) in enumerate(fields):
        value = values[place] = f"v{number}"
        if kind == "number":
            code, is_bool, must_be_finite = detail
            run.append((code, value))
            if is_bool:
                checks.append(f"if {value} > 1: raise DecodeError('{place} is neither true nor false')")
                checks.append(f"{value} = {value} == 1")
            finite += [value] if must_be_finite else []
        else:
            if kind != "numbers" or detail[1] is None:
                run.append(("I", "n"))
            flush()
            if kind == "numbers":
                _read_numbers(source, value, detail[0], detail[1], order)
            elif kind == "str":
                _read_text(source, value)
            else:
                _read_list(source, value, detail, order)
    flush()
    if finite:
        # 0 * x is 0 for every finite x and NaN for the others, and a sum of zeros cannot overflow.
        zeros = " + ".join("0.0 * " + value for value in finite)
        source.add(f"if {zeros} != 0.0: raise DecodeError('a number is not finite')")
    return values


def _read_text(source: _Source, value: str) -> None:
    source.add("if n > end - p: raise DecodeError('a text of %d bytes, more than it holds' % n)")
    # Some writers send the empty text without its NUL.
    source.add(f"if n == 0: {value} = ''")
    source.add("elif buf[p + n - 1] != 0: raise DecodeError('a text without its final NUL')")
    source.add(f"else: {value} = str(buf[p:p + n - 1], 'utf-8'); p += n")


def _read_numbers(source: _Source, value: str, dtype: str, count: int | None, order: str) -> None:
    size, number = int(dtype[1]), "n" if count is None else str(count)
    if count is not None or size > 4:
        source.add(f"if {number}: p += ({len(_HEADER)} - p) % {size}")
    if count is None:
        source.add(f"if n * {size} > end - p: raise DecodeError('a length of %d, more than it holds' % n)")
    wire = source.name("D", np.dtype(order + dtype))
    native = "" if order == "<" else f".astype({source.name('D', np.dtype('<' + dtype))})"
    source.add(f"{value} = np.frombuffer(buf, {wire}, {number}, p){native}; p += {number} * {size}")


def _read_list(source: _Source, value: str, kind: Any, order: str) -> None:
    reader = source.name("R", _reader(kind, order))
    if kind is str or kind.__struct_fields__:
        # Each element takes a byte at least.
        source.add("if n > end - p: raise DecodeError('a length of %d, too many' % n)")
    source.add(f"{value} = []")
    source.add(f"for _ in range(n): e, p = {reader}(buf, p, end); {value}.append(e)")


def _build_expression(message_type: type[Message], expression: str, values: dict[str, str], source: _Source) -> str:
    """The expression that makes the message from the variables."""
    hints = typing.get_type_hints(message_type, include_extras=True)
    arguments = []
    for name in message_type.__struct_fields__:
        place = f"{expression}.{name}"
        arguments.append(values[place] if place in values else _build_expression(hints[name], place, values, source))
    return f"{source.name('T', message_type)}({', '.join(arguments)})"


@cache
def _reader(kind: Any, order: str) -> Callable[..., Any]:
    """Reads a message, or a text, from `buf` at `p`, up to `end` at most; returns it and the position after it."""
    source = _Source()
    if kind is str:
        result = _read(source, [("str", "m", None)], order)["m"]
    else:
        values = _read(source, _fields_of(kind, "m"), order)
        result = _build_expression(kind, "m", values, source)
    source.add(f"return {result}, p")
    return source.compile("def f(buf, p, end):", f"read {kind.__name__}")


def adopt(message: M) -> M:
    """This very message as receivers in this process are to see it: the sender changes it no more, nor what it holds.

    Its float32 fields are narrowed, and its arrays become read-only. The sender answers for the rest: numbers are plain
    ones that fit their fields, and finite where they must be.
    """
    change = _adopter(type(message))
    if change is not None:
        change(message)
    return message


def _read_only(value: Any, dtype: np.dtype[Any]) -> NDArray[Any]:
    array: NDArray[Any] = np.ascontiguousarray(value, dtype)
    array.flags.writeable = False
    return array


@cache
def _adopter(kind: Any) -> Callable[[Any], None] | None:
    """Changes the message itself; None for a type of which nothing is to be changed."""
    if kind is str:
        return None
    source = _Source()
    narrow = []
    for field, place, detail in _fields_of(kind, "m"):
        if field == "number" and detail[0] == "f":
            narrow.append(place)
        elif field == "list" and (adopter := _adopter(detail)) is not None:
            source.add(f"for e in {place}: {source.name('R', adopter)}(e)")
        elif field == "numbers":
            dtype = source.name("D", np.dtype("<" + detail[0]))
            source.add(f"{place} = {source.name('Q', _read_only)}({place}, {dtype})")
    if narrow:
        packer = source.name("S", struct.Struct(f"<{len(narrow)}f"))
        source.add(f"{', '.join(narrow)}, = {packer}.unpack({packer}.pack({', '.join(narrow)}))")
    return source.compile("def f(m):", f"adopt {kind.__name__}") if source.lines else None
