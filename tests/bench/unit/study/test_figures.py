"""Many runs: what is kept, what is run again, and what is judged."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from studies.study import figures
from studies.study.figures import Bounds, read_results, run_study, summarize
from studies.study.one_run import Outcome, Row, Task
from zteam.errors import UsageError

CHILD = """
import json, os, sys
task = json.loads(sys.stdin.readline())
with open({log!r}, "a") as log:
    log.write(f"{{task['seed']}}\\n")
if task["seed"] == 13:
    os._exit(3)
if task["seed"] == 99:
    sys.stdin.read()
print(json.dumps({{"driven": [task["seed"]]}}))
"""


class Runs:
    """Runs that take no time."""

    def __init__(self, folder: Path) -> None:
        self._log = folder / "log"
        self.command = [sys.executable, "-c", CHILD.format(log=str(self._log))]

    @property
    def seeds(self) -> list[int]:
        """What was run, by seed."""
        return sorted(map(int, self._log.read_text().split())) if self._log.exists() else []


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Runs]:
    """Runs of a short script in the place of teams."""
    made = Runs(tmp_path)
    monkeypatch.setattr(figures, "COMMAND", made.command)
    yield made


def tasks(*seeds: int) -> list[Task]:
    """One a seed."""
    return [Task("line", 5.0, seed) for seed in seeds]


def test_what_the_file_has_is_not_run_again(runs: Runs, tmp_path: Path) -> None:
    """Each result is written once; further seeds are added, and rows come in the order of the tasks."""
    path, told = tmp_path / "results.jsonl", []
    run_study(tasks(1, 2), path, 2)
    rows = run_study(tasks(3, 2, 1), path, 2, lambda task, done, total: told.append((task and task.seed, done, total)))
    assert runs.seeds == [1, 2, 3]
    assert [row.outcome.driven for row in rows] == [[3.0], [2.0], [1.0]]
    assert told == [(None, 2, 3), (3, 3, 3)]
    assert len(path.read_text().splitlines()) == 3
    run_study([Task("line", 6.0, 1), Task("line", 5.0, 1, arguments={"speed": "0.3"})], path, 1)
    assert runs.seeds == [1, 1, 1, 2, 3]


def test_a_line_that_was_cut_off_is_run_again(runs: Runs, tmp_path: Path) -> None:
    """The machine went down while it was written: the file is whole afterwards."""
    path = tmp_path / "results.jsonl"
    run_study(tasks(1, 2), path, 1)
    path.write_bytes(path.read_bytes()[:-9])
    rows = run_study(tasks(1, 2), path, 1)
    assert runs.seeds == [1, 2, 2]
    assert list(read_results(path).values()) == rows


def test_another_file_is_left_alone(runs: Runs, tmp_path: Path) -> None:
    """A file that is no study's is refused with its line, before anything runs."""
    path = tmp_path / "notes.txt"
    path.write_text("notes\n")
    with pytest.raises(UsageError, match=r"notes\.txt: line 1 is no result"):
        run_study(tasks(1), path)
    assert path.read_text() == "notes\n"
    assert runs.seeds == []


def test_a_run_that_crashes_is_a_result(runs: Runs) -> None:
    """It says how its process ended, and the others go on."""
    good, bad = run_study(tasks(1, 13), None, 2)
    assert (good.outcome.error, good.outcome.driven) == ("", [1.0])
    assert "3" in bad.outcome.error
    assert summarize([good, bad], Bounds()).missed == [f"seed 13: {bad.outcome.error}"]


def test_a_study_that_is_stopped_goes_on(runs: Runs, tmp_path: Path) -> None:
    """What still runs ends at once, what is done is kept, and the next time only the rest is run."""
    path = tmp_path / "results.jsonl"

    def stop(task: Task | None, done: int, total: int) -> None:
        if task is not None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(tasks(1, 99, 98), path, 2, stop)
    assert [row.task.seed for row in read_results(path).values()] in ([1], [98])
    assert runs.seeds[-1] in (98, 99) or runs.seeds == [1]
    run_study(tasks(1, 98), path, 2)
    assert {row.task.seed for row in read_results(path).values()} == {1, 98}


def row(seed: int, **fields: object) -> Row:
    """A result."""
    return Row(Task("line", 5.0, seed), Outcome(**{"held": {1: 1.0, 2: 0.99}, "share": 0.9, **fields}))  # type: ignore[arg-type]


def test_the_worst_run_is_judged() -> None:
    """Each bound by the worst of all runs, the share by their mean; what is missed names its run."""
    rows = [row(1), row(2, held={1: 0.97, 2: 1.0}, still=31.0, contacts=2, share=0.7)]
    found = summarize(rows, Bounds(0, 0.98, 30.0, 0.85))
    assert (found.contacts, found.held, found.still, found.share, found.errors) == (2, 0.97, 31.0, 0.8, 0)
    assert found.missed == [
        "contacts 2, at most 0: seed 2",
        "held 0.97, at least 0.98: robot 1, seed 2",
        "still 31 s, at most 30: seed 2",
        "share 0.8 in the mean, at least 0.85",
    ]
    assert summarize(rows, Bounds(2, 0.97, 31.0, 0.8)).missed == []
    assert summarize(rows, Bounds()).missed == []


def test_a_file_is_of_lines_of_json(runs: Runs, tmp_path: Path) -> None:
    """Each line has the task and the outcome, for other tools."""
    path = tmp_path / "results.jsonl"
    run_study(tasks(7), path)
    assert json.loads(path.read_text()) == {
        "task": {
            "what": "line",
            "seconds": 5.0,
            "seed": 7,
            "world": None,
            "arguments": {},
            "processes": False,
            "speed": None,
        },
        "outcome": {"driven": [7.0]},
    }
