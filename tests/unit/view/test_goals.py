"""Goals of several robots at one place."""

import itertools
import math

from zteam.geometry import Pose2
from zteam.view.commands import SPACING, spread

GOAL = Pose2(5.0, 5.0, 0.3)


def test_one_robot_gets_the_goal_itself() -> None:
    """Nothing is spread."""
    assert spread(GOAL, {3: Pose2(0.0, 0.0, 0.0)}) == {3: GOAL}


def test_several_robots_stand_apart_around_it() -> None:
    """Each has room, all have the heading, and one of them has the goal itself."""
    poses = {i: Pose2(float(i), 0.0, 0.0) for i in range(7)}
    goals = spread(GOAL, poses)
    apart = [math.dist(a[:2], b[:2]) for a, b in itertools.combinations(goals.values(), 2)]
    assert min(apart) > SPACING - 1e-9
    assert max(math.dist(goal[:2], GOAL[:2]) for goal in goals.values()) < SPACING + 1e-9
    assert {round(goal.yaw, 9) for goal in goals.values()} == {0.3}
    assert GOAL[:2] in [goal[:2] for goal in goals.values()]


def test_ways_do_not_cross() -> None:
    """Of two robots on either side each gets the place on its side."""
    goals = spread(Pose2(0.0, 0.0, 0.0), {0: Pose2(9.0, 0.0, 0.0), 1: Pose2(-9.0, 0.0, 0.0), 2: Pose2(0.0, 0.1, 0.0)})
    assert goals[0].x > goals[1].x


def test_places_in_walls_are_left_out() -> None:
    """Only the goal itself, which the user has chosen, may lie in one."""
    goals = spread(Pose2(0.0, 0.0, 0.0), {i: Pose2(0.0, 0.0, 0.0) for i in range(5)}, lambda x, _y: x < 0.1)
    assert all(goal.x < 0.1 for goal in goals.values())
    assert len({goal[:2] for goal in goals.values()}) == 5


def test_where_nothing_is_free_each_robot_still_has_a_place() -> None:
    """All robots get a goal, each another one."""
    goals = spread(GOAL, dict.fromkeys(range(20), GOAL), lambda _x, _y: False)
    assert len({goal[:2] for goal in goals.values()}) == 20
