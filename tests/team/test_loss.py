"""Robots of a chain whose processes are killed and come back, and leaders that drive into their own chain."""

import math
from itertools import pairwise, permutations
from pathlib import Path

import pytest

from zteam.geometry import Pose2
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

WORLD = """
interval_sim 100
define scanner ranger ( size [0.05 0.05 0.1] sensor ( range [0 30] fov 270.25 samples 271 ) )
define erratic position
( size [0.35 0.35 0.25] origin [-0.05 0 0 0] drive "diff" scanner ( pose [0.05 0 0 0] ) )
define wall model ( size [20 0.1 0.5] )
wall ( pose [5 3 0 0] )
wall ( pose [5 -3 0 0] )
"""
"""Two long walls. The lasers stand on top, as Stage's do, and look over the other robots."""
REAR, FRONT, SIDE = -0.225, 0.125, 0.175
"""Metres in the base frame: an erratic's outline."""
CORNERS = [Pose2(x, y, 0.0) for x in (REAR, FRONT) for y in (-SIDE, SIDE)]
GAP = 0.8
TOUCHING = 0.02
"""Metres: what the safety layer leaves beside a robot that drives is a little more."""


def launch(
    team: TeamFixture,
    folder: Path,
    count: int,
    *,
    head: str = 'behavior = "forward"\nspeed = 0.4',
    follow: str = "",
    in_process: bool = False,
) -> None:
    """Start a chain along the x axis; `head` is the entry of its head, `follow` more lines of the others' entries."""
    robots = [f'erratic ( name "robot_{i}" pose [{-GAP * i} 0 0 0] )' for i in range(count)]
    (folder / "world.world").write_text("\n".join([WORLD, *robots]))
    entries = [f"[[robots]]\nid = 0\n{head}\n"]
    entries += [f"[[robots]]\nid = {i}\nfollow = {i - 1}\n{follow}\n" for i in range(1, count)]
    (folder / "team.toml").write_text("\n".join(['[team]\nworld = "world.world"', *entries]))
    team.launch(folder / "team.toml", in_process=in_process)
    team.wait_for_go()


def apart(team: TeamFixture, count: int) -> float:
    """Metres between the outlines of the two robots that are nearest to each other; 0 where they touch."""
    poses = [team.robot(i).pose for i in range(count)]
    return min(
        beside(two.inverse().compose(one.compose(corner))) for one, two in permutations(poses, 2) for corner in CORNERS
    )


def beside(point: Pose2) -> float:
    """Metres from the outline of a robot to a point in its base frame; 0 inside."""
    return math.hypot(max(REAR - point.x, 0.0, point.x - FRONT), max(abs(point.y) - SIDE, 0.0))


def watch(team: TeamFixture, count: int, seconds: float) -> float:
    """Let the world go on; the least distance between two outlines meanwhile."""
    least = math.inf
    for _ in range(round(10 * seconds)):
        team.run(0.1)
        least = min(least, apart(team, count))
    return least


def gaps(team: TeamFixture, *chain: int) -> list[float]:
    """Metres between neighbours."""
    return [team.robot(a).distance_to(b) for a, b in pairwise(chain)]


def assert_is_line(team: TeamFixture, count: int, off: float) -> None:
    """Robot 0 drives ahead of all others, which follow it in any order, each GAP behind the next."""
    order = sorted(range(count), key=lambda robot: -team.robot(robot).pose.x)
    assert order[0] == 0
    assert gaps(team, *order) == pytest.approx([GAP] * (count - 1), abs=off)


@pytest.mark.parametrize(
    ("law", "speed", "in_process"), [("trail", 0.7, False), ("trail", 0.3, True), ("direct", 0.7, True)]
)
def test_followers_of_a_killed_leader_stop_in_half_a_second(
    team: TeamFixture, tmp_path: Path, law: str, speed: float, in_process: bool
) -> None:
    """All of them stand 0.5 s of simulated time later, say why, and go on when it comes back."""
    head = f'behavior = "forward"\nspeed = {speed}'
    launch(team, tmp_path, 3, follow=f'law = "{law}"', head=head, in_process=in_process)
    team.run(3.0)
    assert min(team.robot(i).speed for i in (1, 2)) > 0.7 * speed
    (team.stop if in_process else team.kill)("robot_0")
    team.run(0.5)
    assert [team.robot(i).speed for i in (0, 1, 2)] == [0.0, 0.0, 0.0]
    stood = [team.robot(i).pose for i in (0, 1, 2)]
    assert watch(team, 3, 1.0) > TOUCHING
    assert [team.robot(i).pose for i in (0, 1, 2)] == stood
    assert all("leader robot_0 is gone" in line for line in (team.lines("robot_1")[-1], team.lines("robot_2")[-1]))
    team.restart("robot_0")
    team.run(4.0)
    assert min(team.robot(i).pose.x - stood[i].x for i in (0, 1, 2)) > 0.5


def test_a_chain_closes_without_a_killed_robot_and_forms_again(team: TeamFixture, tmp_path: Path) -> None:
    """Those behind go round it where it stands and close up; it comes back, and all are one line behind the head."""
    launch(team, tmp_path, 4)
    team.run(2.0)
    team.kill("robot_1")
    assert watch(team, 4, 9.0) > TOUCHING
    assert gaps(team, 0, 2, 3) == pytest.approx([GAP, GAP], abs=0.1)
    assert team.robot(2).pose.x > team.robot(1).pose.x + 1.0
    team.restart("robot_1")
    assert watch(team, 4, 30.0) > TOUCHING
    assert_is_line(team, 4, 0.15)


def test_the_first_robot_takes_over_until_its_leader_comes_back(
    team: TeamFixture, same_team: TeamFixture, tmp_path: Path
) -> None:
    """It drives past the killed leader and goes on as that did; the others follow. When the leader is back they turn
    round, let it through, and follow it. The run is the same with processes that are killed, and in one process."""
    found = []
    for one, in_process in ((team, False), (same_team, True)):
        launch(one, tmp_path, 3, follow='on_leader_lost = "takeover"', in_process=in_process)
        one.run(2.0)
        (one.stop if in_process else one.kill)("robot_0")
        assert watch(one, 3, 12.0) > TOUCHING
        assert one.robot(1).pose.x > one.robot(0).pose.x + 1.5
        assert one.robot(1).pose[1:] == pytest.approx((0.0, 0.0), abs=0.05)
        assert gaps(one, 1, 2) == pytest.approx([GAP], abs=0.1)
        one.restart("robot_0")
        assert watch(one, 3, 44.0) > TOUCHING
        assert_is_line(one, 3, 0.15)
        found.append(one.report.trajectory_sha256)
    assert found[0] == found[1]
