"""chain: which robot follows which, and where a robot is."""

import math
from typing import Any

import msgspec
import pytest

from support.flat_floor import make_view as view_of
from zteam.behaviors.chain import behavior_of, see_robot
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import RobotStatus
from zteam.testing import make_view


def told(*statuses: tuple[int, str, int]) -> View:
    """Robot 3's view after these robots have told behaviour and leader."""
    messages = {i: RobotStatus(robot_id=i, behavior=behavior, leader=leader) for i, behavior, leader in statuses}
    return make_view(robot_id=3, inputs={"statuses": messages})


def test_a_behaviour_is_known_by_its_status() -> None:
    """Of a robot that has told nothing it is empty."""
    view = told((0, "wander", -1))
    assert (behavior_of(view, 0), behavior_of(view, 1), behavior_of(make_view(), 0)) == ("wander", "", "")


@pytest.mark.parametrize(
    ("found", "reason"),
    [
        (None, "leader robot_0 not seen"),
        ((Pose2(1.0, 0.0, 0.0), 400_000_000), "leader robot_0 not seen for 0.5 s"),
        ((Pose2(1.0, math.nan, 0.0), 1_000_000_000), "the pose of leader robot_0 is no number"),
        ((Pose2(1.0, 2.0, 0.0), 600_000_000), ""),
        ((Pose2(1.0, 2.0, 0.0), 0), ""),
    ],
)
def test_a_place_counts_if_it_is_known_for_certain(found: Any, reason: str) -> None:
    """It is there, fresh and a number; a stamp of 0 has no age. No robot is its own leader."""
    view = msgspec.structs.replace(view_of(now=1_000_000_000, robot_id=1), lookup=lambda _target, _source: found)
    seen, why = see_robot(view, 0, "map", 0.5)
    assert why == reason
    assert (seen is None) is bool(reason)
    assert see_robot(view, 1, "map", 0.5) == (None, "it cannot follow itself")
