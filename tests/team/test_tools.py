"""The tools against a running team."""

import json
import math
from pathlib import Path

import pytest

from zteam import names
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team


def check_topic_tools(team: TeamFixture) -> None:
    """`topic echo` prints the messages of a running team."""
    scan = team.command("topic", "echo", "/robot_0/base_scan", "--once", "--json")
    assert scan.returncode == 0
    message = json.loads(scan.stdout)
    assert message["header"]["frame_id"] == "robot_0/base_laser_link"
    assert len(message["ranges"]) == 1081

    grid = json.loads(team.command("topic", "echo", "map", "--once", "--json").stdout)
    assert len(grid["data"]) == grid["info"]["width"] * grid["info"]["height"]


def check_tf_tools(team: TeamFixture, drawn: Path) -> None:
    """`tf echo`, `tree`, `positions` and `monitor` print the transforms of a running team."""
    pose = json.loads(team.command("tf", "echo", "/map", "robot_0/base_footprint", "--once", "--json").stdout)
    truth = team.robot(0).pose
    where = pose["transform"]["translation"]
    assert math.dist((where["x"], where["y"]), truth[:2]) < 0.5

    tree = json.loads(team.command("tf", "tree", "--json").stdout)
    assert tree["robot_1/base_footprint"]["parent"] == "robot_1/odom"
    assert tree["robot_1/odom"]["authority"] == names.SIMULATOR

    places = {row["robot"]: row for row in json.loads(team.command("tf", "positions", "--json").stdout)}
    assert set(places) == {"robot_0", "robot_1"}
    assert math.dist((places["robot_1"]["x"], places["robot_1"]["y"]), team.robot(1).pose[:2]) < 0.5

    watched = json.loads(team.command("tf", "monitor", "--for", "2", "--json").stdout)
    moving = {row["child"]: row for row in watched["frames"]}
    assert moving["robot_0/base_footprint"]["authority"] == "robot_0"
    assert moving["robot_0/base_footprint"]["rate"] == pytest.approx(10.0, abs=1.2)
    assert watched["conflicts"] == []

    past = team.command("tf", "echo", "map", "robot_0/base_footprint", "--at", f"{team.now - 1.0:.1f}", "--json")
    assert json.loads(past.stdout)["header"]["stamp"]["sec"] >= 1
    assert team.command("tf", "tree", "-o", str(drawn)).returncode == 0
    assert "robot_1/base_laser_link" in drawn.read_text()


def test_the_tools_see_a_running_team(team: TeamFixture, tmp_path: Path) -> None:
    """Tools print what the same team publishes as JSON (one team, because its start is slow)."""
    slow = {0: {"speed": 0.05}, 1: {"speed": 0.05}}
    team.start("arena", robots="0-1", behavior="forward", params=slow)
    team.wait_for_go()
    # Some of a second's past is asked for.
    team.run(2.0)
    team.sim.set_speed(1.0)
    team.sim.resume()
    check_topic_tools(team)
    check_tf_tools(team, tmp_path / "frames.svg")
