"""The same team with one process each and in one process: the same run, bit for bit."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team


OWN = """
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Turner(Behavior):
    def step(self, view):
        near = view.scan.ranges.min() < 0.8
        return Twist(Vector3(0.0 if near else 0.3), Vector3(0.0, 0.0, 0.2 + 0.8 * view.random()))

class Mortal(Behavior):
    def step(self, view):
        if view.now > 4_000_000_000:
            raise RuntimeError("the end")
        return Twist(Vector3(0.2))
"""

NOISY = """
[team]
world = "arena"
seed = 4
[simulation]
gaussian_noise = 0.02
odom_alphas = [0.05, 0.01, 0.02, 0.01]
dazzle = "drop"
[[robots]]
id = 0
behavior = "own_ways:Turner"
[[robots]]
id = 1
follow = 0
[[robots]]
id = 2
model = "erratic"
pose = [-3.5, 1.5, 0.0]
behavior = "own_ways:Mortal"
[[robots]]
id = 7
model = "erratic"
pose = [3.0, -3.0, 1.0]
behavior = "wander"
"""


@pytest.fixture
def same_team() -> Iterator[TeamFixture]:
    """The team in this process."""
    team = TeamFixture()
    yield team
    team.close()


def test_noise_own_behaviors_and_changes_give_the_same_run(
    team: TeamFixture, same_team: TeamFixture, empty_folder: Path
) -> None:
    """Noise, own behaviours, a robot that is spawned, one that fails and one that is stopped change both alike."""
    (empty_folder / "own_ways.py").write_text(OWN)
    (empty_folder / "team.toml").write_text(NOISY)
    found = []
    for one, in_process in ((team, False), (same_team, True)):
        one.launch(empty_folder / "team.toml", in_process=in_process)
        one.wait_for_go()
        one.run(2)
        one.sim.spawn(2.0, 3.5)
        one.expect_end("robot_2")
        one.run(4)
        assert one.wait_for_exit("robot_2") == 1
        assert any("RuntimeError: the end" in line for line in one.lines("robot_2"))
        assert one.stop("robot_7") == 0
        one.run(4)
        assert one.sim_status.participants == ["robot_0", "robot_1", "tf"]
        found.append([one.report.trajectory_sha256, one.robot(0).pose, one.robot(2).pose, one.robot(7).pose])
    assert found[0] == found[1]
