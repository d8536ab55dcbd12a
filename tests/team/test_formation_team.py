"""The shipped formation drives, and re-forms when a robot dies."""

import math
from typing import Any

import pytest

from zteam.behaviors.assignment import assign
from zteam.behaviors.shapes import slots_of
from zteam.geometry import Pose2

pytestmark = pytest.mark.team


def worst(team: Any, followers: tuple[int, ...]) -> float:
    """Metres by which the worst robot is off its slot of a wedge, behind a leader that has driven straight on."""
    leader = Pose2(*team.robot(0).pose).inverse()
    seen = [leader.compose(Pose2(*team.robot(robot).pose)) for robot in followers]
    slots = slots_of("wedge", len(followers), 0.8)
    table = [[math.hypot(x + slot.back, y - slot.lateral) for slot in slots] for x, y, _ in seen]
    return max(table[row][column] for row, column in enumerate(assign(table)))


def test_the_shipped_team_forms_a_wedge_and_closes_a_gap(team: Any) -> None:
    """Five robots form it in the office's main corridor; when one dies the others form the wedge of three."""
    team.launch("formation", in_process=True)
    team.wait_for_go()
    team.until(lambda: worst(team, (1, 2, 3, 4)) < 0.05, within=12)
    team.stop("robot_1")
    team.until(lambda: worst(team, (2, 3, 4)) < 0.05, within=12)
    assert not any(team.robot(robot).stall for robot in range(5))
