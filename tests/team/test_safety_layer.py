"""The safety layer in the simulator: dazzled lasers, lasers that look over low bodies, and what no laser sees."""

import math
from pathlib import Path
from typing import NamedTuple

import pytest

from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

WORLD = """
interval_sim 100
define scanner ranger ( size [0.05 0.05 0.1] sensor ( range [0 30] fov 270.25 samples 1081 ) )
define erratic position
( size [0.35 0.35 0.25] origin [-0.05 0 0 0] drive "diff" scanner ( pose [0.05 0 LASER 0] ) )
define wall model ( size [20 0.1 0.5] )
wall ( pose [0 3 0 0] )
wall ( pose [0 -3 0 0] )
"""
"""Two long walls. The erratics are Stage's: with LASER 0 their lasers stand on top and look over other robots."""
REAR, FRONT, SIDE = 0.225, 0.125, 0.175
"""Metres from an erratic's origin to its outline."""
BACKER = """
from zteam import Behavior
from zteam.messages import Twist, Vector3

class PassAndBack(Behavior):
    '''Drive 1.5 m past the post, turn the rear towards it, and back up for ever.'''
    def step(self, view):
        position, turn = view.odom.pose.pose.position, view.odom.pose.pose.orientation
        if position.x < 1.5 and not getattr(self, "arrived", False):
            return Twist(Vector3(0.3))
        self.arrived = True
        if turn.z > -0.7071 and not getattr(self, "turned", False):
            return Twist(Vector3(), Vector3(0.0, 0.0, -0.5))
        self.turned = True
        return Twist(Vector3(-0.5))
"""


class Start(NamedTuple):
    """Where a robot starts and what it does."""

    x: float
    y: float
    yaw_deg: float
    speed: float
    more: str = 'behavior = "forward"'


def launch(team: TeamFixture, folder: Path, robots: list[Start], *, laser: str = "0", options: str = "") -> None:
    """Start a team in a world of its own; its robots drive `forward`."""
    lines = [f'erratic ( name "robot_{i}" pose [{r.x} {r.y} 0 {r.yaw_deg}] )' for i, r in enumerate(robots)]
    (folder / "world.world").write_text("\n".join([WORLD.replace("LASER", laser), *lines]))
    entries = [f"[[robots]]\nid = {i}\n{r.more}\n" for i, r in enumerate(robots)]
    for i, robot in enumerate(robots):
        if "forward" in robot.more:
            entries[i] += f"speed = {robot.speed}\n"
    text = f'[team]\nworld = "world.world"\n[simulation]\n{options}\n' + "\n".join(entries)
    (folder / "team.toml").write_text(text)
    team.launch(folder / "team.toml", in_process=True)
    team.wait_for_go()


@pytest.mark.parametrize("dazzle", ['dazzle = "drop"', 'dazzle = "max"', 'dazzle = "off"'])
@pytest.mark.parametrize("laser", ["0", "-0.1"])
def test_two_dazzled_robots_head_on_stop_apart(team: TeamFixture, tmp_path: Path, laser: str, dazzle: str) -> None:
    """At 0.7 m/s each, with every scan dazzled, they stop at least 0.3 m apart, and each names the other."""
    robots = [Start(-3.0, 0.05, 0.0, 0.7), Start(3.0, -0.05, 180.0, 0.7)]
    launch(team, tmp_path, robots, laser=laser, options=dazzle)
    apart = math.inf
    for _ in range(60):
        team.run(0.1)
        apart = min(apart, team.robot(1).pose[0] - team.robot(0).pose[0] - 2 * FRONT)
    before = [team.robot(i).pose for i in (0, 1)]
    team.run(1.0)
    assert [team.robot(i).pose for i in (0, 1)] == before
    assert 0.3 <= apart < 0.5
    assert not any(team.robot(i).stall for i in (0, 1))
    assert any("robot_1 ahead" in line for line in team.lines("robot_0"))


def test_a_robot_that_backs_up_stops_before_a_teammate(team: TeamFixture, tmp_path: Path) -> None:
    """No laser looks back: it is slow, and stops 0.3 m before the other's outline."""
    launch(team, tmp_path, [Start(1.0, 0.0, 0.0, -0.5), Start(-0.5, 0.1, 90.0, 0.0)])
    speeds, last = [], 1.0
    for _ in range(120):
        team.run(0.1)
        x = team.robot(0).pose[0]
        speeds.append((last - x) / 0.1)
        last = x
    assert 0.15 < max(speeds) <= 0.2 + 1e-6
    assert speeds[-1] == 0.0
    assert 0.3 <= last - REAR - (-0.5 + SIDE) < 0.4
    assert any("robot_1 behind" in line for line in team.lines("robot_0"))
    assert any("it cannot see behind" in line for line in team.lines("robot_0"))


def test_a_robot_that_backs_up_stops_before_a_wall_that_it_has_passed(team: TeamFixture, tmp_path: Path) -> None:
    """The wall was seen in passing; with the rear towards it, it is remembered, and the robot stops before it."""
    (tmp_path / "own_backer.py").write_text(BACKER)
    launch(team, tmp_path, [Start(-1.5, 1.0, 0.0, 0.0, 'behavior = "own_backer:PassAndBack"')])
    team.until(lambda: team.robot(0).pose[2] < -1.5, within=30)
    start = team.robot(0).pose
    fastest, last = 0.0, start[1]
    for _ in range(100):
        team.run(0.1)
        y = team.robot(0).pose[1]
        fastest, last = max(fastest, (y - last) / 0.1), y
    assert 0.15 < fastest <= 0.2 + 1e-6
    assert not team.robot(0).stall
    assert 0.1 < (3.0 - 0.05) - (last + REAR) < 0.25
    assert any("obstacle behind" in line for line in team.lines("robot_0"))


def test_a_robot_without_the_layer_says_so_loudly(team: TeamFixture, tmp_path: Path) -> None:
    """It warns when it starts, says so in every status, and drives into the wall; its teammate says nothing of it."""
    robots = [Start(0.0, 2.0, 90.0, 0.4, 'behavior = "forward"\nsafety = false'), Start(-3.0, 2.0, 90.0, 0.4)]
    launch(team, tmp_path, robots)
    team.until(lambda: team.robot(0).stall, within=10)
    warned = {i: [line for line in team.lines(f"robot_{i}") if "NO SAFETY LAYER" in line] for i in (0, 1)}
    assert len(warned[0]) == 1
    assert "warning" in warned[0][0]
    assert team.robot(0).status.text == "no safety layer"
    team.until(lambda: team.robot(1).speed == 0.0, within=10)
    assert not warned[1]
    assert team.robot(1).status.reason == "obstacle ahead"
    assert not team.robot(1).stall
