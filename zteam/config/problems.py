"""Checks a table that a user wrote against a struct type, and tells all mistakes at once."""

import json
import os
import re
import reprlib
from collections.abc import Iterable, Mapping
from functools import cache
from numbers import Integral, Real
from typing import Any, NamedTuple, get_args

import msgspec

from zteam.config.toml_values import KeyPath
from zteam.errors import did_you_mean

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STEP = re.compile(r"\.([^.\[]+)|\[(\d+)\]")
_EXPECTED = re.compile(r"Expected `([^`]+)`(?: of length)?(?: (<=|>=|<|>) (\S+)| (\d+))?(?:, got .+)?")
"""What msgspec says of a value of a wrong type, out of bounds, or of a wrong length."""
_WORDS = {
    "float": "a number", "int": "a whole number", "str": "a text", "bool": "true or false", "array": "a list",
    "object": "a table",
}  # fmt: skip
_BOUNDS = {"<=": "of at most", ">=": "of at least", "<": "below", ">": "above"}
_UNITS = {"str": " characters", "array": " values"}


class KeyValueError(ValueError):
    """What a struct's own check finds: a key, and what is wrong with its value."""

    def __str__(self) -> str:
        return " ".join(self.args)


class Problem(NamedTuple):
    """One mistake: the path of the key, what is wrong with its value, and what is allowed."""

    path: KeyPath
    text: str

    def __str__(self) -> str:
        """`robots[1].speed: text`, with quotes around a key that needs them."""
        words = [part if isinstance(part, int) or _BARE.fullmatch(part) else json.dumps(part) for part in self.path]
        path = "".join(f"[{word}]" if isinstance(word, int) else f".{word}" for word in words).removeprefix(".")
        return f"{path}: {self.text}" if path else self.text


class CheckedOptions(msgspec.Struct, frozen=True):
    """Options whose types hold wherever they are made, also in Python. Raises ValueError."""

    def __post_init__(self) -> None:
        for field in _fields_of(type(self)).values():
            value = plain(getattr(self, field.name))
            for problem in _problem(value, field.type, (field.name,), strict=True):
                raise ValueError(str(problem))
            msgspec.structs.force_setattr(self, field.name, msgspec.convert(value, field.type))


def plain(value: Any) -> Any:
    """The value as msgspec reads it: it knows no numbers of numpy, no ranges and no paths."""
    if isinstance(value, str | bool | os.PathLike):
        return os.fspath(value) if isinstance(value, os.PathLike) else value
    if isinstance(value, Real):
        return int(value) if isinstance(value, Integral) else float(value)
    if isinstance(value, Mapping):
        return {plain(key): plain(inner) for key, inner in value.items()}
    return [plain(inner) for inner in value] if isinstance(value, Iterable) else value


def problems_of(
    table: Any,
    kind: type[msgspec.Struct],
    path: KeyPath = (),
    *,
    takes: str = "known:",
    near: Iterable[str] = (),
    strict: bool = True,
) -> list[Problem]:
    """Every mistake in the keys of `table`, which is at `path` in its file.

    `takes` introduces the list of known keys in a message; `near` are further words that an unknown key may stand for.
    Unless it is `strict`, a text may stand for a number, as in msgspec.
    """
    if not isinstance(table, Mapping):
        return [Problem(path, f"a table is expected, not {_shown(table)}")]
    fields = _fields_of(kind)
    found = []
    for key, value in table.items():
        if key in fields:
            inner = fields[key].type
            config = getattr(inner, "__struct_config__", None)
            is_table = config is not None and config.tag is None and not config.array_like
            found += (problems_of if is_table else _problem)(value, inner, (*path, key), strict=strict)
        elif kind.__struct_config__.forbid_unknown_fields:
            listed = f"{takes} {', '.join(fields) or 'no parameters'}"
            found.append(Problem((*path, key), f"unknown key{did_you_mean(key, [*near, *fields])}; {listed}"))
    for name, field in fields.items():
        if field.required and name not in table:
            found.append(Problem(path, f"the key {name} is missing"))
    return found or _problem(table, kind, path, strict=strict)


@cache
def _fields_of(kind: type[msgspec.Struct]) -> dict[str, msgspec.structs.FieldInfo]:
    """The fields of a type by key: msgspec resolves their annotations anew in each call, which takes 0.1 ms."""
    return {field.encode_name: field for field in msgspec.structs.fields(kind)}


def _problem(value: Any, kind: Any, path: KeyPath, *, strict: bool) -> list[Problem]:
    try:
        msgspec.convert(value, kind, strict=strict)
    except msgspec.ValidationError as error:
        text, at, place = " ".join(str(error).split()).rpartition(" - at `")
        inner = [int(index) if index else name for name, index in _STEP.findall(place)] if at else []
        for step in inner:
            value = value[step]
        if isinstance(error.__cause__, KeyValueError):
            key, text = error.__cause__.args
            return [Problem((*path, *inner, key), text)]
        choices = f"; one of {', '.join(_words_of(kind))}" if "enum value" in place else ""
        return [Problem((*path, *inner), _in_words(text if at else place, value) + choices)]
    return []


def _in_words(text: str, value: Any) -> str:
    """msgspec's text about `value` in plain words; a text of another form is left as it is."""
    found = _EXPECTED.fullmatch(text)
    if found is None:
        return text
    kinds = [kind for kind in found[1].split(" | ") if kind != "null"]
    if any(kind not in _WORDS for kind in kinds):
        return text
    what = " or ".join(_WORDS[kind] for kind in kinds)
    if found[2] or found[4]:
        bound = found[3] or found[4]
        unit = _UNITS.get(kinds[0], "").removesuffix("s" if bound == "1" else "")
        # msgspec writes "below 0" as -0.0.
        what += f" {_BOUNDS.get(found[2], 'of')} {float(bound) + 0.0:g}{unit}"
    return f"{what} is expected, not {_shown(value)}"


def _shown(value: Any) -> str:
    # Aliases of YAML make short files whose full text would fill the memory.
    is_plain = not isinstance(value, list | dict)
    text = json.dumps(value, default=str, ensure_ascii=False) if is_plain else reprlib.repr(value)
    return text if len(text) <= 40 else f"{text[:39]}…"


def _words_of(kind: Any) -> list[str]:
    """All words that a type allows, as in `Annotated[Literal["amcl", "fake"] | None, …]`."""
    return [kind] if isinstance(kind, str) else [word for part in get_args(kind) for word in _words_of(part)]
