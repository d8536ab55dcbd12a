"""The study `lines`: which runs it makes, what they give, what is kept, and what is judged."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from studies.command import build_parser, tasks_of
from studies.on_time import TooSlowError, run_on_time
from studies.study.cases import CASES, Case
from studies.study.driver import SPEED, draw_commands
from studies.study.figures import Bounds, disagreements, format_study, read_results, run_study, summarize
from studies.study.one_run import Outcome, Row, Task, distances, longest_stand, measure, pairs_of
from zteam.simulator.client import Latency, RobotReport, RunFigures
from zteam.team.file.reading import load_team


def tasks(*words: str) -> list[Task]:
    """What a command line asks for."""
    return tasks_of(build_parser().parse_args(["lines", *words]))


def test_each_case_is_run_for_each_seed() -> None:
    """Without options 24 seeds of 900 s in lock-step; in real time one of 60 s. A team file takes its arguments."""
    assert tasks("line", "arena", "--seeds", "3-4", "--seconds", "60") == [
        Task(what, 60.0, seed) for what in ("line", "arena") for seed in (3, 4)
    ]
    assert [task.seed for task in tasks("line")] == list(range(1, 25))
    assert tasks("line", "--seeds", "7") == [Task("line", 900.0, 7)]
    assert tasks("line", "--real-time") == [Task("line", 60.0, 1, processes=True, speed=1.0)]
    first, second = tasks("chain", "line", "speed=0.3", "--seeds", "1")
    assert (first.arguments, second.arguments) == ({"speed": "0.3"}, {})


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if not case.team])
def test_each_case_is_a_team(name: str, tmp_path: Path) -> None:
    """Its team file has a line of robots."""
    team = load_team(CASES[name].write(tmp_path, 1))
    assert [robot.id for robot in team.robots] == list(range(CASES[name].robots))


@pytest.mark.ci
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if isinstance(case, Case) and case.world])
def test_each_case_drives(name: str) -> None:
    """For 5 s no robot touches anything, and a seed gives the same ways again."""
    found = measure(Task(name, 5.0, 1))
    assert (found.error, found.contacts) == ("", 0)
    assert all(metres > 0.2 for metres in found.driven[:1])
    assert measure(Task(name, 5.0, 1)) == found


def test_a_run_is_measured() -> None:
    """The shipped arena for 10 s: both drive, the follower is held, and the share is that of the head."""
    found = measure(Task("arena", 10.0, 1))
    assert (found.error, found.contacts, list(found.held)) == ("", 0, [1])
    assert found.held[1] > 0.5
    assert 0.0 < found.driven[0] <= 4.0
    assert found.share == pytest.approx(found.driven[0] / 4.0, abs=0.02)
    failed = measure(Task("no_such_team.toml", 1.0, 1))
    assert "no_such_team" in failed.error and failed == Outcome(error=failed.error)


@pytest.mark.team
def test_processes_are_measured_as_a_team_in_this_process() -> None:
    """In lock-step the processes of `zteam up` give the same outcome; a driven head differs by seed."""
    assert measure(Task("arena", 5.0, 1, processes=True)) == measure(Task("arena", 5.0, 1))
    assert measure(Task("driven", 5.0, 1)).trajectory != measure(Task("driven", 5.0, 2)).trajectory


def test_a_stand_is_one_of_the_whole_team() -> None:
    """Only ticks count in which no robot gets 5 cm from where it was; a slow robot moves, trembling is none."""
    ticks = np.arange(200)
    creeping = np.stack([0.009 * ticks, 0.0 * ticks], axis=1)
    trembling = np.stack([0.02 * (-1.0) ** ticks, 0.0 * ticks], axis=1)
    assert longest_stand(np.stack([creeping, trembling], axis=1)) == 6
    assert longest_stand(trembling[:, None]) == 200
    stops = np.stack([np.minimum(ticks, 50) * 0.1, 0.0 * ticks], axis=1)
    assert longest_stand(np.stack([stops, trembling], axis=1)) == 149


def test_held_is_about_the_robot_that_is_followed_now() -> None:
    """A change of the followed robot counts at once; before its first status a robot follows the one that names."""
    places = np.array([[[4.0 * robot, 0.0] for robot in range(3)]] * 2)
    assert distances(places, (0, 1, 2), [{0: -1, 1: 0, 2: 1}, {0: -1, 1: 2, 2: 0}]) == {1: [4.0, 4.0], 2: [4.0, 8.0]}
    assert distances(places, (0, 1, 2), [{}, {1: 0}]) == {1: [4.0, 4.0]}
    # A pair keeps its key when the line is led from its other end.
    assert pairs_of([{0: -1, 1: 0, 2: 1}, {0: 1, 1: 2, 2: -1}, {0: -1}]) == [{1: 0, 2: 1}, {1: 0, 2: 1}, {}]


def test_a_seed_gives_its_commands() -> None:
    """The same ones again, other ones for another seed; in five minutes all kinds of moves."""
    drawn = list(islice(draw_commands(3, 0.1), 3000))
    assert drawn == list(islice(draw_commands(3, 0.1), 3000))
    assert drawn != list(islice(draw_commands(4, 0.1), 3000))
    assert {(0.0, 0.0), (SPEED, 0.0), (-SPEED, 0.0), (0.0, 1.0), (0.0, -1.0), (SPEED, 0.5)} <= set(drawn)


@pytest.fixture
def seeds(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The seeds of runs that take no time, in threads of this process: each gives its seed as its way."""
    made: list[int] = []

    def run(task: Task) -> Outcome:
        made.append(task.seed)
        return Outcome(driven=[float(task.seed)])

    monkeypatch.setattr("studies.study.figures.children", ThreadPoolExecutor)
    monkeypatch.setattr("studies.study.figures.measure", run)
    yield made


def test_what_the_file_has_is_not_run_again(seeds: list[int], tmp_path: Path) -> None:
    """Each result is written once, rows come in the order of the tasks, and a line that was cut off is run again."""
    path, said = tmp_path / "results.jsonl", []
    tasks = [Task("line", 5.0, seed) for seed in (1, 2, 3)]
    run_study(tasks[:2], path, 1)
    path.write_bytes(path.read_bytes()[:-9])
    rows = run_study(tasks[::-1], path, 1, lambda done, total: said.append((done, total)))
    assert seeds == [1, 2, 3, 2]
    assert [row.outcome.driven for row in rows] == [[3.0], [2.0], [1.0]]
    assert said == [(1, 3), (2, 3), (3, 3)]
    assert sorted(row.task.seed for row in read_results(path).values()) == [1, 2, 3]
    run_study([replace(tasks[0], seconds=6.0), replace(tasks[0], arguments={"speed": "0.3"})], path, 1)
    assert seeds[4:] == [1, 1]


def row(seed: int, **fields: Any) -> Row:
    """A result."""
    return Row(Task("line", 5.0, seed), Outcome(**{"held": {1: 1.0, 2: 0.99}, "share": 0.9, **fields}))


def test_the_worst_run_is_judged() -> None:
    """Each bound by the worst of all runs, the share by their mean; what is missed names its run."""
    rows = [row(1), row(2, held={1: 0.97, 2: 1.0}, still=31.0, contacts=2, share=0.7)]
    found = summarize(rows, [], Bounds(0, 0.98, 30.0, 0.85))
    assert (found.contacts, found.held, found.still, found.share, found.errors) == (2, 0.97, 31.0, 0.8, 0)
    assert [text.split()[0] for text in found.missed] == ["contacts", "held", "still", "share"]
    assert "robot 1, seed 2" in found.missed[1]
    assert summarize(rows, [], Bounds(2, 0.97, 31.0, 0.8)).missed == []
    assert summarize([*rows, row(3, error="it failed")], [], Bounds()).missed == ["seed 3: it failed"]
    assert format_study([found]).splitlines()[1].split() == ["line", "2", "5", "0", "2", "0", "0.970", "31.0", "0.80"]


def line(**other: Any) -> Outcome:
    """A run of a line of two robots."""
    return Outcome(**{"driven": [20.0, 21.0], "gaps": {1: 0.8}, "stands": [1.0, 2.0], **other})


@pytest.mark.parametrize(
    ("real", "missed"),
    [
        ([line(driven=[18.1, 22.9], gaps={1: 0.87}, safety_stops=2, stands=[5.0, 1.0])], ""),
        ([line(driven=[17.9, 21.0])], "robot 0: driven"),
        ([line(gaps={1: 1.41})], "robot 1: gap"),
        ([line(safety_stops=3)], "safety stops"),
        ([line(stands=[5.1, 0.0])], "a robot stood"),
        ([line(), line(driven=[5.0, 5.0]), line()], ""),
        ([line(), line(), line(contacts=2)], "contacts 2"),
    ],
)
def test_real_time_is_judged_by_lockstep(real: list[Outcome], missed: str) -> None:
    """Each figure has its bound: the medians are judged, and every contact. The table has both."""
    found = disagreements("line", real, [line()])
    assert len(found) == bool(missed) and missed in "".join(found)
    task = Task("line", 60.0, 1)
    case = summarize([Row(task, each) for each in real], [Row(task, line())], Bounds())
    assert case.missed == found
    rows = [text.split()[1] for text in format_study([case]).splitlines() if text.startswith("line ")]
    assert rows[1:] == ["real", "lock-step"]


@pytest.mark.parametrize(
    ("late", "speeds", "result"),
    [({4.0: 4}, [4.0], 4), ({4.0: 5, 2.0: 1}, [4.0, 2.0], 1), ({4.0: 50, 2.0: 5}, [4.0, 2.0], None)],
)
def test_a_run_with_late_steps_is_repeated_at_half_the_speed(
    late: dict[float, int], speeds: list[float], result: int | None
) -> None:
    """A run with 5 % late steps does not count: the second one, at half the speed, does or fails."""
    tried = []

    def run(speed: float) -> int:
        tried.append(speed)
        return late[speed]

    def figures(late_steps: int) -> RunFigures:
        robots = [RobotReport(i, None, (0.0, 0.0, 0.0), 1.0, 0, None, 100, late_steps) for i in range(2)]
        return RunFigures(
            sim_seconds=10.0, seed=1, external_commands=0, robots=robots, latency_ms=Latency(1, 1, 1), ticks=100
        )

    if result is None:
        with pytest.raises(TooSlowError):
            run_on_time(run, figures, 4.0)
    else:
        assert run_on_time(run, figures, 4.0) == result
    assert tried == speeds


@pytest.mark.ci
@pytest.mark.parametrize(("case", "seed"), [("maze-8", 2), ("rooms-8", 1)])
def test_a_line_in_a_narrow_place_gets_on(case: str, seed: int) -> None:
    """From a dead end of a maze, and round a small room: no robot stays in its place, and none touches anything."""
    outcome = measure(Task(case, 90.0, seed))
    assert (outcome.error, outcome.contacts, outcome.stuck) == ("", 0, [])
    assert min(outcome.driven) > 10.0
