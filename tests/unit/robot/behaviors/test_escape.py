"""Getting free in a narrow place."""

import math
import random

import numpy as np
import pytest

from support.flat_floor import BEAMS, TICK, Floor, box, clearance, make_odometry, make_scan, make_view
from zteam.behaviors import Behavior, View
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import NoParams
from zteam.robot.behaviors.escape import Escape
from zteam.robot.behaviors.wander import Forward, ForwardParams
from zteam.robot.view import own_pose

TURN = Twist(angular=Vector3(z=1.0))


class Seeker(Behavior):
    """Turns to the first place of a way that it has not been at, and drives there, whatever stands between."""

    uses_tf = True

    def __init__(self, *way: tuple[float, float]) -> None:
        super().__init__(NoParams())
        self.way, self.escape = list(way), Escape()

    def step(self, view: View) -> Twist:
        own = own_pose(view)
        assert own is not None
        while self.way and math.dist(own[:2], self.way[0]) < 0.2:
            self.way.pop(0)
        if not self.way:
            return Twist()
        way = [own.locate(*place) for place in self.way]
        bearing = math.atan2(way[0][1], way[0][0])
        turn = Twist(angular=Vector3(z=math.copysign(1.0, bearing)))
        return self.escape.free(view, turn if abs(bearing) > 0.2 else Twist(Vector3(0.3), Vector3(z=bearing)), way)


def seek(floor: Floor, *way: tuple[float, float], seconds: float = 90.0) -> list[Pose2]:
    """The track of a robot to the end of a way."""
    seeker, track = Seeker(*way), []
    for _ in range(round(10 * seconds)):
        floor.step([seeker])
        track.append(floor.poses[0])
        if not seeker.way:
            break
    return track


CORRIDOR = box(0.0, 0.0, 6.0, 0.9)


@pytest.mark.parametrize("seed", range(4))
def test_a_robot_gets_out_of_the_end_of_a_corridor(seed: int) -> None:
    """However it stands there, near a wall or a corner, it gets to the other end without touching a wall."""
    draw = random.Random(seed)
    while True:
        start = Pose2(draw.uniform(0.2, 0.8), draw.uniform(0.2, 0.7), draw.uniform(-math.pi, math.pi))
        corners = [start.compose(Pose2(x, y, 0.0)) for x in (-0.24, 0.14) for y in (-0.19, 0.19)]
        if all(0.0 < corner.x < 6.0 and 0.0 < corner.y < 0.9 for corner in corners):
            break
    floor = Floor([start], CORRIDOR)
    track = seek(floor, (5.0, 0.45))
    assert math.dist(track[-1][:2], (5.0, 0.45)) < 0.2
    assert min(clearance(pose, CORRIDOR) for pose in track) > 0.12


def test_it_goes_round_what_stands_in_its_way() -> None:
    """Past a post that it drove straight at."""
    walls = box(0.0, 0.0, 6.0, 2.0) + box(1.8, 0.5, 2.2, 0.9)
    track = seek(Floor([Pose2(0.5, 0.6, 0.0)], walls), (4.0, 0.7))
    assert math.dist(track[-1][:2], (4.0, 0.7)) < 0.2
    assert min(clearance(pose, walls) for pose in track) > 0.12


@pytest.mark.parametrize(("length", "leads"), [(1.0, False), (3.0, True)])
def test_it_leaves_a_place_only_for_one_that_is_some_way_off(length: float, leads: bool) -> None:
    """0.6 m at least: in a closet that it has seen from both sides there is none, in a corridor there is."""
    floor, escape = Floor([Pose2(0.5, 0.5, 0.0)], box(0.0, 0.0, length, 1.0)), Escape()
    escape.leave(floor.view(0))
    turning = Forward(ForwardParams())
    turning.step = lambda _view: TURN  # type: ignore[method-assign]
    for _ in range(31):
        floor.step([turning])
    assert escape.leave(floor.view(0)) is leads
    assert escape.is_moving is leads


def ask(escape: Escape, tick: int, yaw: float, command: Twist, x: float = 0.0) -> Twist:
    """The command of one tick on an open floor."""
    scan = make_scan(np.full(BEAMS, 30.0), tick * TICK)
    return escape.free(make_view(scan, now=tick * TICK, odom=make_odometry(Pose2(x, 2.0, yaw))), command)


def test_what_does_not_work_is_not_tried_again() -> None:
    """A base that nothing moves tries a turn the other way and drives both ways, each for less than 1 s."""
    escape, tried = Escape(), []
    for tick in range(1, 80):
        command = ask(escape, tick, 0.0, TURN)
        kind = (np.sign(command.linear.x), np.sign(command.angular.z))
        if not tried or tried[-1][0] != kind:
            tried.append([kind, 0])
        tried[-1][1] += 1
    assert {(1, 0), (-1, 0), (0, -1)} <= {kind for kind, _ in tried}
    assert all(ticks < 10 for kind, ticks in tried if kind != (0, 1))
    assert len({kind for kind, _ in tried[1:4]}) == 3


def test_what_did_not_work_is_tried_again_where_nothing_else_is_left() -> None:
    """What stood there may have driven on: a base that nothing moves backs up twice within 15 s."""
    escape, backs = Escape(), [False]
    for tick in range(1, 150):
        is_back = ask(escape, tick, 0.0, TURN).linear.x < 0.0
        if is_back != backs[-1]:
            backs.append(is_back)
    assert backs.count(True) >= 2


@pytest.mark.parametrize("turned", [0.1, -0.1, 0.01])
def test_a_robot_that_turns_is_left_alone(turned: float) -> None:
    """Also one that turns slowly."""
    escape = Escape()
    assert [ask(escape, i, turned * i, TURN) for i in range(1, 80)] == [TURN] * 79


@pytest.mark.parametrize("command", [Twist(), Twist(Vector3(0.3)), Twist(Vector3(0.01), Vector3(z=1.0))])
def test_a_robot_that_need_not_turn_on_the_spot_is_left_alone(command: Twist) -> None:
    """It stands, or drives nowhere in particular: what keeps it there is not the room to turn."""
    escape = Escape()
    assert [ask(escape, i, 0.0, command) for i in range(1, 80)] == [command] * 79
