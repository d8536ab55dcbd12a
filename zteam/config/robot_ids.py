"""One grammar for the ids of several robots, wherever a user types them: `0 1 2 3`, `0-3`, `0,2-4`, `0 2-4`."""

import re
from collections.abc import Iterable, Mapping, Sequence

from zteam import names
from zteam.config.numbers import shown
from zteam.errors import UsageError

_SEPARATOR = re.compile(r"\s*,\s*|\s+")


def parse_robot_ids(words: Sequence[str], place: str) -> tuple[int, ...]:
    """The ids that the words of a user name, in their order; commas and spaces separate them, and `A-B` is a range.

    Raises UsageError that begins with `place`, such as "--ids". No id may come twice: at most MAX_ROBOT_ID + 1 come.
    """
    text = " ".join(words).strip()
    if not text:
        raise UsageError(f"{place}: no id is given: give robot ids such as 0 2 5, 0-3 or 0,2-4")
    found: dict[int, None] = {}
    for item in _SEPARATOR.split(text):
        for robot_id in _parse_item(item, place):
            if robot_id in found:
                raise UsageError(f"{place} names a robot twice: {robot_id}")
            found[robot_id] = None
    return tuple(found)


def format_robot_ids(ids: Iterable[int]) -> str:
    """The ids, sorted, as `parse_robot_ids` reads them, with ranges from three ids on: `0-3, 7, 8`; empty for none."""
    runs: list[list[int]] = []
    for robot_id in sorted(set(ids)):
        if runs and robot_id == runs[-1][-1] + 1:
            runs[-1].append(robot_id)
        else:
            runs.append([robot_id])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)


def _parse_item(item: str, place: str) -> range:
    first_text, dash, last_text = item.partition("-")
    try:
        first = names.parse_robot_id(first_text)
        last = names.parse_robot_id(last_text) if dash else first
    except UsageError:
        text = f"give robot ids from 0 to {names.MAX_ROBOT_ID}, such as 0 2 5, 0-3 or 0,2-4"
        raise UsageError(f"{place}: {shown(item)}: {text}") from None
    if first > last:
        raise UsageError(f"{place}: {shown(item)}: the first id is above the last")
    return range(first, last + 1)


def circle_from(robot_id: int, leaders: Mapping[int, int | None]) -> list[int]:
    """`1, 2, 1` if `robot_id` is part of a circle of robots that follow each other, else empty."""
    chain = chain_from(robot_id, leaders)
    return chain if chain[1:] and chain[-1] == robot_id else []


def chain_from(robot_id: int, leaders: Mapping[int, int | None]) -> list[int]:
    """The robot, the one that it follows, and so on to the head, or to the first one that is there twice."""
    chain = [robot_id]
    while (leader := leaders.get(chain[-1])) is not None:
        chain.append(leader)
        if leader in chain[:-1]:
            break
    return chain
