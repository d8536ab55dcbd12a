"""The CDR codec (XCDR1, OMG DDS-XTypes 7.4.1): ROS 2's own bytes, generated from the message types.

A payload is a 4-byte header (00 01 = little endian, 00 00 = big endian, two option bytes) and the fields in order,
each aligned to its own size counted from the end of the header. For every type one encoder and two decoders are
generated as Python source and compiled on first use: neighbouring numbers become one `struct` call, number sequences
are views into the payload. On the wire everything is little endian; both are read.
"""

import struct
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from zteam.errors import DecodeError, EncodeError
from zteam.messages.message import Field, Message, fields_of

M = TypeVar("M", bound=Message)

_CODES = {
    "bool": "B", "int8": "b", "uint8": "B", "int32": "i", "uint32": "I", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip

_MAY_BE_INFINITE = {
    "LaserScan.range_max", "Range.min_range", "Range.max_range", "Range.range",
    "BaseInfo.acc_lim_x", "BaseInfo.decel_lim_x", "BaseInfo.acc_lim_theta",
    "BaseInfo.acc_lim_y", "BaseInfo.decel_lim_reverse",
}  # fmt: skip
"""Scalars that may be inf or NaN: fixed-distance rangers, lasers and bases without a limit. In any other, a NaN makes
the payload undecodable."""

_HEADER = b"\x00\x01\x00\x00"
_START = len(_HEADER)
_MAX_PADDING = 3
"""XCDR1 writers may pad a payload to a multiple of four."""


def encode(message: Message) -> bytes:
    """The message's CDR bytes, little endian. Raises EncodeError for a value that does not fit its field."""
    parts = [_HEADER]
    try:
        _writer(type(message))(message, parts, _START)
    except (struct.error, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise EncodeError(f"cannot encode {type(message).__name__}: {error}") from None
    return b"".join(parts)


def decode(message_type: type[M], payload: bytes) -> M:
    """The message in `payload`; its number sequences are read-only views of the payload.

    Raises DecodeError, and nothing else, for anything that is no such message: too short, garbage behind it, a
    length that the payload does not have, a text that is not UTF-8, a number that is not finite where it must be.
    """
    size = len(payload)
    if size < _START:
        raise DecodeError(f"{size} bytes are too few for {message_type.__name__}")
    if payload[0] != 0 or payload[1] > 1:
        raise DecodeError(f"not CDR: it begins with {payload[:2].hex()}")
    try:
        message, end = _reader(message_type, "<" if payload[1] else ">")(payload, _START, size)
    except (struct.error, UnicodeDecodeError, ValueError, OverflowError) as error:
        if message_type.earlier is not None:
            earlier = decode(message_type.earlier, payload)
            return message_type(*(getattr(earlier, name) for name in earlier.__struct_fields__))
        raise DecodeError(f"not a {message_type.__name__}: {error}") from None
    if size - end > _MAX_PADDING:
        raise DecodeError(f"{size - end} bytes of garbage behind it")
    return message  # type: ignore[no-any-return]


def _flat(kind: Any, place: str) -> Iterator[tuple[str, Field, bool]]:
    """The fields of a type in wire order, those of nested messages in their place: expression, field, and whether it is
    a number that must be finite. A text in a list is its own only field."""
    if kind is str:
        yield place, Field("", "string", str, None), False
        return
    for field in fields_of(kind):
        if field.is_message:
            yield from _flat(field.kind, f"{place}.{field.name}")
        else:
            may_be_infinite = f"{kind.__name__}.{field.name}" in _MAY_BE_INFINITE
            yield f"{place}.{field.name}", field, field.ros_name.startswith("float") and not may_be_infinite


@cache
def _runs(codes: tuple[str, ...], order: str) -> tuple[struct.Struct, ...]:
    """Structs for the numbers `codes`, one for each position modulo 8 (counted with the header) it may start at.

    A code with a 0, such as `0d`, is no number, but the place where an array of such numbers begins.
    """
    variants = []
    for start in range(8):
        position, layout = start - _START, order
        for code in codes:
            padding = -position % struct.calcsize(order + code.strip("0"))
            layout += "x" * padding + code
            position += padding + struct.calcsize(order + code)
        variants.append(struct.Struct(layout))
    return tuple(variants)


class _Source:
    """A generated function: its lines and the objects they use."""

    def __init__(self, order: str = "<") -> None:
        self.lines: list[str] = []
        self.names: dict[str, Any] = {"np": np, "DecodeError": DecodeError}
        self._order = order
        self._run: list[tuple[str, str]] = []
        """The neighbouring numbers that are not written or read yet: codes and expressions."""

    def add(self, *lines: str) -> None:
        self.lines += (f"    {line}" for line in lines)

    def name(self, stem: str, value: Any) -> str:
        """A new name that begins with `stem` for an object."""
        name = f"{stem}{len(self.names)}"
        self.names[name] = value
        return name

    def dtype(self, field: Field, order: str) -> str:
        """A name for numpy's type of a field's numbers."""
        return self.name("D", np.dtype(order + np.dtype(field.ros_name).str[1:]))

    def number(self, code: str, expression: str) -> None:
        """One more number in the run."""
        self._run.append((code, expression))

    def end_run(self, *lines: str) -> None:
        """Use the struct `{s}` of the run, if there is one, for its numbers `{values}` at position `p`."""
        if self._run:
            codes, expressions = zip(*self._run, strict=True)
            structs, values = self.name("S", _runs(codes, self._order)), ", ".join(filter(None, expressions))
            self.add(*(line.format(s=f"{structs}[p & 7]", values=values) for line in lines))
            self._run.clear()

    def compile(self, head: str, label: str) -> Callable[..., Any]:
        """The function; `head` is its first line, and tracebacks show `label`."""
        exec(compile("\n".join([head, *self.lines]), f"<cdr {label}>", "exec"), self.names)
        function: Callable[..., Any] = self.names["f"]
        return function


_APPEND = "parts.append(b); p += len(b)"
_PACK = "b = {s}.pack({values})", _APPEND
_UNPACK = "s = {s}", "[{values}] = s.unpack_from(buf, p); p += s.size"


def _truth(value: Any) -> bool:
    """A truth value, numpy's too: what a comparison of numpy numbers gives goes into a `Bool` as it is."""
    if isinstance(value, bool | np.bool_) or value in (0, 1):
        return bool(value)
    raise ValueError(f"{value!r} is neither true nor false")


@cache
def _writer(kind: Any) -> Callable[..., Any]:
    """Appends the bytes of a message, or of a text, to `parts` from position `p` on, and returns that after it."""
    source = _Source()
    for number, (place, field, _) in enumerate(_flat(kind, "m")):
        if field.kind is None and field.length is None:
            is_bool = field.ros_name == "bool"
            source.number(_CODES[field.ros_name], f"{source.name('B', _truth)}({place})" if is_bool else place)
        elif field.kind is None:
            _write_numbers(source, place, field, f"a{number}")
        elif field.length is None:
            source.add(f"s{number} = {place}.encode() + b'\\0'")
            source.number("I", f"len(s{number})")
            source.end_run(f"{_PACK[0]} + s{number}", _APPEND)
        else:
            source.number("I", f"len({place})")
            source.end_run(*_PACK)
            if field.kind is str:
                source.add(
                    f"p = {source.name('L', _Texts())}.write({source.name('W', _writer(str))}, {place}, parts, p)"
                )
            else:
                source.add(f"for e in {place}: p = {source.name('W', _writer(field.kind))}(e, parts, p)")
    source.end_run(*_PACK)
    source.add("return p")
    return source.compile("def f(m, parts, p):", f"write {kind.__name__}")


def _write_numbers(source: _Source, place: str, field: Field, array: str) -> None:
    source.add(f"{array} = np.ascontiguousarray({place}, {source.dtype(field, '<')})")
    if not field.length:
        source.add(f"if {array}.ndim != 1: raise ValueError('a sequence has one dimension')")
        source.number("I", f"len({array})")
    else:
        count = field.length
        source.add(f"if {array}.shape != ({count},): raise ValueError('an array of {count} numbers is due')")
        source.number("0" + _CODES[field.ros_name], "")
    if not field.length and (size := np.dtype(field.ros_name).itemsize) > 4:
        # A length leaves the position at a multiple of 4. An empty sequence is not aligned.
        source.end_run(*_PACK)
        source.add(f"b = bytes(({_START} - p) % {size} if len({array}) else 0) + {array}.tobytes()", _APPEND)
    else:
        source.end_run(f"{_PACK[0]} + {array}.tobytes()", _APPEND)


@cache
def _reader(kind: Any, order: str) -> Callable[..., Any]:
    """Reads a message, or a text, from `buf` at `p`, up to `end` at most; returns it and the position after it."""
    source = _Source(order)
    values: dict[str, str] = {}
    checks, finite = [], []
    for number, (place, field, must_be_finite) in enumerate(_flat(kind, "m")):
        value = values[place] = f"v{number}"
        if field.kind is None and field.length is None:
            source.number(_CODES[field.ros_name], value)
            finite += [value] * must_be_finite
            if field.ros_name == "bool":
                checks.append(f"if {value} > 1: raise DecodeError('{place} is neither true nor false')")
                checks.append(f"{value} = {value} == 1")
            continue
        source.number(*(("0" + _CODES[field.ros_name], "") if field.length else ("I", "n")))
        source.end_run(*_UNPACK)
        if field.kind is None:
            _read_numbers(source, value, field, order)
        elif field.length is None:
            source.add(
                "if n > end - p: raise DecodeError('a text of %d bytes, more than it holds' % n)",
                # Some writers send the empty text without its NUL.
                f"if n == 0: {value} = ''",
                "elif buf[p + n - 1] != 0: raise DecodeError('a text without its final NUL')",
                f"else: {value} = buf[p:p + n - 1].decode(); p += n",
            )
        else:
            if field.kind is str or field.kind.__struct_fields__:
                # Each element takes a byte at least.
                source.add("if n > end - p: raise DecodeError('a length of %d, too many' % n)")
            reader = source.name("R", _reader(field.kind, order))
            lines = [f"{value} = []", f"for _ in range(n): e, p = {reader}(buf, p, end); {value}.append(e)"]
            if field.kind is str:
                lines = [f"{value}, p = {source.name('L', _Texts())}.read({reader}, buf, p, end, n)"]
            elif order == "<" and (read_rows := getattr(field.kind, "read_rows", None)) is not None:
                source.add(f"e = {source.name('V', read_rows)}(buf, p, end, n)", f"if e is not None: {value}, p = e")
                lines = ["else:", *(f"    {line}" for line in lines)]
            source.add(*lines)
    source.end_run(*_UNPACK)
    source.add(*checks)
    if finite:
        # 0 * x is 0 for every finite x and NaN for the others, and a sum of zeros cannot overflow.
        zeros = " + ".join("0.0 * " + value for value in finite)
        source.add(f"if {zeros} != 0.0: raise DecodeError('a number is not finite')")
    source.add(f"return {_construction(kind, 'm', values, source)}, p")
    return source.compile("def f(buf, p, end):", f"read {kind.__name__}")


class _Texts:
    """Reads and writes the texts of one field. Each tick of lock-step has the same: those of the last one are known."""

    def __init__(self) -> None:
        self._known: tuple[bytes, int, int, list[str]] = b"", 0, 0, []
        """Bytes of the last texts, their place modulo 8, their number, and the texts."""

    def write(self, write: Callable[..., Any], texts: list[str], parts: list[bytes], p: int) -> int:
        """Append the texts from position `p` on; the position after them."""
        known, place, _, before = self._known
        if p & 7 != place or texts != before:
            own: list[bytes] = []
            for text in texts:
                p = write(text, own, p)
            known = b"".join(own)
            self._known = known, (p - len(known)) & 7, len(texts), [*texts]
        else:
            p += len(known)
        parts.append(known)
        return p

    def read(self, read: Callable[..., Any], buf: bytes, p: int, end: int, count: int) -> tuple[list[str], int]:
        """`count` texts from position `p` on, and the position after them."""
        known, place, number, texts = self._known
        if count == number and p & 7 == place and buf[p : p + len(known)] == known:
            return texts.copy(), p + len(known)
        begin, texts = p, []
        for _ in range(count):
            text, p = read(buf, p, end)
            texts.append(text)
        self._known = buf[begin:p], begin & 7, count, texts
        return texts.copy(), p


def _read_numbers(source: _Source, value: str, field: Field, order: str) -> None:
    size, number = np.dtype(field.ros_name).itemsize, str(field.length or "n")
    if not field.length:
        source.add(*[f"if n: p += ({_START} - p) % {size}"] * (size > 4))
        source.add(f"if n * {size} > end - p: raise DecodeError('a length of %d, more than it holds' % n)")
    native = "" if order == "<" else f".astype({source.dtype(field, '<')})"
    source.add(
        f"{value} = np.frombuffer(buf, {source.dtype(field, order)}, {number}, p){native}; p += {number} * {size}"
    )


def _construction(kind: Any, place: str, values: dict[str, str], source: _Source) -> str:
    """The expression that makes the message from the variables in `values`."""
    if place in values:
        return values[place]
    arguments = [_construction(each.kind, f"{place}.{each.name}", values, source) for each in fields_of(kind)]
    return f"{source.name('T', kind)}({', '.join(arguments)})"


def adopt(message: M) -> M:
    """This very message as receivers in this process are to see it: the sender changes it no more, nor what it holds.

    Its float32 fields are narrowed, and its arrays become read-only. The sender answers for the rest: numbers are plain
    ones that fit their fields, and finite where they must be, and an array that is read-only has the type of its field.
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
    source = _Source()
    narrow = []
    for place, field, _ in _flat(kind, "m"):
        if field.length is None:
            narrow += [place] * (field.ros_name == "float32")
        elif field.kind is None:
            changed = f"{source.name('Q', _read_only)}({place}, {source.dtype(field, '<')})"
            source.add(f"if {place}.flags.writeable: {place} = {changed}")
        elif (adopter := _adopter(field.kind)) is not None:
            source.add(f"for e in {place}: {source.name('R', adopter)}(e)")
    if narrow:
        packer = source.name("S", struct.Struct(f"<{len(narrow)}f"))
        source.add(f"{', '.join(narrow)}, = {packer}.unpack({packer}.pack({', '.join(narrow)}))")
    return source.compile("def f(m):", f"adopt {kind.__name__}") if source.lines else None
