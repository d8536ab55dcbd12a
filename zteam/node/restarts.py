"""What a launcher tells of the processes that it has started again."""

from collections.abc import Mapping

import msgspec

from zteam.config.numbers import counted


class Restarted(msgspec.Struct, frozen=True):
    """One process; `up/restarts` answers with all of them by name."""

    count: int
    """How often it was started again."""
    seconds: float | None = None
    """Host seconds from its failure until it was back, the longest of them; None if it never was."""


def restarts_text(restarts: Mapping[str, Restarted]) -> str:
    """In one line; empty if there are none."""
    told = [f"{name} {_times(restarted)}" for name, restarted in sorted(restarts.items())]
    return f"started again: {', '.join(told)}" if told else ""


def _times(restarted: Restarted) -> str:
    times, seconds = counted(restarted.count, "time"), restarted.seconds
    return times if seconds is None else f"{times} (back after {seconds:.1f} s)"
