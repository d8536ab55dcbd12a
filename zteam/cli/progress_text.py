"""How far a run is, in words and as a bar."""

from collections.abc import Iterator

from zteam.config.numbers import counted, format_factor
from zteam.team.launch.progress import Overview

_BAR = (8, 40)
"""The fewest and the most columns of a bar."""


def progress_line(seen: Overview, run_for: float | None, columns: int) -> str:
    """One line of at most `columns` ASCII characters; with `run_for`, simulated seconds from GO, with a bar."""
    text = _joined(_after_go(seen, run_for) if seen.begun else _before_go(seen), columns)
    room = min(columns - len(text) - 1, _BAR[1])
    if run_for and seen.elapsed is not None and room >= _BAR[0]:
        text = f"{bar(min(1.0, seen.elapsed / run_for), room)} {text}"
    return text


def _joined(parts: Iterator[str], columns: int) -> str:
    """The first parts that fit; of the very first, as much as fits."""
    text = ""
    for part in parts:
        # Words from the bus: characters of two columns, or of none, would break the line.
        plain = "".join(c if c.isprintable() else " " for c in part.encode("ascii", "backslashreplace").decode())
        longer = f"{text}, {plain}" if text else plain[: max(0, columns)]
        if len(longer) > columns:
            break
        text = longer
    return text


def _before_go(seen: Overview) -> Iterator[str]:
    """One part, because a long list of what is missing is worth being cut."""
    team = seen.team
    if team is None:
        yield "starting"
        return
    paused = ", paused" if seen.simulator is not None and seen.simulator.paused else ""
    waiting = f", waiting for {team.waiting_for}" if team.waiting_for else ""
    yield f"before GO: {len(team.ready)} of {counted(seen.robots, 'robot')} ready{paused}{waiting}"


def _after_go(seen: Overview, run_for: float | None) -> Iterator[str]:
    simulator, elapsed = seen.simulator, seen.elapsed
    if simulator is not None and elapsed is not None:
        yield _time_text(elapsed, run_for)
        if simulator.finished:
            yield "finished"
        elif simulator.paused:
            yield "paused"
        elif seen.held_by:
            yield f"held by {seen.held_by}"
        else:
            yield from _pace(elapsed, run_for, simulator.real_time_factor)
    elif seen.is_simulated:
        yield "the simulator does not answer"
    yield f"{seen.driving} of {counted(seen.robots, 'robot')} driving"


def _time_text(elapsed: float, run_for: float | None) -> str:
    shown = f"{elapsed:.1f}" if elapsed < 1000.0 else f"{elapsed:.0f}"
    return f"{shown} s simulated" if run_for is None else f"{shown} of {run_for:g} s"


def _pace(elapsed: float, run_for: float | None, factor: float) -> Iterator[str]:
    yield f"{format_factor(factor)} x real time"
    if run_for is not None and factor > 0.0:
        yield f"{duration_text(max(0.0, run_for - elapsed) / factor)} left"


def duration_text(seconds: float) -> str:
    """Seconds as a reader counts them: 42 s, 3 min 20 s, 2 h 05 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole // 3600} h {whole // 60 % 60:02} min"


def bar(share: float, width: int) -> str:
    filled = int(share * (width - 2))
    return f"[{'#' * filled}{'-' * (width - 2 - filled)}]"
