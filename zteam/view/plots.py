"""Samples of single fields of messages, such as `twist.twist.linear.x`, `ranges[3]` or `min(ranges)`, for plots."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.clock import to_seconds
from zteam.messages import LaserScan, Message
from zteam.node.tick_messages import stamp_of
from zteam.view.received import Received

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


_LEAST = re.compile(r"min\((.+)\)")


def number_at(message: Message, path: list[str | int]) -> float | None:
    """The number of a message at a path; None where there is none."""
    value = _value_at(message, path)
    try:
        return None if value is None or isinstance(value, Message | str | bytes | list) else float(value)
    except (TypeError, ValueError):
        return None


def least_at(message: Message, path: list[str | int]) -> float | None:
    """The least number of a list; of a scan's ranges the least that is a distance. None where there is none."""
    try:
        values = np.asarray(_value_at(message, path), np.float64).ravel()
    except (TypeError, ValueError):
        return None
    lowest, highest = (message.range_min, message.range_max) if isinstance(message, LaserScan) else (-np.inf, np.inf)
    values = values[np.isfinite(values) & (values >= lowest) & (values < highest)]
    return float(values.min()) if values.size else None


def _value_at(message: Message, path: list[str | int]) -> Any:
    value: Any = message
    try:
        for step in path:
            if isinstance(step, int):
                value = value[step]
            elif isinstance(value, Message) and step in value.__struct_fields__:
                value = getattr(value, step)
            else:
                return None
        return value
    except (IndexError, TypeError, KeyError, ValueError):
        return None


MOST = 100
"""Samples of one field in a frame; of more, evenly spaced ones are taken."""


def samples_since(
    received: Received, topic: str, field: str, number: int, team_from_host: float
) -> tuple[int, NDArray[np.float64]]:
    """The number of the newest message, and pairs (n, 2) of time in s and value of those after `number`.

    The time is that of the message's header. For a type without one it is the host's time at which the message came,
    with `team_from_host` (s) added.
    """
    events = received.since(topic, number)
    least = _LEAST.fullmatch(field)
    path, read = parse_path(least[1] if least else field), least_at if least else number_at
    if not events or path is None:
        return (events[-1].number if events else number), np.zeros((0, 2))
    stride = max(1, -(-len(events) // MOST))
    pairs = []
    for event in events[::-stride][::-1]:
        message = event.read(event.kind) if event.kind else None
        value = None if message is None else read(message, path)
        if message is not None and value is not None:
            pairs.append((to_seconds(stamp_of(message)) or event.time + team_from_host, value))
    return events[-1].number, np.array(pairs, np.float64).reshape(-1, 2)
