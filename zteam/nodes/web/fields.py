"""Fields of messages by their paths, such as `twist.twist.linear.x` or `ranges[3]`. Pure."""

import re
from typing import Any

from zteam.messages import Message

_PART = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)((?:\[[0-9]{1,6}\])*)", re.ASCII)


def parse_path(path: str) -> list[str | int] | None:
    """Names and positions; None for what is no path."""
    steps: list[str | int] = []
    for part in path.split("."):
        match = _PART.fullmatch(part)
        if match is None:
            return None
        steps.append(match[1])
        steps += [int(index) for index in re.findall(r"[0-9]+", match[2])]
    return steps


def number_at(message: Message, path: list[str | int]) -> float | None:
    """The number of a message at a path; None where there is none."""
    value: Any = message
    for step in path:
        try:
            if isinstance(step, int):
                value = value[step]
            elif isinstance(value, Message) and step in value.__struct_fields__:
                value = getattr(value, step)
            else:
                return None
        except (IndexError, TypeError, KeyError):
            return None
    if isinstance(value, Message | str | bytes | list):
        return None
    try:
        return float(value)
    except (TypeError, ValueError):
        return None
