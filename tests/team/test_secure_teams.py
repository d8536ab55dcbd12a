"""Every shipped team with certificates."""

import json
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.config.resources import find_team, names, teams_folder
from zteam.team.file.reading import read_team_file
from zteam.team.launch.process import zteam_command

pytestmark = [pytest.mark.team, pytest.mark.ci]


@pytest.mark.parametrize("team", names(teams_folder(), ".toml"))
def test_a_shipped_team_works_with_certificates(team: str, tmp_path: Path) -> None:
    """For a minute of simulated time each robot drives, goals are reached, and the router drops nothing of the team."""
    file = read_team_file(find_team(team)).team
    world = [] if file.team.world else ["--world", "office"]
    done = subprocess.run(
        zteam_command("zteam", "up", team, *world, "--secure", "--lockstep", "--for", "60", "--report", "r.json"),
        cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        timeout=2 * LIMIT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert "the router drops" not in done.stdout
    assert "the router hides" not in done.stdout
    driven = {robot["id"]: robot["distance_m"] for robot in json.loads((tmp_path / "r.json").read_text())["robots"]}
    assert driven.keys() == {robot.id for robot in file.robots}
    assert min(driven.values()) > 3.0, driven
    assert ("goal reached" in done.stdout) == any(robot.navigation for robot in file.robots), done.stdout
