"""How a robot comes to its slot and stays in it."""

import math

import pytest

from support.flat_floor import LASER, cast, make_scan, make_view
from zteam.behaviors.leader_trail import LeaderTrail
from zteam.behaviors.pursuit import Limits
from zteam.behaviors.slot_driving import SLOT_GAIN, find_goal, hold, turn_to
from zteam.geometry import Pose2
from zteam.messages import Twist

LIMITS = Limits(1.0, 2.0)
HERE = Pose2(0.0, 0.0, 0.0)


def test_in_its_slot_it_moves_as_the_slot_does() -> None:
    """With the slot's speed and turn rate, and nothing besides."""
    command = hold(HERE, 0.4, 0.3, LIMITS)
    assert (command.linear.x, command.angular.z) == pytest.approx((0.4, 0.3))


@pytest.mark.parametrize(("x", "speed"), [(0.1, 0.6), (-0.1, 0.2), (-0.4, 0.05), (0.4, 1.0)])
def test_it_closes_the_distance_to_a_slot_that_moves(x: float, speed: float) -> None:
    """Faster behind it, slower ahead of it but never back, and never above its limit."""
    assert hold(Pose2(x, 0.0, 0.0), 0.4, 0.0, LIMITS).linear.x == pytest.approx(speed)


def test_it_turns_to_a_slot_beside_it() -> None:
    """On the spot to a slot that stands beside it, in a bend to one that drives a little aside; not at rest."""
    aside = hold(Pose2(0.0, 0.3, 0.0), 0.0, 0.0, LIMITS)
    assert (aside.linear.x, aside.angular.z) == (0.0, 2.0)
    bend = hold(Pose2(0.0, 0.05, 0.0), 0.4, 0.0, LIMITS)
    assert bend.linear.x == pytest.approx(0.4)
    assert 0.0 < bend.angular.z < 1.0
    assert hold(Pose2(0.005, 0.0, 1.0), 0.0, 0.0, LIMITS) == Twist()


def test_it_turns_to_a_heading() -> None:
    """At a rate by the angle, up to its limit; not for an angle that is next to nothing."""
    assert turn_to(0.2, LIMITS).angular.z == pytest.approx(0.6)
    assert turn_to(-3.0, LIMITS).angular.z == -2.0
    assert turn_to(0.04, LIMITS) == Twist()


def test_a_far_slot_in_sight_is_the_goal_and_a_little_more() -> None:
    """So far ahead of a slot that moves that the speed there is the slot's."""
    view = make_view(make_scan([30.0] * 271))
    slot = Pose2(2.0, 1.0, 0.0)
    assert find_goal(view, HERE, slot, 0.0, LeaderTrail(), 0.0)[:2] == (2.0, 1.0)
    assert find_goal(view, HERE, slot, 0.4, LeaderTrail(), 0.0)[:2] == (2.0 + 0.4 / SLOT_GAIN, 1.0)


def test_with_a_wall_between_it_goes_along_the_trail() -> None:
    """To the foremost place of the leader's way that it sees, and not through the wall to the slot."""
    view = make_view(make_scan(cast(LASER, [(1.0, 0.5, 1.0, 4.0)])))
    trail = LeaderTrail()
    trail.begin(Pose2(2.0, 2.0, math.pi / 2), 1, [Pose2(0.0, -0.5, 0.0), Pose2(2.0, -0.5, 0.0)])
    goal = find_goal(view, HERE, Pose2(2.0, 1.5, math.pi / 2), 0.0, trail, trail.path.end - 0.5)
    assert goal.x > 1.2
    assert goal.y < 0.5
