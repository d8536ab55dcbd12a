"""forward, avoid and wander: the lectures' behaviours and the faults they had."""

import math

import pytest
from msgspec import structs

from support.flat_floor import LASER, Segment, box, cast, make_odometry, make_scan, make_view
from support.world_texts import box_points
from zteam import testing
from zteam.behaviors import View, load_behavior
from zteam.geometry import Pose2
from zteam.messages import LaserScan, RobotStatus
from zteam.messages.base import Base

FREE = [30.0] * 271


def speed_of(behavior: str, scan: LaserScan | None, **params: float) -> float:
    """Forward speed of the behaviour's first step, without the safety layer."""
    return load_behavior(behavior, params).step(make_view(scan)).linear.x


def with_hit(distance: float, bearing_deg: float) -> LaserScan:
    """All free but one beam; one beam a degree over 270 degrees."""
    ranges = list(FREE)
    ranges[135 + round(bearing_deg)] = distance
    return make_scan(ranges, fov=math.radians(270.0))


def test_forward_is_the_lectures_speed() -> None:
    """0.2 m/s unless told otherwise, straight on."""
    command = load_behavior("forward", {}).step(make_view(make_scan(FREE)))
    assert (command.linear.x, command.angular.z) == (0.2, 0.0)
    assert speed_of("forward", make_scan(FREE), speed=-0.1) == -0.1


@pytest.mark.parametrize("bearing_deg", [-60, -30, 0, 45, 60])
def test_avoid_stops_for_what_is_near_in_its_cone(bearing_deg: float) -> None:
    """Nearer than 0.5 m within 60 degrees to either side stops it; exactly as far or further does not."""
    assert speed_of("avoid", with_hit(0.49, bearing_deg)) == 0.0
    assert speed_of("avoid", with_hit(0.5, bearing_deg)) == 0.2


@pytest.mark.parametrize("bearing_deg", [-61, 61, 100])
def test_avoid_ignores_what_is_beside_it(bearing_deg: float) -> None:
    """A wall along the way does not stop it."""
    assert speed_of("avoid", with_hit(0.3, bearing_deg)) == 0.2


@pytest.mark.parametrize("value", [math.nan, 0.0, 0.05])
def test_beams_that_say_nothing_are_no_obstacle_and_no_free_space(value: float) -> None:
    """A few of them let it drive, many stop it."""
    few, many = make_scan(FREE, fov=math.radians(270.0)), make_scan(FREE, fov=math.radians(270.0))
    for scan, count in ((few, 20), (many, 40)):  # of 121 in the cone
        scan.range_min = 0.1
        scan.ranges[100 : 100 + count] = value
    assert speed_of("avoid", few) == 0.2
    assert speed_of("avoid", many) == 0.0
    assert speed_of("avoid", many, max_invalid=0.5) == 0.2


@pytest.mark.parametrize("behavior", ["avoid", "wander"])
def test_there_is_no_blind_start(behavior: str) -> None:
    """Without a scan, with an empty one, or with one that looks elsewhere, nothing drives forward."""
    for scan in (None, make_scan([]), LaserScan(ranges=make_scan(FREE).ranges, range_max=30.0)):
        assert speed_of(behavior, scan) == 0.0


@pytest.mark.parametrize(("half", "drives"), [(0.175, True), (0.3, False)])
def test_wander_needs_the_room_that_its_base_turns_in(half: float, drives: bool) -> None:
    """Something 0.35 m to the side, outside the cone, turns a base away whose corners would reach it."""
    ranges = list(FREE)
    ranges[135 + round(math.degrees(math.atan2(0.35, 0.15)))] = math.hypot(0.35, 0.15)
    view = make_view(make_scan(ranges, fov=math.radians(270.0)), base=Base(footprint=box_points(half)))
    assert (load_behavior("wander", {}).step(view).linear.x > 0.0) is drives


@pytest.mark.parametrize(
    ("mate", "drives"),
    [((0.9, 0.0), False), ((0.9, 0.45), False), ((0.0, 0.45), True), ((0.9, 0.75), True), ((-0.7, 0.0), True)],
)
def test_wander_turns_for_a_teammate_that_it_does_not_see(mate: tuple[float, float], drives: bool) -> None:
    """The scan is free, but transforms tell of a robot in the way, or so near to it that neither could turn there."""
    view = testing.make_view(FREE, fov=4.7, poses={0: (2.0, 1.0, 0.0), 1: (2.0 + mate[0], 1.0 + mate[1], 2.0)})
    assert (load_behavior("wander", {}).step(view).linear.x > 0.0) is drives


def test_wander_turns_where_it_is_stopped() -> None:
    """Something that only the safety layer knows of stops it: after a second it turns by 60 degrees or more."""
    behavior, turned, driven = load_behavior("wander", {}), 0.0, 0
    for tick in range(40):
        odom = make_odometry(Pose2(1.0, 1.0, turned))
        command = behavior.step(make_view(make_scan(FREE), now=tick * 100_000_000, odom=odom))
        if command.angular.z:
            turned += 0.1 * abs(command.angular.z)
        elif turned:
            break
        else:
            driven += 1
    assert 10 <= driven <= 12
    assert math.radians(60.0) <= turned <= math.radians(130.0)
    assert command.linear.x > 0.0


def test_wander_stops_further_off_the_faster_it_is() -> None:
    """The distance left in front pays for reaction and braking."""
    wall = make_scan([1.0] * 271)
    assert speed_of("wander", wall, speed=0.4) == 0.4
    assert speed_of("wander", wall, speed=1.0) == 0.0


def line_view(
    walls: list[Segment], seconds: float, driver: str = "behavior", leader: int = -1, turns: int = -1, x: float = 0.0
) -> View:
    """What robot 0 at `x` sees, 0.8 m before robot 1 that says `leader` and `turns`."""
    poses = {"robot_0/base_footprint": Pose2(x, 0.0, 0.0), "robot_1/base_footprint": Pose2(x - 0.8, 0.0, 0.0)}

    def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
        at = poses.get(target, Pose2(0.0, 0.0, 0.0)).inverse()
        return (at.compose(poses[source]), now) if source in poses else None

    now = round(seconds * 1e9)
    statuses = {
        0: RobotStatus(robot_id=0, behavior="wander", driver=driver),
        1: RobotStatus(robot_id=1, behavior="follow", leader=leader, turns=turns, gap=0.8),
    }
    scan = make_scan(cast(LASER, walls), now)
    return make_view(scan, now=now, team=(0, 1), inputs={"statuses": statuses}, lookup=lookup)


def test_wander_without_a_line_drives_as_it_does_alone() -> None:
    """A robot changes no command if it follows no other robot, or if its line cannot be led from the other end."""
    walls = box(-4.0, -0.7, 0.9, 3.0)
    drives = []
    for leader, turns in ((-1, -1), (-1, 0), (0, -1)):
        behavior = load_behavior("wander", {})
        drives.append([behavior.step(line_view(walls, 0.1 * i, leader=leader, turns=turns)) for i in range(1, 100)])
        assert (behavior.uses_tf, behavior.follows) == (False, None)
    alone = load_behavior("wander", {})
    views = [line_view(walls, 0.1 * i) for i in range(1, 100)]
    expected = [alone.step(structs.replace(view, inputs={})) for view in views]
    assert drives == [expected] * 3


@pytest.mark.parametrize(
    ("driver", "hand_over", "turns"),
    [("behavior", True, 1), ("none", True, 1), ("teleop", True, 0), ("behavior", False, -1)],
)
def test_wander_with_a_line_behind_it_hands_over_where_it_is_shut_in(driver: str, hand_over: bool, turns: int) -> None:
    """Then it follows; not while teleop drives it, nor where its parameter says that it must not."""
    walls, behavior = box(-20.0, -0.7, 0.7, 0.7), load_behavior("wander", {"hand_over": hand_over})
    said = []
    for i in range(1, 90):
        behavior.step(line_view(walls, 0.1 * i, driver, leader=0, turns=0))
        said.append(behavior.reason)
        if behavior.turns == 1:
            break
    assert behavior.turns == turns
    assert (said[-1] == "hands over to the other end of the line") is (turns == 1)
    behavior.step(line_view(walls, 9.1, driver, leader=0, turns=max(turns, 0)))
    assert behavior.follows == (1 if turns == 1 else None)
    assert behavior.uses_tf is (turns == 1)


@pytest.mark.parametrize("driver", ["teleop", "behavior"])
def test_a_wander_that_led_nobody_for_long_leads_on(driver: str) -> None:
    """Ten seconds in which teleop held it, or in which it had no pose, are no reason to hand over."""
    behavior = load_behavior("wander", {})
    for i in range(10, 140):
        view = line_view(box(-20.0, -9.0, 20.0, 9.0), 0.1 * i, leader=0, turns=0, x=0.03 * min(i, 30))
        if 30 <= i < 130:
            statuses = {**view.inputs["statuses"], 0: RobotStatus(robot_id=0, behavior="wander", driver=driver)}
            unseen = {"inputs": {"statuses": statuses}} if driver == "teleop" else {"lookup": lambda _a, _b: None}
            view = structs.replace(view, **unseen)
        command = behavior.step(view)
    assert (command.linear.x, behavior.reason, behavior.turns) == (0.4, "", 0)
