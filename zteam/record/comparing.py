"""Compares two runs in lock-step by their recordings: what participants have published in each tick.

What belongs to no tick is left out: logs, statuses, and what tools publish. So is what a run does not repeat: the ids
of sessions in its ticks. Bytes are compared, and messages are decoded only where these differ.
"""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from zteam import names
from zteam.config.numbers import counted
from zteam.errors import DecodeError, UsageError
from zteam.messages import Done, Input, Message, Tick, decode, encode
from zteam.messages.topics import has_one_writer, is_measured
from zteam.record.gathering import TRUTH
from zteam.record.recording import Recording

Number = tuple[int, int]
"""How often the world has begun anew, and the tick."""
Found = dict[str, list[bytes]]
"""What was published in a tick, by key."""
_LATE = 3
"""Ticks after which nothing of a tick comes any more; a message of one tick may lie behind the next tick's."""
_OF_NAVIGATION = frozenset({
    names.AMCL_POSE, names.CMD_VEL_NAV, names.GLOBAL_COSTMAP, names.LOCAL_COSTMAP, names.LOCAL_PLAN,
    names.PARTICLE_CLOUD, names.PLAN, names.PUBLISHED_FOOTPRINT,
})  # fmt: skip


class Difference(msgspec.Struct, frozen=True):
    """The first thing that differs."""

    tick: int
    key: str
    process: str
    """The name of the process that publishes the key, if that is known."""
    field: str
    """Such as `pose.pose.position.x` or `ranges[12]`; empty where messages are missing in one of them."""
    a: str | None
    """The value; without a field, how many messages there are in this tick; None if there is none."""
    b: str | None

    @property
    def text(self) -> str:
        """In a line."""
        where = f"tick {self.tick}: {self.key}{f' of {self.process}' if self.process else ''}"
        if self.field:
            return f"{where}: {self.field} is {self.a} in A, {self.b} in B"
        if self.a is None or self.b is None:
            return f"{where} is in {'A' if self.b is None else 'B'} alone"
        return f"{where}: {self.a} in A, {self.b} in B"


class ComparedTopic(msgspec.Struct):
    key: str
    type: str = ""
    a: int = 0
    """Messages that were compared."""
    b: int = 0
    differing: int = 0
    """Ticks in which it differs."""
    first: int | None = None
    """The first of these."""


class Comparison(msgspec.Struct):
    """The result; the runs are the same if there is no difference."""

    difference: Difference | None
    ticks: int
    """That were compared."""
    topics: list[ComparedTopic]
    left_out: list[str]
    """Keys on which nothing belongs to a tick, and those that were to be ignored."""
    notes: list[str]
    """What makes the result doubtful, in words."""


class _Run:
    """One recording: its ticks, one after the other."""

    def __init__(self, path: Path, ignore: tuple[str, ...]) -> None:
        self.recording = Recording(path)
        self.types: dict[str, str] = {}
        self.beside: set[str] = set()
        self._ignore = ignore
        self._ignored: dict[str, bool] = {}

    def _is_ignored(self, key: str) -> bool:
        if key not in self._ignored:
            from zteam.bus.transport import matches

            self._ignored[key] = any(matches(each, key) for each in self._ignore)
        return self._ignored[key]

    def ticks(self) -> Iterator[tuple[Number, Found]]:
        """Each tick and what was published in it.

        Left out are those that were not over, and of the first tick, which is held until all have joined, all but the
        commands.
        """
        opened: dict[int, Found] = {}
        world, newest, over = 0, 0, 0

        def close(last: int) -> Iterator[tuple[Number, Found]]:
            nonlocal over
            for each in sorted(each for each in opened if each <= last):
                yield (world, each), opened.pop(each)
            over = max(over, last)

        for key, kind, _, data, number in self.recording.entries():
            if not number or self._is_ignored(key):
                self.beside.add(key)
                continue
            if key == names.TICK:
                if number < newest:
                    # The world begins anew.
                    yield from close(newest - 1)
                    opened.clear()
                    world, over = world + 1, 0
                newest = number
            is_command = names.process_of(key, names.DONE) is not None
            if (number > 1 or is_command) and (content := _repeated(key, data)) is not None:
                self.types[key] = kind
                found = opened.setdefault(max(number, over + 1), {}).setdefault(key, [])
                if number == 1:
                    # The answer to GO replaces those before.
                    found.clear()
                # A tick is sent again where another session joins.
                if key != names.TICK or content not in found:
                    found.append(content)
            if number - _LATE > over:
                yield from close(number - _LATE)
        yield from close(newest - 1)


def _repeated(key: str, data: bytes) -> bytes | None:
    """What another run repeats of a message; None if that is nothing."""
    try:
        if key == names.TICK:
            tick = decode(Tick, data)
            inputs = [Input(key=each.key, type=each.type, data=each.data) for each in tick.inputs]
            return encode(Tick(robots=tick.robots, inputs=inputs))
        if names.process_of(key, names.DONE) is not None:
            done = decode(Done, data)
            return encode(Done(has_command=True, command=done.command)) if done.has_command else None
    except DecodeError:
        pass
    return data


def compare(
    a: Path,
    b: Path,
    atol: float = 0.0,
    ignore: tuple[str, ...] = (),
    on_tick: Callable[[int], object] | None = None,
    until: int | None = None,
) -> Comparison:
    """Compare two recordings of runs in lock-step.

    Numbers may differ by `atol` in their own units. `ignore` are key expressions. `on_tick(tick)` is called after each
    tick; the comparison ends before tick `until`. Where several processes may publish a key, the order of its messages
    within a tick does not matter. Where one recording ends earlier, the first tick that it lacks is a difference.
    Raises UsageError for what is no recording, or one without ticks.
    """
    runs = _Run(a, ignore), _Run(b, ignore)
    topics: dict[str, ComparedTopic] = {}
    first: Difference | None = None
    ticks = 0
    for (_, tick), of_a, of_b in _paired(runs[0].ticks(), runs[1].ticks()):
        if until is not None and tick >= until:
            break
        ticks += 1
        for key in of_a.keys() | of_b.keys():
            topic = topics.get(key) or topics.setdefault(key, ComparedTopic(key))
            topic.a, topic.b = topic.a + len(of_a.get(key, ())), topic.b + len(of_b.get(key, ()))
        changed = [] if of_a == of_b else sorted((key for key in topics if of_a.get(key) != of_b.get(key)), key=_rank)
        for key in changed:
            topic = topics[key]
            if topic.first is None or atol:
                found = _difference(runs, key, of_a.get(key, []), of_b.get(key, []), atol)
                if found is None:
                    continue
                first = first or Difference(tick, key, publisher_of(key), *found)
                topic.first = topic.first or tick
            topic.differing += 1
        if on_tick is not None:
            on_tick(tick)
    for run in runs:
        if not run.types:
            raise UsageError(f"{run.recording.path} has no ticks: only runs in lock-step are compared")
    for key, topic in topics.items():
        topic.type = runs[0].types.get(key) or runs[1].types[key]
    left_out = sorted((runs[0].beside | runs[1].beside) - topics.keys())
    return Comparison(first, ticks, sorted(topics.values(), key=lambda each: each.key), left_out, list(_notes(runs)))


def _paired(
    a: Iterator[tuple[Number, Found]], b: Iterator[tuple[Number, Found]]
) -> Iterator[tuple[Number, Found, Found]]:
    """The ticks of both in turn, and where one of them ends earlier, the first that it lacks."""
    of_a, of_b = next(a, None), next(b, None)
    while of_a is not None and of_b is not None:
        number = min(of_a[0], of_b[0])
        has_a, has_b = of_a[0] == number, of_b[0] == number
        yield number, of_a[1] if has_a else {}, of_b[1] if has_b else {}
        of_a, of_b = next(a, None) if has_a else of_a, next(b, None) if has_b else of_b
    if of_a is not None:
        yield of_a[0], of_a[1], {}
    elif of_b is not None:
        yield of_b[0], {}, of_b[1]


def _difference(
    runs: tuple[_Run, _Run], key: str, of_a: list[bytes], of_b: list[bytes], atol: float
) -> tuple[str, str | None, str | None] | None:
    """Field and values of the first difference on a key within a tick, whose bytes differ."""
    if of_a and of_b:
        kinds = [run.types[key] for run in runs]
        if kinds[0] != kinds[1]:
            return "type", kinds[0], kinds[1]
        texts = [run.recording.definitions[kinds[0]] for run in runs]
        if texts[0] != texts[1]:
            return "type", kinds[0], f"{kinds[1]} with other fields"
        if not has_one_writer(key) and sorted(of_a) == sorted(of_b):
            return None
        kind = runs[0].recording.type_of(kinds[0])
        for one, other in zip(of_a, of_b, strict=False):
            if one != other and (found := _unlike_messages(kind, one, other, atol)):
                return found
    counts = [counted(len(each), "message") if each else None for each in (of_a, of_b)]
    return None if len(of_a) == len(of_b) else ("", counts[0], counts[1])


def _unlike_messages(kind: type[Message], a: bytes, b: bytes, atol: float) -> tuple[str, str, str] | None:
    try:
        return _unlike(decode(kind, a), decode(kind, b), atol, "")
    except DecodeError:
        # What is no message of its type.
        return "bytes", a.hex(" ")[:60], b.hex(" ")[:60]


def _unlike(a: Any, b: Any, atol: float, place: str) -> tuple[str, str, str] | None:
    """The first field that differs, and both values. A NaN is like any other one, -0.0 is not 0.0 unless `atol`."""
    if isinstance(a, Message):
        dot = "." if place else ""
        for name in a.__struct_fields__:
            if found := _unlike(getattr(a, name), getattr(b, name), atol, f"{place}{dot}{name}"):
                return found
    elif isinstance(a, str | int | float):
        if str(a) != str(b) and not (atol and not isinstance(a, str) and abs(a - b) <= atol):
            return place, str(a), str(b)
    elif len(a) != len(b):
        return f"{place}.length", str(len(a)), str(len(b))
    elif isinstance(a, np.ndarray):
        apart = a != b
        if a.dtype.kind == "f":
            with np.errstate(invalid="ignore"):
                apart = ~(np.abs(a - b) <= atol) & apart if atol else apart | (np.signbit(a) != np.signbit(b))
            apart &= ~(np.isnan(a) & np.isnan(b))
        elif atol:
            apart &= np.abs(a.astype(float) - b) > atol
        if apart.any():
            first = int(apart.argmax())
            return f"{place}[{first}]", str(a[first]), str(b[first])
    else:
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            if found := _unlike(one, other, atol, f"{place}[{i}]"):
                return found
    return None


@cache
def publisher_of(key: str) -> str:
    """The name of the process that publishes a key in lock-step; empty where that may be any."""
    if (name := names.process_of(key, names.DONE)) is not None:
        return name
    if key == names.TICK or (is_measured(key) and not key.endswith(f"/{names.CMD_VEL}")):
        return names.SIMULATOR
    if key in (names.TF, names.TF_STATIC):
        return names.AGGREGATOR
    if (target := names.split_robot_key(key)) is not None:
        robot_id, topic = target
        if topic in _OF_NAVIGATION:
            return names.navigation_name(robot_id)
        return names.robot_name(robot_id) if topic == names.CMD_VEL else ""
    return ""


@cache
def _rank(key: str) -> tuple[int, str]:
    """The order in which a tick comes about, so that the first difference is a cause of the others."""
    if key == TRUTH:
        return 9, key
    if names.process_of(key, names.DONE) is not None or key.endswith(f"/{names.CMD_VEL}"):
        return 5, key
    if key == names.TICK or key.endswith(f"/{names.GROUND_TRUTH}"):
        return int(key != names.TICK), key
    return 2 if is_measured(key) else 3 if key == names.TF else 4, key


def _notes(runs: tuple[_Run, _Run]) -> Iterator[str]:
    recordings = [run.recording for run in runs]
    versions = [each.facts.get("version", "") for each in recordings]
    if versions[0] != versions[1]:
        yield f"{recordings[0].path} is of zteam {versions[0]}, {recordings[1].path} of {versions[1]}"
    for recording in recordings:
        facts = recording.end_facts
        if not facts or "recovered" in facts:
            yield f"{recording.path} was cut off"
        if gaps := facts.get("gaps"):
            yield f"{recording.path} lacks messages: {gaps.splitlines()[0]}"
        for stray in facts.get("stray", "").splitlines():
            name, _, key = stray.partition(" ")
            yield f"{recording.path}: {name} publishes {key} outside of its steps, so this run does not repeat"
