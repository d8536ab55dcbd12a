"""The named cases of a study."""

from pathlib import Path

import pytest

from studies.study import command
from studies.study.cases import CASES
from studies.study.one_run import Task, measure
from zteam.team.file.reading import load_team


def test_the_command_knows_all_cases() -> None:
    """Its names are those of the cases."""
    assert tuple(CASES) == command.CASES


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if not case.team])
def test_each_case_is_a_team(name: str, tmp_path: Path) -> None:
    """Its team file has a line of robots."""
    path = tmp_path / "team.toml"
    path.write_text(CASES[name].team_text())
    team = load_team(path)
    assert [robot.id for robot in team.robots] == list(range(CASES[name].robots))


@pytest.mark.ci
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.world])
def test_each_case_drives(name: str) -> None:
    """For 5 s no robot touches anything, and a seed gives the same ways again."""
    found = measure(Task(name, 5.0, 1))
    assert (found.error, found.contacts) == ("", 0)
    assert all(metres > 0.2 for metres in found.driven[:1])
    assert measure(Task(name, 5.0, 1)) == found


def test_a_driven_head_differs_by_seed() -> None:
    """Its commands are drawn from the run's seed."""
    assert measure(Task("driven", 5.0, 1)).trajectory != measure(Task("driven", 5.0, 2)).trajectory
