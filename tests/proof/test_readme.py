"""The README's examples, as they are written."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from support.flat_floor import make_scan, make_view
from support.limits import LIMIT
from support.paces import BOTH_PACES, REAL_TIME
from support.pages import ROOT, Block, blocks_of, find_file
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

README = ROOT / "README.md"


def test_the_behaviour_of_the_readme_works() -> None:
    """The README's behaviour drives on where there is room, and turns where there is none."""
    scope: dict[str, Any] = {}
    exec(find_file("my_robot.py", README).code, scope)
    turner = scope["Turner"](scope["Turner"].Params(speed=0.5))
    assert turner.step(make_view(make_scan([3.0] * 9))).linear.x == 0.5
    assert turner.step(make_view(make_scan([0.5] * 9))).angular.z == 0.8


@BOTH_PACES
@pytest.mark.parametrize(
    ("block", "name"),
    [pytest.param(block, name, id=name) for block in blocks_of(README) if block.has_team_tests for name in block.tests],
)
def test_the_tests_of_the_readme_pass(block: Block, name: str, team: TeamFixture, empty_folder: Path) -> None:
    """The README's tests of a team pass in a folder that holds the README's files alone."""
    importlib.invalidate_caches()
    getattr(importlib.import_module(block.save(empty_folder).stem), name)(team)


@pytest.mark.parametrize("pace", [["--lockstep", "--expect", "crowd"], pytest.param([], marks=REAL_TIME.marks)])
def test_the_node_of_the_readme_joins_its_team(team: TeamFixture, empty_folder: Path, pace: list[str]) -> None:
    """The README's node takes part with the README's team, in lock-step too, and what it publishes is seen."""
    crowd = find_file("crowd.py", README).save(empty_folder)
    path = find_file("team.toml", README).save(empty_folder)
    launcher = team.spawn("zteam", "up", path.name, *pace)
    with subprocess.Popen([sys.executable, crowd.name], env={**os.environ, **team.environment}) as process:
        try:
            team.wait_for_line(launcher, "All robots GO!")
            team.wait_for(lambda: min(team.robot(robot).distance_travelled for robot in (0, 1)) > 1.0)
            assert ("crowd" in team.sim_status.participants) == bool(pace)
            echo = team.command("topic", "echo", "crowd/alarm", "--once", "--json")
            assert isinstance(json.loads(echo.stdout)["data"], bool)
            assert team.stop(launcher) == 0
        finally:
            process.terminate()
            process.wait(LIMIT)
