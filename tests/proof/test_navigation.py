"""Navigation."""

import math
from functools import partial
from pathlib import Path

import pytest

from support.navigated_team import DONE, FAKE, NavigatedTeam
from support.paces import BOTH_PACES
from zteam import Node, names, run_team
from zteam.messages import NavigationState, PoseWithCovarianceStamped, encode
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

AMCL = """
[team]
world = "arena"
seed = 4
[simulation]
gaussian_noise = 0.02
odom_alphas = [0.1, 0.1, 0.1, 0.1]
[[robots]]
id = 0
behavior = "wander"
navigation = true
"""


@BOTH_PACES
def test_a_robot_reaches_its_goal_and_stands(team: TeamFixture, empty_folder: Path) -> None:
    """A navigated robot drives to its goal, arrives within Nav2's tolerance, and stands there."""
    path = empty_folder / "team.toml"
    path.write_text(FAKE)
    team.launch(path)
    team.wait_for_go()
    nav = NavigatedTeam(team)
    nav.go(0, 3.0, 3.0, 1.57)
    nav.wait(0, NavigationState.DRIVING, within=1.0)
    assert 5.0 < nav.newest(0).distance_remaining < 7.0
    assert team.robot(0).truth is not None
    nav.wait(0, *DONE, within=30.0)
    assert nav.state(0) is NavigationState.SUCCEEDED
    assert nav.distance(0, 3.0, 3.0) < 0.3
    team.run(0.3)
    before = team.robot(0).pose
    team.run(2.0)
    assert team.robot(0).pose == before


def collect(poses: list[PoseWithCovarianceStamped], node: Node) -> None:
    """A node that keeps what AMCL says of robot 0."""
    key = names.robot_key(0, names.AMCL_POSE)
    node.subscribe(key, PoseWithCovarianceStamped, lambda _, pose: poses.append(pose))
    node.run(lambda now: None)


@pytest.mark.ci
def test_the_same_seed_gives_the_same_localisation(empty_folder: Path) -> None:
    """With noise AMCL knows where its robot is, and a second run gives the same poses, bit for bit."""
    path = empty_folder / "team.toml"
    path.write_text(AMCL)
    runs = []
    for _ in range(2):
        poses: list[PoseWithCovarianceStamped] = []
        robot = run_team(path, seconds=15.0, nodes={"watch": partial(collect, poses)}).robots[0]
        assert robot.distance_m > 2.0
        assert len(poses) > 10
        position = poses[-1].pose.pose.position
        assert math.dist((position.x, position.y), robot.pose[:2]) < 0.3
        runs.append([encode(pose) for pose in poses])
    assert runs[0] == runs[1]
