"""The command line of the study `lines`, and its table."""

import pytest

from studies.command import build_parser
from studies.study.command import exit_code, format_study, progress_line, tasks_of
from studies.study.figures import Bounds, CaseFigures, summarize
from studies.study.one_run import Outcome, Row, Task
from zteam.errors import UsageError


def tasks(*words: str) -> list[Task]:
    """What a command line asks for."""
    return tasks_of(build_parser().parse_args(["lines", *words]))


def test_each_case_is_run_for_each_seed() -> None:
    """Cases one after the other; without options 24 seeds of 900 s."""
    assert tasks("line", "arena", "--seeds", "3-4", "--seconds", "60") == [
        Task(what, 60.0, seed) for what in ("line", "arena") for seed in (3, 4)
    ]
    assert [task.seed for task in tasks("line")] == list(range(1, 25))
    assert tasks("line", "--seeds", "7") == [Task("line", 900.0, 7)]


def test_runs_in_real_time_are_of_processes() -> None:
    """Without further options one seed of 60 s at speed 1; a speed without real time is refused."""
    assert tasks("line", "chain", "--real-time") == [
        Task(what, 60.0, 1, processes=True, speed=1.0) for what in ("line", "chain")
    ]
    assert tasks("line", "--real-time", "--speed", "4", "--seeds", "3", "--seconds", "9") == [
        Task("line", 9.0, 3, processes=True, speed=4.0)
    ]
    with pytest.raises(UsageError, match="--speed needs --real-time"):
        tasks("line", "--speed", "4")


def test_a_team_file_takes_its_arguments() -> None:
    """NAME=VALUE is an argument of the team files, not of the cases."""
    first, second = tasks("chain", "line", "speed=0.3", "--seeds", "1")
    assert (first.what, first.arguments) == ("chain", {"speed": "0.3"})
    assert second.arguments == {}


@pytest.mark.parametrize("seeds", ["a", "4-3", "-4", "1-", "1-2-3"])
def test_wrong_seeds_are_refused(seeds: str) -> None:
    """The text that was given, and what is right."""
    with pytest.raises(UsageError, match=r"give the first and the last"):
        tasks("line", f"--seeds={seeds}")


def test_a_team_that_is_not_there_is_refused() -> None:
    """Before anything runs."""
    with pytest.raises(UsageError, match=r"nosuch"):
        tasks("line", "nosuch")


def test_the_world_of_a_case_has_to_be_there() -> None:
    """The case `world` is nothing without one, and a world that is not there is named."""
    with pytest.raises(UsageError, match=r"--world FILE"):
        tasks("world")
    with pytest.raises(UsageError, match=r"nowhere"):
        tasks("line", "--world", "nowhere")


def figures(bounds: Bounds) -> CaseFigures:
    """Two runs."""
    rows = [
        Row(Task("line", 900.0, 1), Outcome(held={1: 0.9751}, still=12.3, share=0.9)),
        Row(Task("line", 900.0, 2), Outcome(held={1: 1.0}, still=0.1, share=0.94)),
    ]
    return summarize(rows, bounds)


def test_the_table_has_a_row_a_case_and_what_was_missed() -> None:
    """Figures with their units; the exit code is 1 where a bound is missed."""
    good, bad = figures(Bounds()), figures(Bounds(held=0.98))
    lines = format_study([good, bad]).splitlines()
    assert lines[0].split() == ["case", "runs", "s", "failed", "contacts", "held", "still,", "s", "share"]
    assert lines[1].split() == ["line", "2", "900", "0", "0", "0.975", "12.3", "0.92"]
    assert lines[-1] == "line: MISSED: held 0.9751, at least 0.98: robot 1, seed 1"
    assert (exit_code([good]), exit_code([good, bad])) == (0, 1)


def test_real_time_is_shown_beside_lockstep() -> None:
    """A row of medians for each; what differs too much is missed, and so is a run in lock-step that failed."""
    far, near = (Outcome(driven=[way, 9.0], gaps={1: 0.8}, stands=[1.0, 2.0], late=0.012) for way in (5.7, 9.0))
    real, lockstep = (
        [Row(Task("arena", 60.0, 1, processes=True, speed=speed), found)] for speed, found in ((1.0, far), (None, near))
    )
    case = summarize(real, Bounds(), [*lockstep, Row(lockstep[0].task, Outcome(error="no router"))])
    lines = format_study([case]).splitlines()
    rows = [line.split() for line in lines if line.startswith("arena")]
    assert rows[1:3] == [
        ["arena", "real", "time", "5.7", "9.0", "0.80", "0", "2.0", "1.2"],
        ["arena", "lock-step", "9.0", "9.0", "0.80", "0", "2.0", "1.2"],
    ]
    assert case.missed == [
        "seed 1: no router", "robot 0: driven 5.70 m, in lock-step 9.00 m: more than 10 % apart"
    ]  # fmt: skip
    assert exit_code([case]) == 1


def test_progress_says_how_long_the_rest_takes() -> None:
    """From the runs of this time alone: what the file had took no time."""
    assert progress_line(12, 24, 12, 0.0) == "[#########---------] 12 of 24 runs"
    assert progress_line(14, 24, 12, 60.0).endswith("14 of 24 runs, 5 min 00 s left")
    assert progress_line(24, 24, 12, 60.0).endswith("24 of 24 runs")
