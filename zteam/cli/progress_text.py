"""How far a run is, in words and as a bar."""

from collections.abc import Iterator

from zteam.config.numbers import counted, format_factor
from zteam.team.launch.progress import Overview


def progress_line(seen: Overview, run_for: float | None) -> str:
    """What a team does; `run_for`, if given, is its end in simulated seconds from GO."""
    return ", ".join(_after_go(seen, run_for) if seen.begun else _before_go(seen))


def _before_go(seen: Overview) -> Iterator[str]:
    team = seen.team
    if team is None:
        yield "starting"
        return
    yield f"before GO: {len(team.ready)} of {counted(seen.robots, 'robot')} ready"
    if seen.simulator is not None and seen.simulator.paused:
        yield "paused"
    if team.waiting_for:
        yield f"waiting for {team.waiting_for}"


def _after_go(seen: Overview, run_for: float | None) -> Iterator[str]:
    simulator, elapsed = seen.simulator, seen.elapsed
    if simulator is not None and elapsed is not None:
        shown = f"{elapsed:.1f}" if elapsed < 1000.0 else f"{elapsed:.0f}"
        yield f"{shown} s simulated" if run_for is None else f"{shown} of {run_for:g} s"
        if simulator.finished:
            yield "finished"
        elif simulator.paused:
            yield "paused"
        elif seen.held_by:
            yield f"held by {seen.held_by}"
        else:
            factor = simulator.real_time_factor
            yield f"{format_factor(factor)} x real time"
            if run_for is not None and factor > 0.0:
                yield f"{duration_text(max(0.0, run_for - elapsed) / factor)} left"
    elif seen.is_simulated:
        yield "the simulator does not answer"
    yield f"{seen.driving} of {counted(seen.robots, 'robot')} driving"


def duration_text(seconds: float) -> str:
    """Seconds as a reader counts them: 42 s, 3 min 20 s, 2 h 05 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole // 3600} h {whole // 60 % 60:02} min"


def bar(share: float, width: int) -> str:
    filled = int(min(1.0, share) * (width - 2))
    return f"[{'#' * filled}{'-' * (width - 2 - filled)}]"
