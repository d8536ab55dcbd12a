"""Hostile payloads: arbitrary bytes, valid ones that were damaged, and messages with extreme values; the keys and
queries that get them."""

import re
from collections.abc import Iterator, Sequence
from copy import deepcopy
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from hypothesis import strategies as st

from support.pages import DOCS
from support.strategies import messages
from zteam.messages import Message, encode
from zteam.messages.topics import type_of_key

NUMBERS = (b"0", b"-1", b"1e308", b"1e400", b"-1e-308", b"nan", b"inf", b"9" * 400, b"18446744073709551616", b"0x7f")
"""Written numbers that a reader may not expect."""
BYTES = (
    b"\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xf0\0\0\0\0\0\0",
    b"\0\0\0\x80",
    b"\xf0\x9f\xa4\x96",
    b"\xed\xa0\x80",
    b"\r\n",
)
_SYNTAX = (
    b"(",
    b")" * 40,
    b"[" * 400,
    b"]",
    b"{",
    b'"',
    b"'",
    b"<",
    b"${a}",
    b"../",
    b"&a *a",
    b"#",
    b"=",
    b"/dev/null",
)


class Edit(NamedTuple):
    """One place that is damaged."""

    action: str
    place: float
    """From 0, the first byte, to 1."""
    length: int
    text: bytes


def damage(payload: bytes, edits: Sequence[Edit]) -> bytes:
    """The payload after these edits, in their order."""
    for action, place, length, text in edits:
        at = round(place * len(payload))
        before, part, after = payload[:at], payload[at : at + length], payload[at + length :]
        if action == "overwrite":
            payload = before + text + payload[at + len(text) :]
        elif action == "replace":
            payload = before + text + after
        elif action == "repeat":
            payload = before + part * min(200, 1 + len(text) * 8) + after
        elif action == "cut":
            payload = before
        else:
            # Two parts change places: each is valid, but not there.
            payload = after[: len(part)] + before + part + after[len(part) :]
    return payload


def damaged(valid: st.SearchStrategy[bytes], words: Sequence[bytes] = ()) -> st.SearchStrategy[bytes]:
    """Arbitrary bytes, and valid ones with up to six damaged places; `words` are those of the language."""
    texts = st.sampled_from([*NUMBERS, *BYTES, *_SYNTAX, *words]) | st.binary(max_size=6)
    actions = st.sampled_from(["overwrite", "replace", "replace", "repeat", "cut", "swap"])
    edits = st.lists(st.builds(Edit, actions, st.floats(0.0, 1.0), st.integers(0, 24), texts), min_size=1, max_size=6)
    return st.builds(damage, valid, edits) | st.binary(max_size=200)


def listed(heading: str) -> list[str]:
    """The keys in the first column of the table below a heading of the page of keys, as the page writes them."""
    section = (DOCS / "keys.md").read_text().split(f"\n## {heading}\n")[1].split("\n## ")[0]
    found = list[str]()
    for row in re.findall(r"^\| (`.*?) \|", section, re.MULTILINE):
        keys = re.findall(r"`([^`]+)`", row)
        robot = "robot_N/" if keys[0].startswith("robot_N/") else ""
        # In a row of a robot's topics the later ones have no robot.
        found += [
            key if "/" in key and key.startswith(("robot_N/", "<", "@")) else robot + key.removeprefix(robot)
            for key in keys
        ]
    return found


def expanded(keys: Sequence[str], processes: Sequence[str], robots: Sequence[int]) -> list[str]:
    """These keys for each process and robot of a team."""
    return sorted({each for key in keys for each in _expanded(key, processes, robots)})


def _expanded(key: str, processes: Sequence[str], robots: Sequence[int]) -> Iterator[str]:
    key = key.replace("sonar_i", "sonar_0").replace("<instance>", "*")
    if "<name>" in key:
        yield from (key.replace("<name>", name) for name in processes)
    elif "robot_N" in key:
        yield from (key.replace("robot_N", f"robot_{robot_id}") for robot_id in robots)
    else:
        yield key


def payloads_of(key: str) -> st.SearchStrategy[bytes]:
    """Damaged messages of the type that a key carries."""
    kind = type_of_key(key)
    assert kind is not None, key
    return damaged(messages(kind).map(encode))


def _requests(kind: type[msgspec.Struct]) -> Iterator[type[msgspec.Struct]]:
    if kind.__name__.endswith("Request") and kind.__module__.startswith("zteam."):
        yield kind
    for inner in kind.__subclasses__():
        yield from _requests(inner)


def requests() -> st.SearchStrategy[bytes]:
    """Requests with fields of zteam's own, whose values may be any; some of them are damaged."""
    fields = sorted({field for kind in _requests(msgspec.Struct) for field in kind.__struct_fields__})
    texts = st.text(max_size=8) | st.sampled_from(["robot_0/base_link", "map", "erratic", "", "robot_1/odom"])
    scalars = st.none() | st.booleans() | st.integers(-3, 9) | st.integers() | st.floats(allow_nan=False) | texts
    values = st.recursive(
        scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3)
    )
    valid = st.dictionaries(st.sampled_from(fields) | texts, values, max_size=6).map(_as_json)
    return damaged(valid) | valid


def _as_json(value: Any) -> bytes:
    return msgspec.json.encode(value)


_FLOATS = (np.inf, -np.inf, np.nan, 5e-324, -0.0)
_LONG = 5000
_TEXTS = ("", "x" * _LONG, "/", "robot_2", "robot_0/base_link", "map", "\x1b[2J\n", "robot_99999999999/odom")


def _numbers(wire: str) -> tuple[Any, ...]:
    """The extreme values of a number on the wire."""
    if wire == "bool":
        return False, True
    if wire.startswith("float"):
        most = float(np.finfo(wire).max)
        return *_FLOATS, most, -most, 1e9, -1e9
    limits = np.iinfo(wire)
    return tuple({int(limits.min), int(limits.max), 0, 1, int(limits.max) // 2 + 1})


def _extremes_of(hint: Any, value: Any) -> Iterator[Any]:
    if isinstance(hint, type) and issubclass(hint, Message):
        yield from extremes(value)
    elif get_origin(hint) is list:
        (kind,) = get_args(hint)
        one = value[0] if value else kind()
        yield from ([], [one] * 300)
        yield from ([each, *value[1:]] for each in _extremes_of(kind, one))
    elif hint is str:
        yield from _TEXTS
    else:
        base, bracket, count = get_args(hint)[1].partition("[")
        if not bracket:
            yield from _numbers(base)
            return
        size = len(value) or 5
        if count == "]":
            yield from (np.zeros(0, base), np.zeros(1, base), np.zeros(_LONG, base))
        for number in _numbers(base):
            mixed = np.array(value, base) if len(value) else np.zeros(int(count[:-1]) if count != "]" else size, base)
            yield np.full(len(mixed), number, base)
            mixed[::2] = number
            yield mixed


def extremes(message: Message) -> Iterator[Any]:
    """The message with each of its fields in turn at each of its extreme values; the others stay as they are."""
    hints = get_type_hints(type(message), include_extras=True)
    for field in message.__struct_fields__:
        for value in _extremes_of(hints[field], getattr(message, field)):
            changed = deepcopy(message)
            setattr(changed, field, value)
            yield changed
