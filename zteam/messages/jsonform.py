"""Messages as JSON, for tools and scripts: ROS's field names, arrays as lists, inf and NaN as null."""

import contextlib
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import msgspec
import numpy as np

from zteam.errors import UsageError
from zteam.messages.geometry_msgs import TransformRows
from zteam.messages.message import Field, Message, fields_of
from zteam.messages.std_msgs import Header, Time

M = TypeVar("M", bound=Message)

_STAMPS: dict[tuple[type[Message], str], Callable[[Time], Message]] = {
    (Time, "now"): lambda now: now,
    (Header, "auto"): Header,
}
"""The words for the time, by the type in whose place they stand, and what they become."""
_MAX_FLOAT32 = float(np.finfo(np.float32).max)


def to_plain(value: Any, *, is_float32: bool = False) -> Any:
    """The message as dicts, lists, numbers and texts; numbers that JSON lacks become None.

    A float32 is the shortest decimal that is the same float32: 0.1, not 0.10000000149.
    """
    if isinstance(value, Message):
        shorts = {field.name: field.ros_name == "float32" for field in fields_of(type(value))}
        return {name: to_plain(getattr(value, name), is_float32=short) for name, short in shorts.items()}
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist(), is_float32=is_float32) if value.dtype.kind == "f" else value.tolist()
    if isinstance(value, list | TransformRows):
        return [to_plain(item, is_float32=is_float32) for item in value]
    if not isinstance(value, float):
        return value
    if not math.isfinite(value):
        return None
    return float(str(np.float32(value))) if is_float32 and abs(value) <= _MAX_FLOAT32 else value


def to_json(message: Message) -> bytes:
    return msgspec.json.encode(to_plain(message))


Now = Callable[[], Time]
"""The time that a user means by the words `now` for a stamp and `auto` for a header, as ROS 2's tools know them."""


def from_text(kind: type[M], text: str, now: Now | None = None) -> M:
    """The message that a user typed as JSON or as YAML (`{linear: {x: 0.2}}`); missing fields keep their defaults.

    Raises UsageError that names the field.
    """
    plain = _read(kind, text)
    return from_plain(kind, {} if plain is None else plain, now=now)


def from_words(kind: type[M], words: Sequence[str], now: Now | None = None) -> M:
    """The message of the words of a command line: one with its fields, or, as in ROS 1, one for each field."""
    if len(words) < 2:
        return from_text(kind, "".join(words), now)
    return from_plain(kind, _by_name(kind, [_read(kind, word) for word in words], kind.__name__), now=now)


def _read(kind: type[Message], text: str) -> Any:
    """What a text says as JSON or YAML. Raises UsageError."""
    with contextlib.suppress(msgspec.DecodeError, RecursionError):
        return msgspec.json.decode(text)
    import yaml

    from zteam.config.resources import load_yaml

    try:
        return load_yaml(text)
    except RecursionError:
        raise UsageError(f"{kind.__name__}: it is nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:
        # ValueError: a date that the calendar lacks.
        mark = getattr(error, "problem_mark", None)
        place = f" at character {mark.index + 1}" if mark is not None else ""
        told = " ".join(str(getattr(error, "problem", None) or error).split())
        example = "put all fields into one pair of single quotes, e.g. '{linear: {x: 0.5}}'"
        raise UsageError(f"{text!r} is neither JSON nor YAML{place}: {told}; {example}") from None


def from_plain(kind: type[M], plain: Any, path: str = "", now: Now | None = None) -> M:
    """The message of type `kind` from dicts and lists. As in ROS 1, a list can hold all fields of a nested message."""
    where, fields = path or kind.__name__, {field.name: field for field in fields_of(kind)}
    if isinstance(plain, str) and now is not None and (stamp := _STAMPS.get((kind, plain))):
        plain = to_plain(stamp(now()))
    if isinstance(plain, list) and path:
        plain = _by_name(kind, plain, where)
    if not isinstance(plain, dict):
        raise UsageError(f"{where}: expected fields such as {{{', '.join(fields)}}}, got {plain!r}")
    unknown = [str(name) for name in plain if name not in fields]
    if unknown:
        raise UsageError(f"{where} has no field {unknown[0]!r}: its fields are {', '.join(fields)}")
    values = {name: _value(fields[name], item, f"{where}.{name}", now) for name, item in plain.items()}
    for name, value in values.items() if kind.ros_type.startswith("geometry_msgs/") else ():
        # A place or a velocity; a range may be inf or nan.
        if isinstance(value, float | np.ndarray) and not np.isfinite(value).all():
            raise UsageError(f"{where}.{name}: expected a finite number, got {plain[name]!r}")
    return kind(**values)


def _by_name(kind: type[Message], values: list[Any], where: str) -> dict[str, Any]:
    fields = kind.__struct_fields__
    if len(values) != len(fields):
        raise UsageError(f"{where}: expected the values of {', '.join(fields)}, got {values!r}")
    return dict(zip(fields, values, strict=True))


def _value(field: Field, item: Any, path: str, now: Now | None) -> Any:
    if field.length is not None:
        if not isinstance(item, list):
            raise UsageError(f"{path}: expected a list, got {item!r}")
        if field.length and len(item) != field.length:
            raise UsageError(f"{path}: expected {field.length} numbers, got {len(item)}")
        single = field._replace(length=None)
        values = [_value(single, entry, f"{path}[{i}]", now) for i, entry in enumerate(item)]
        return values if field.kind is not None else np.array(values, field.ros_name)
    if field.is_message:
        return from_plain(field.kind, item, path, now)
    if field.kind is not str:
        return _number(field.ros_name, item, path)
    if not isinstance(item, str):
        raise UsageError(f"{path}: expected a text, got {item!r}")
    return item


def _number(base: str, item: Any, path: str) -> Any:
    is_number = isinstance(item, int | float) and not isinstance(item, bool)
    if base == "bool":
        expected = "true or false"
        if isinstance(item, bool):
            return item
    elif base.startswith("float"):
        most = float(np.finfo(base).max)
        expected = f"a number up to {most:.2g}" if is_number else "a number"
        if item is None or (is_number and not most < abs(item) < math.inf):
            return math.nan if item is None else float(item)
    else:
        limits = np.iinfo(base)
        expected = f"a whole number from {limits.min} to {limits.max}"
        if is_number and limits.min <= item <= limits.max and item == int(item):
            return int(item)
    raise UsageError(f"{path}: expected {expected}, got {item!r}")
