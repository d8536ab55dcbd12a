"""Formation and chain."""

import math
from typing import Any

import pytest

from support.paces import BOTH_PACES
from zteam.geometry import Pose2
from zteam.robot.behaviors.formation import assign, slots_of

pytestmark = pytest.mark.team


def worst(team: Any, followers: tuple[int, ...]) -> float:
    """Metres by which the worst robot is off its slot of a wedge, behind a leader that has driven straight on."""
    leader = Pose2(*team.robot(0).pose).inverse()
    seen = [leader.compose(Pose2(*team.robot(robot).pose)) for robot in followers]
    slots = slots_of("wedge", len(followers), 0.8)
    table = [[math.hypot(x + slot.back, y - slot.lateral) for slot in slots] for x, y, _ in seen]
    return max(table[row][column] for row, column in enumerate(assign(table)))


@BOTH_PACES
def test_the_shipped_team_forms_a_wedge_and_closes_a_gap(team: Any) -> None:
    """Five robots form a wedge in the office, and when one of them dies the others form a smaller one."""
    team.launch("formation", in_process=True)
    team.wait_for_go()
    team.until(lambda: worst(team, (1, 2, 3, 4)) < 0.05, within=12)
    team.stop("robot_1")
    team.until(lambda: worst(team, (2, 3, 4)) < 0.05, within=12)
    assert not any(team.robot(robot).stall for robot in range(5))


@pytest.mark.ci
@BOTH_PACES
def test_the_shipped_chain_drives_with_its_arguments(team: Any) -> None:
    """The shipped chain drives in a line, with the number of robots and the speed that its user asks for."""
    team.launch("chain", in_process=True, arguments={"speed": 0.6, "followers": "1-4"})
    team.wait_for_go()
    team.run(10.0)
    assert team.robot(0).speed == pytest.approx(0.6, abs=0.01)
    assert [team.robot(i).distance_to(i - 1) for i in range(1, 5)] == pytest.approx([0.8] * 4, rel=0.1)
    report = team.report
    assert [(robot.id, robot.follow) for robot in report.robots] == [(0, None), (1, 0), (2, 1), (3, 2), (4, 3)]
    assert all(robot.distance_m > 3.0 and robot.stalls == 0 for robot in report.robots)
