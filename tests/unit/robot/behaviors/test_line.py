"""Which robot of a line follows which, and which one leads."""

import math
from typing import Any

import msgspec
import pytest

from support.flat_floor import TICK, make_scan
from support.flat_floor import make_view as view_of
from zteam.geometry import Pose2
from zteam.messages import RobotStatus, Twist
from zteam.robot.behaviors.line import NO_TURNS, Line, LineRole, OnLeaderLost, see_robot
from zteam.robot.behaviors.registry import load_behavior
from zteam.testing import make_view


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
    seen, why = see_robot(view, 0, 0.5)
    assert why == reason
    assert (seen is None) is bool(reason)
    assert see_robot(view, 1, 0.5) == (None, "it cannot follow itself")


LINE = {0: None, 1: 0, 2: 1, 3: 2}
"""0 <- 1 <- 2 <- 3."""


def places(
    leaders: dict[int, int | None], gone: frozenset[int] = frozenset(), on_lost: OnLeaderLost = "relink", turns: int = 0
) -> dict[int, LineRole]:
    """The places that the living robots find, each for itself, from what all of them tell."""
    told = {
        robot: RobotStatus(robot_id=robot, leader=-1 if leader is None else leader, turns=turns, gap=0.8)
        for robot, leader in leaders.items()
    }
    found = {}
    for robot in leaders.keys() - gone:
        line, view = Line(), make_view(robot_id=robot, inputs={"statuses": told})
        line.find_gone(msgspec.structs.replace(view, team=tuple(leaders)))
        living = msgspec.structs.replace(view, team=tuple(leaders.keys() - gone))
        found[robot] = line.find_role(living, leaders[robot], on_lost)
    return found


def ahead(found: dict[int, LineRole]) -> dict[int, int | str | None]:
    """The robot that each follows, or why it stands."""
    return {robot: role.reason or role.ahead for robot, role in found.items()}


@pytest.mark.parametrize("on_lost", ["relink", "stop", "takeover"])
def test_a_whole_line_is_as_it_was_named(on_lost: OnLeaderLost) -> None:
    """While no robot is gone, each follows the robot that it was told to follow, and knows the one behind it."""
    found = places(LINE, on_lost=on_lost)
    assert ahead(found) == LINE
    assert [found[robot].behind for robot in LINE] == [1, 2, 3, None]
    assert all(role.may_turn and role.head == 0 for role in found.values())


@pytest.mark.parametrize("turns", [1, 7])
def test_an_odd_number_of_turns_is_a_line_that_is_led_from_its_other_end(turns: int) -> None:
    """Each follows the robot behind it, and the last one leads."""
    found = places(LINE, turns=turns)
    assert ahead(found) == {0: 1, 1: 2, 2: 3, 3: None}
    assert [found[robot].behind for robot in LINE] == [None, 0, 1, 2]
    assert ahead(places(LINE, turns=turns + 1)) == LINE


@pytest.mark.parametrize("number", [1, 2, 3, 2**30 - 1, 2**31 - 1])
@pytest.mark.parametrize("turns", [0, 1])
@pytest.mark.parametrize("robot", [0, 1, 2, 3])
def test_what_a_robot_tells_out_of_turn_turns_nothing(robot: int, turns: int, number: int) -> None:
    """Only the robot that leads hands over, and by one turn, whatever number it tells."""
    told = {each: RobotStatus(robot_id=each, leader=each - 1, turns=turns, gap=0.8) for each in LINE}
    own = {0: 1, 1: 2, 2: 1, 3: 2}[robot]
    line = Line()
    line.find_role(make_view(robot_id=own, inputs={"statuses": told}), own - 1)
    told = told | {robot: RobotStatus(robot_id=robot, leader=robot - 1, turns=number, gap=0.8)}
    for _ in range(3):
        line.find_role(make_view(robot_id=own, inputs={"statuses": told}), own - 1)
    leads = robot == (3 if turns else 0)
    assert line.turns == turns + (leads and 0 < number - turns < 2**30)


def test_without_its_head_the_whole_line_stands() -> None:
    """With `relink` all name the lost robot at once, also where the other end leads."""
    for turns in (0, 1):
        assert set(ahead(places(LINE, frozenset({0}), turns=turns)).values()) == {"leader robot_0 is gone"}


def test_stop_is_about_every_robot_before() -> None:
    """With `stop` the loss of a middle robot stops the robots behind it, and no others."""
    assert ahead(places(LINE, frozenset({1}), "stop")) == {
        0: None, 2: "leader robot_1 is gone", 3: "leader robot_1 is gone",
    }  # fmt: skip
    assert ahead(places(LINE, frozenset({2, 3}), "stop")) == {0: None, 1: 0}


def test_the_first_living_robot_takes_over() -> None:
    """It leads, the others follow it; if it is gone as well, the next one leads."""
    assert ahead(places(LINE, frozenset({0}), "takeover")) == {1: None, 2: 1, 3: 2}
    assert ahead(places(LINE, frozenset({0, 1}), "takeover")) == {2: None, 3: 2}


def test_a_line_with_branches_does_not_turn() -> None:
    """Each follows the robot that it was told to follow, however often another line has turned."""
    tree = {0: None, 1: 0, 2: 1, 5: 0, 6: 5}
    found = places(tree, turns=1)
    assert ahead(found) == tree
    assert not any(role.may_turn for role in found.values())


@pytest.mark.parametrize(("turns", "expected"), [(2, {1: 0, 2: 1, 3: 2}), (3, {3: 0, 2: 3, 1: 2})])
def test_a_head_that_cannot_follow_keeps_its_place(turns: int, expected: dict[int, int]) -> None:
    """The robots behind it may turn their order: after an odd number of times the last one follows the head."""
    told = {robot: RobotStatus(robot_id=robot, leader=robot - 1, turns=turns, gap=0.8) for robot in LINE}
    told[0].turns = NO_TURNS
    found = {
        robot: Line().find_role(make_view(robot_id=robot, inputs={"statuses": told}), robot - 1) for robot in (1, 2, 3)
    }
    assert {robot: role.ahead for robot, role in found.items()} == expected
    assert all(role.may_reverse and not role.may_turn and role.head == 0 for role in found.values())


@pytest.mark.parametrize("robot", [0, 2, 3])
def test_it_takes_one_robot_that_keeps_its_order_for_all_to_keep_theirs(robot: int) -> None:
    """With `hand_over = false` on any follower the robots behind a head that keeps its place do not turn."""
    told = {each: RobotStatus(robot_id=each, leader=each - 1, turns=0, gap=0.8) for each in LINE}
    told[0].turns = NO_TURNS
    told[robot].turns = NO_TURNS
    role = Line().find_role(make_view(robot_id=1, inputs={"statuses": told}), 0)
    assert role.may_reverse == (robot == 0)


def test_a_robot_that_follows_in_another_way_counts_as_a_head() -> None:
    """A robot in a formation keeps another place behind its leader than a line would have, and tells no gap."""
    told = {
        1: RobotStatus(robot_id=1, behavior="formation", leader=0),
        2: RobotStatus(robot_id=2, behavior="follow", leader=1, gap=0.8),
    }
    role = Line().find_role(make_view(robot_id=3, inputs={"statuses": told}), 2)
    assert (role.before, role.head) == ((2, 1), 1)


@pytest.mark.parametrize("leaders", [{1: 1}, {1: 2, 2: 1}, {1: 2, 2: 3, 3: 2}])
def test_a_circle_moves_no_robot(leaders: dict[int, int | None]) -> None:
    """A line that leads back to one of its robots has no head."""
    assert places(leaders)[1].reason == "the robots follow each other in a circle"


def test_gone_is_what_was_there_and_is_not() -> None:
    """A robot that never was alive is not gone; one that comes back is there again; without itself nothing is known."""
    line, view = Line(), make_view(robot_id=1)

    def gone(*team: int) -> set[int]:
        return set(line.find_gone(msgspec.structs.replace(view, team=team)))

    assert gone() == set()
    assert gone(1) == set()
    assert gone(0, 1, 2) == set()
    assert gone(1) == {0, 2}
    assert gone() == set()
    assert gone(0, 1) == {2}


@pytest.mark.parametrize(("silent", "seconds", "ahead"), [(False, 0.0, 0), (True, 39.0, 1), (True, 41.0, 0)])
def test_a_line_waits_for_a_robot_that_was_silent_before_it_was_gone(silent: bool, seconds: float, ahead: int) -> None:
    """It may be frozen, and to go past it would leave it stuck; one that has ended is gone at once."""
    told = {robot: RobotStatus(robot_id=robot, leader=robot - 1, gap=0.8) for robot in LINE}
    line, began = Line(), round(50e9)

    def place(now: int, *team: int) -> LineRole:
        view = make_view(robot_id=2, inputs={"statuses": told})
        seen = msgspec.structs.replace(view, now=now, team=team, silent=frozenset({1} if silent else ()))
        return line.find_role(seen, 1)

    assert place(began, 0, 1, 2, 3).ahead == 1
    place(began, 0, 2, 3)
    assert place(began + round(seconds * 1e9), 0, 2, 3).ahead == ahead
    assert place(began + round(50e9), 0, 1, 2, 3).ahead == 1


@pytest.mark.parametrize("reach", [9.0, 0.3])
def test_a_head_waits_for_a_silent_robot_of_its_line(reach: float) -> None:
    """It neither drives on nor hands over, however long that takes; with an answer it has all its patience again."""
    told = {robot: RobotStatus(robot_id=robot, leader=robot - 1, gap=0.8, turns=0) for robot in LINE}
    behavior = load_behavior("wander", {}, robot_id=0)

    def step(tick: int, *silent: int) -> Twist:
        view = view_of(
            make_scan([reach] * 271, tick * TICK), now=tick * TICK, robot_id=0, team=tuple(LINE),
            inputs={"statuses": told}, silent=frozenset(silent),
            lookup=lambda _target, _source: (Pose2(0.0, 0.0, 0.0), tick * TICK),
        )  # fmt: skip
        return behavior.step(view)

    step(1)
    assert [step(tick, 2) for tick in range(2, 200)] == [Twist()] * 198
    assert (behavior.reason, behavior.turns) == ("waits: robot_2 is silent", 0)
    step(200)
    assert behavior.turns == 0
