"""follow by law trail: no corners cut, no error that grows along the chain, no collision whatever the leader does."""

import math
from collections.abc import Sequence
from itertools import combinations

import msgspec
import pytest

from support.flat_floor import Floor, Segment
from zteam.behaviors import Behavior, View, load_behavior
from zteam.behaviors.polyline import Polyline
from zteam.geometry import Pose2
from zteam.messages import RobotStatus, Twist, Vector3

GAP = 0.8
FAR: Segment = (50.0, 50.0, 51.0, 50.0)
BEND = 0.6
"""Metres."""
CORNERS = (
    [(0.5, 0.0)] * 60 + [(0.5, 0.5 / BEND)] * 19 + [(0.5, 0.0)] * 40 + [(0.5, -0.5 / BEND)] * 19 + [(0.5, 0.0)] * 60
)
"""A bend to the left and one to the right."""


class Chain(Floor):
    """Robots that know from each other's statuses which one follows which."""

    def view(self, robot_id: int) -> View:
        """With the statuses of all robots."""
        statuses = {
            i: RobotStatus(robot_id=i, behavior="follow" if i else "path", leader=i - 1) for i in range(len(self.poses))
        }
        return msgspec.structs.replace(super().view(robot_id), inputs={"statuses": statuses}, team=tuple(statuses))


class Commanded(Behavior):
    """A leader with a list of commands, one a tick; then it stands."""

    def __init__(self, commands: Sequence[tuple[float, float]]) -> None:
        super().__init__(None)
        self._commands = iter(commands)

    def step(self, view: View) -> Twist:
        """The next command."""
        speed, turn = next(self._commands, (0.0, 0.0))
        return Twist(Vector3(speed), Vector3(z=turn))


def in_line(count: int) -> list[Pose2]:
    """A leader at the origin and the others behind it."""
    return [Pose2(-GAP * i, 0.0, 0.0) for i in range(count)]


def followers(count: int) -> list[Behavior]:
    """The robots behind robot 0."""
    return [load_behavior("follow", {"leader": i - 1, "gap": GAP}, i) for i in range(1, count)]


@pytest.mark.parametrize(("delay", "most"), [(0, 0.02), (2, 0.05)])
def test_no_robot_cuts_corners_and_no_error_grows(delay: int, most: float) -> None:
    """Two bends at 0.5 m/s, poses up to 0.2 s old: the last of six keeps path and place as well as the first does."""
    floor = Chain(in_line(6), [FAR], delay=delay)
    team = [Commanded(CORNERS), *followers(6)]
    path = Polyline([(x, 0.0) for x in (-5.0, 0.0)])
    off: list[list[float]] = [[] for _ in team]
    errors: list[list[float]] = [[] for _ in team]
    for _ in CORNERS:
        floor.step(team)
        path.append(floor.poses[0].x, floor.poses[0].y)
        for i, pose in enumerate(floor.poses[1:], 1):
            place = path.project(pose.x, pose.y, path.end - GAP * i - 1.0)
            nearest = path.at(place)
            off[i].append(math.hypot(nearest.x - pose.x, nearest.y - pose.y))
            errors[i].append(path.end - GAP * i - place)
    assert max(map(max, off[1:])) < most
    rms = [math.sqrt(sum(error * error for error in each) / len(each)) for each in errors[1:]]
    assert max(rms) < 0.05 + 0.5 * 0.1 * delay
    assert rms[-1] < rms[0] + 0.01


def room(poses: Sequence[Pose2]) -> float:
    """Metres between the two nearest robots, base to base."""
    return min(math.hypot(a.x - b.x, a.y - b.y) for a, b in combinations(poses, 2))


TURNING = {
    "backs up": [(0.5, 0.0)] * 60 + [(-0.5, 0.0)] * 120,
    "turns on the spot and comes back": [(0.5, 0.0)] * 60 + [(0.0, math.pi / 2)] * 20 + [(0.5, 0.0)] * 120,
    "drives a circle into its chain": [(0.5, 0.0)] * 20 + [(0.5, 0.5)] * 300,
    "stops and goes": ([(0.5, 0.0)] * 10 + [(0.0, 0.0)] * 7) * 8,
}


@pytest.mark.parametrize("way", TURNING)
def test_nobody_collides_whatever_the_leader_does(way: str) -> None:
    """Four robots of 0.4 m stay 0.45 m apart, base to base."""
    floor = Chain(in_line(4), [FAR])
    team = [Commanded(TURNING[way]), *followers(4)]
    nearest = math.inf
    for _ in range(len(TURNING[way]) + 20):
        floor.step(team)
        nearest = min(nearest, room(floor.poses))
    assert nearest > 0.45
    assert floor.poses[0] != Pose2(0.0, 0.0, 0.0)


def test_a_robot_that_comes_late_finds_its_place() -> None:
    """Robot 3 begins 3 m beside a chain that has driven 5 m: it ends 0.8 m behind robot 2 without contact."""
    floor = Chain([*in_line(3), Pose2(1.0, -3.0, 1.0)], [FAR])
    team = [Commanded([(0.3, 0.0)] * 400), *followers(4)]
    late, team[3] = team[3], load_behavior("idle", {})
    nearest = math.inf
    for tick in range(550):
        if tick == 170:
            team[3] = late
        floor.step(team)
        nearest = min(nearest, room(floor.poses))
    assert nearest > 0.6
    assert [floor.poses[0].x - pose.x for pose in floor.poses[1:]] == pytest.approx([0.8, 1.6, 2.4], abs=0.04)
    assert floor.poses[3].y == pytest.approx(0.0, abs=0.02)


def test_the_place_counts_from_the_head_and_not_from_the_robot_in_front() -> None:
    """Where the robot in front hangs back, the next one does not: it stops for it alone when it comes near."""
    floor = Chain([Pose2(0.0, 0.0, 0.0), Pose2(-0.8, 0.0, 0.0), Pose2(-3.0, 0.0, 0.0)], [FAR])
    team = [Commanded([]), load_behavior("idle", {}), followers(3)[1]]
    for _ in range(100):
        floor.step(team)
    assert floor.poses[2].x == pytest.approx(-1.6, abs=0.05)


def test_a_new_gap_and_a_new_law_hold_at_once() -> None:
    """`zteam param` changes both while the robot follows."""
    floor = Chain(in_line(2), [FAR])
    team = [Commanded([(0.4, 0.0)] * 100), *followers(2)]
    for _ in range(60):
        floor.step(team)
    team[1].params = msgspec.structs.replace(team[1].params, gap=1.2)
    team[1].on_params()
    for _ in range(100):
        floor.step(team)
    assert floor.poses[0].x - floor.poses[1].x == pytest.approx(1.2, abs=0.05)
    team[1].params = msgspec.structs.replace(team[1].params, law="direct")
    team[1].on_params()
    for _ in range(60):
        floor.step(team)
    assert floor.poses[0].x - floor.poses[1].x == pytest.approx(0.8, abs=0.05)
