"""The safety layer."""

import math
from pathlib import Path

import pytest

from support.paces import BOTH_PACES
from support.pages import DOCS, find_file
from zteam.config.resources import shipped_team
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team
FRONTS = 0.25
"""Metres between two bases that face each other when their fronts touch: each front is 0.125 m before its base."""


def launch(team: TeamFixture, name: str, *, safety: bool) -> None:
    """Start a shipped team, with or without its safety layer, and wait for GO."""
    team.launch(name, arguments={"safety": safety}, in_process=True)
    team.wait_for_go()


def gap(team: TeamFixture) -> float:
    """Metres between the fronts of both robots."""
    return team.robot(0).distance_to(1) - FRONTS


def ahead(team: TeamFixture) -> float:
    """What robot 0's laser reads straight ahead."""
    ranges = team.robot(0).scan.ranges
    return float(ranges[len(ranges) // 2])


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["dazzle", "heights"])
def test_without_the_safety_layer_they_collide(team: TeamFixture, name: str) -> None:
    """Without the safety layer a robot drives into another that its laser does not see."""
    launch(team, name, safety=False)
    team.until(lambda: team.robot(0).stall, within=20)
    assert gap(team) < 0.02
    assert ahead(team) > 2.0
    assert "no safety layer" in team.robot(0).status.text


@pytest.mark.few(1)
@BOTH_PACES
@pytest.mark.parametrize("name", ["dazzle", "heights"])
def test_with_the_safety_layer_they_stop_apart(team: TeamFixture, name: str) -> None:
    """With the safety layer the same robots stop 0.3 m apart."""
    launch(team, name, safety=True)
    least = math.inf

    def stand() -> bool:
        nonlocal least
        least = min(least, gap(team))
        return gap(team) < 1.0 and team.robot(0).speed == 0.0

    team.until(stand, within=20)
    team.run(3)
    assert min(least, gap(team)) >= 0.3
    assert ahead(team) > 2.0 > gap(team)
    assert not team.robot(0).stall
    assert team.robot(0).status.reason == "robot_1 ahead"


@BOTH_PACES
def test_the_pages_own_solution_works(team: TeamFixture, empty_folder: Path) -> None:
    """The behaviour of docs/robots.md stops before the unseen robot without the safety layer."""
    find_file("look_twice.py", DOCS / "robots.md").save(empty_folder)
    path = shipped_team("dazzle")
    assert path is not None
    lines = [line for line in path.read_text().splitlines() if not line.startswith("speed")]
    text = "\n".join(lines).replace('behavior = "avoid"', 'behavior = "look_twice:LookTwice"')
    (empty_folder / "own.toml").write_text(text)
    team.launch(empty_folder / "own.toml", arguments={"safety": False}, in_process=True)
    team.wait_for_go()
    team.run(10)
    assert 0.9 < gap(team) < 1.3
    assert ahead(team) > 2.0
    assert not team.robot(0).stall
    assert team.robot(0).status.reason == "robot_1 ahead"
