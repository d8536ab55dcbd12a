"""follow: both laws in the line of four; the lectures' law (direct), and what it must never do."""

import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from support.flat_floor import TICK, Floor, Segment, clearance, make_scan, make_view
from support.world_texts import box_points
from zteam.behaviors import Behavior, View, decide, load_behavior
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import RobotStatus
from zteam.messages.base import Base

NOW = 100 * TICK
STARTS = [Pose2(6.5, 18.5, 0.0), Pose2(4.25, 18.5, 0.0), Pose2(6.5, 16.5, 0.0), Pose2(4.25, 16.5, 0.0)]
"""The lectures' start poses."""


def seeing(leader: Pose2 | None, age: float = 0.0, own_age: float = 0.0) -> View:
    """Robot 1's view with a free scan, its own pose and, unless None, robot 0 at `leader` in its own base frame."""

    def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
        if (target, source) == ("map", "robot_1/base_footprint"):
            return Pose2(0.0, 0.0, 0.0), NOW - round(own_age * 1e9)
        if source == "robot_0/base_laser_link":
            return None
        assert (target, source) == ("robot_1/base_footprint", "robot_0/base_footprint")
        return (leader, NOW - round(age * 1e9)) if leader else None

    return make_view(make_scan([30.0] * 271, NOW), now=NOW, robot_id=1, lookup=lookup)


def follower() -> Behavior:
    """Robot 1 following robot 0 straight."""
    return load_behavior("follow", {"leader": 0, "law": "direct"}, robot_id=1)


@pytest.mark.parametrize(
    ("leader", "speed", "turn"),
    [
        (Pose2(1.2, 0.0, 0.0), 0.6, 0.0),
        (Pose2(5.0, 0.0, 0.0), 0.7, 0.0),
        (Pose2(1.0, 0.1, 2.0), 0.5 * math.hypot(1.0, 0.1), 4.0 * math.atan2(0.1, 1.0)),
        (Pose2(0.1, 2.0, 0.0), 0.7, 3.14),
        (Pose2(0.1, -2.0, 0.0), 0.7, -3.14),
        (Pose2(0.8, 0.0, 0.0), 0.0, 0.0),
        (Pose2(-0.3, 0.2, 0.0), 0.0, 0.0),
    ],
)
def test_the_law(leader: Pose2, speed: float, turn: float) -> None:
    """v = 0.5 d up to 0.7, w = 4 atan2(y, x) within 3.14 both ways, zero at 0.8 m or nearer."""
    command = follower().step(seeing(leader))
    assert command.linear.x == pytest.approx(speed)
    assert command.angular.z == pytest.approx(turn)


@pytest.mark.parametrize("y", [0.5, -0.5])
def test_a_leader_behind_is_turned_to_on_the_spot(y: float) -> None:
    """No forward speed while facing away, full turn towards its side."""
    command = follower().step(seeing(Pose2(-2.0, y, 0.0)))
    assert command.linear.x == 0.0
    assert command.angular.z == math.copysign(3.14, y)


def test_a_failed_lookup_moves_nobody() -> None:
    """The command after a failed look-up is zero, and not the one before (the seeds drove on stale memory)."""
    behavior = follower()
    assert behavior.step(seeing(Pose2(2.0, 1.0, 0.0))).linear.x > 0.0
    command = behavior.step(seeing(None))
    assert (command.linear.x, command.angular.z) == (0.0, 0.0)
    assert behavior.reason == "leader robot_0 not seen"


@pytest.mark.parametrize(("age", "moves"), [(0.0, True), (0.5, True), (0.51, False), (-0.51, False)])
def test_a_stale_leader_is_not_followed(age: float, moves: bool) -> None:
    """A pose older than half a second, or from the future, does not move the robot; a fresh one does again."""
    behavior = follower()
    command = behavior.step(seeing(Pose2(2.0, 0.0, 0.0), age))
    assert (command.linear.x > 0.0) is moves
    assert behavior.reason == ("" if moves else "leader robot_0 not seen for 0.5 s")
    assert behavior.step(seeing(Pose2(2.0, 0.0, 0.0))).linear.x > 0.0
    assert behavior.reason == ""


def test_a_transform_of_fixed_frames_has_no_age() -> None:
    """Stamp 0 means that nothing on the way ever moves."""
    command, reason = decide(follower(), seeing(Pose2(2.0, 0.0, 0.0), age=NOW / 1e9, own_age=NOW / 1e9))
    assert (command.linear.x, reason) == (0.7, "")


def test_a_pose_that_is_no_number_moves_nobody() -> None:
    """NaN from the tree becomes zero, not a NaN command."""
    assert follower().step(seeing(Pose2(math.nan, 1.0, 0.0))).linear.x == 0.0


def test_its_own_stale_pose_stops_it_first() -> None:
    """Old transforms of its own are named as such and not blamed on the leader."""
    command, reason = decide(follower(), seeing(Pose2(2.0, 0.0, 0.0), age=0.6, own_age=0.6))
    assert (command.linear.x, reason) == (0.0, "its own pose in map is stale")
    command, reason = decide(follower(), seeing(Pose2(2.0, 0.0, 0.0), age=0.6))
    assert (command.linear.x, reason) == (0.0, "leader robot_0 not seen for 0.5 s")


@pytest.mark.parametrize(("half", "turns"), [(0.1, False), (0.175, True), (0.3, True)])
def test_a_post_is_passed_at_the_width_of_the_base(half: float, turns: bool) -> None:
    """A post 0.22 m beside the way to the leader is gone round by a base that would brush it, not by a narrow one."""
    view = seeing(Pose2(2.0, 0.0, 0.0))
    ranges = [30.0] * 541
    ranges[270 + round(math.degrees(math.atan2(0.22, 0.4)) * 2)] = math.hypot(0.22, 0.4)
    base = Base(footprint=box_points(half))
    command = follower().step(msgspec.structs.replace(view, scan=make_scan(ranges, NOW), base=base))
    assert (command.angular.z < 0.0) is turns


def test_no_robot_follows_itself() -> None:
    """It is refused when it is made, or stands still where the robot's id was not known then."""
    with pytest.raises(UsageError, match="robot 1 cannot follow itself"):
        load_behavior("follow", {"leader": 1}, robot_id=1)
    behavior = load_behavior("follow", {"leader": 1, "law": "direct"})
    assert behavior.step(seeing(None)).linear.x == 0.0
    assert behavior.reason == "the robots follow each other in a circle"


def test_it_is_ready_with_its_leaders_pose() -> None:
    """The leader's pose is named as missing while it is not there or old."""
    behavior = follower()
    assert behavior.missing(seeing(None)) == ["the pose of its leader robot_0"]
    assert behavior.missing(seeing(Pose2(1.0, 0.0, 0.0), age=2.0)) == ["the pose of its leader robot_0"]
    assert behavior.missing(seeing(Pose2(1.0, 0.0, 0.0))) == []


@pytest.mark.few(1)
@pytest.mark.parametrize("law", ["trail", "direct"])
@pytest.mark.parametrize("delay", [0, 1, 2])
def test_a_line_of_four_holds(delay: int, law: str) -> None:
    """The lectures' exercise, 30 s: all gaps end below 2.5 m, no robot touches another, all have moved 2 m.

    A wall stands 5.3 m ahead of the leader; transforms are up to two ticks old; every behaviour has the safety layer.
    """
    walls: list[Segment] = [(11.8, 10.0, 11.8, 25.0)]
    floor = Floor(STARTS, walls, delay=delay)
    team = [load_behavior("avoid", {"speed": 0.2}, 0)]
    team += [load_behavior("follow", {"leader": i - 1, "law": law}, i) for i in (1, 2, 3)]
    travelled, nearest = [0.0] * 4, math.inf
    for _ in range(300):
        before = floor.poses
        floor.step(team)
        for i, (a, b) in enumerate(zip(before, floor.poses, strict=True)):
            travelled[i] += math.hypot(b.x - a.x, b.y - a.y)
            nearest = min(nearest, *(math.hypot(b.x - c.x, b.y - c.y) for c in floor.poses[:i]), math.inf)
    gaps = [math.hypot(a.x - b.x, a.y - b.y) for a, b in pairwise(floor.poses)]
    assert max(gaps) <= 2.5
    assert min(travelled) > 2.0
    assert nearest > 0.5
    assert floor.poses[0].x == pytest.approx(11.26, abs=0.05)  # the leader stands half a metre from the wall


def follow_still_leader(leader: Pose2, walls: list[Segment], *others: Pose2) -> tuple[Floor, float]:
    """30 s after robot 1 began at the origin to follow a leader that stands: the floor, and the least room it had."""
    floor = Floor([leader, Pose2(0.0, 0.0, 0.0), *others], walls)
    still, behavior = load_behavior("forward", {"speed": 0.0}), follower()
    room = math.inf
    for _ in range(300):
        floor.step([still, behavior, *(still for _ in others)])
        x, y, _yaw = floor.poses[1]
        room = min(room, *(math.hypot(x - o.x, y - o.y) for o in others), clearance(floor.poses[1], walls))
    return floor, room


def distance(floor: Floor) -> float:
    """Between robots 0 and 1."""
    return math.hypot(floor.poses[0].x - floor.poses[1].x, floor.poses[0].y - floor.poses[1].y)


def test_a_follower_goes_round_whoever_stands_between() -> None:
    """A robot that stands in the straight way is not run over, and does not end the following."""
    floor, room = follow_still_leader(Pose2(4.0, 0.0, 0.0), [], Pose2(1.5, 0.0, 0.0))
    assert distance(floor) < 0.85
    assert room > 0.2


def test_a_follower_goes_round_the_corner_that_its_leader_went_round() -> None:
    """The straight way leads through a wall: it drives along the wall to its end and touches nothing."""
    floor, room = follow_still_leader(Pose2(3.0, 0.4, 0.0), [(1.5, -1.0, 1.5, 4.0)])
    assert distance(floor) < 0.85
    assert room > 0.17


def test_a_follower_that_is_shut_in_touches_nothing() -> None:
    """Without any way to its leader it looks for one, stays inside and keeps off the walls."""
    walls: list[Segment] = [
        (1.5, -1.0, 1.5, 1.0),
        (-1.5, -1.0, -1.5, 1.0),
        (-1.5, 1.0, 1.5, 1.0),
        (-1.5, -1.0, 1.5, -1.0),
    ]
    floor, room = follow_still_leader(Pose2(4.0, 0.0, 0.0), walls)
    assert abs(floor.poses[1].x) < 1.5
    assert abs(floor.poses[1].y) < 1.0
    assert room > 0.2


def test_a_wall_in_front_of_its_nose_is_not_pushed() -> None:
    """Where no heading is clear it keeps to the leader's bearing, and the safety layer stops it there and says so."""
    scan = make_scan([0.3] * 271, NOW)
    view = seeing(Pose2(3.0, 0.0, 0.0))
    view = make_view(scan, now=NOW, robot_id=1, lookup=view.lookup)
    command, reason = decide(follower(), view)
    assert (command.linear.x, command.angular.z, reason) == (0.0, 0.0, "obstacle ahead")


def test_it_does_not_swing_in_front_of_a_post() -> None:
    """The side it goes round on is kept although the other has become the shorter."""
    behavior = follower()

    def turn(hit_deg: int) -> float:
        ranges = [30.0] * 271
        ranges[135 + hit_deg] = 0.5
        view = seeing(Pose2(3.0, 0.0, 0.0))
        scan = make_scan(ranges, NOW, math.radians(270.0))
        return behavior.step(make_view(scan, now=NOW, robot_id=1, lookup=view.lookup)).angular.z

    assert turn(-5) > 0.0
    assert turn(5) > 0.0
    assert turn(90) == 0.0
    assert turn(5) < 0.0


def test_a_way_round_is_looked_for_anew_where_anything_differs() -> None:
    """After the same step several times, a beam, the leader's place and the base count in that very step."""
    behavior = follower()

    def turn(behavior: Behavior, hit_deg: int, leader: Pose2, half: float) -> float:
        ranges = np.full(271, 30.0, np.float32)
        ranges[135 + hit_deg] = 0.5
        ranges.setflags(write=False)
        scan = msgspec.structs.replace(make_scan(ranges, NOW, math.radians(270.0)), ranges=ranges)
        base = Base(footprint=box_points(half))
        lookup = seeing(leader).lookup
        return behavior.step(make_view(scan, now=NOW, robot_id=1, lookup=lookup, base=base)).angular.z

    ahead, beside = Pose2(3.0, 0.0, 0.0), Pose2(3.0, 0.5, 0.0)
    first = (-5, ahead, 0.175)
    for other in [(90, ahead, 0.175), (-15, ahead, 0.175), (-5, beside, 0.175), (-5, ahead, 0.25)]:
        turns = [turn(behavior, *first) for _ in range(3)]
        assert turns == [turn(follower(), *first)] * 3
        found = turn(behavior, *other)
        assert found == turn(follower(), *other)
        assert found != turns[0]


def test_the_chain_is_the_newest_that_is_told() -> None:
    """Another leader in a status, a robot that is gone and a parameter that is set count in that very step."""
    behavior = load_behavior("follow", {"leader": 1}, robot_id=2)

    def reason(leader_of_1: int, team: tuple[int, ...] = (0, 1, 2)) -> str:
        told = {
            i: RobotStatus(robot_id=i, behavior="follow", leader=leader, gap=0.8)
            for i, leader in ((1, leader_of_1), (2, 1))
        }
        behavior.step(make_view(robot_id=2, team=team, inputs={"statuses": told}))
        return behavior.reason

    unknown, circle = "its own pose in map is not known", "the robots follow each other in a circle"
    assert [reason(0), reason(0), reason(2), reason(2), reason(0)] == [unknown, unknown, circle, circle, unknown]
    gone, alone = "leader robot_0 is gone", (1, 2)
    assert [reason(0, alone), reason(0, alone), reason(0)] == [gone, gone, unknown]
    team = (0, 2)
    assert reason(0, team) == unknown
    behavior.params = msgspec.structs.replace(behavior.params, on_leader_lost="stop")
    behavior.on_params()
    assert reason(0, team) == "leader robot_1 is gone"
