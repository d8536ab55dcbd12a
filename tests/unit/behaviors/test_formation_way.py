"""Formations that cannot go straight to their slots: a leader that turns back, and walls between."""

import math
from collections.abc import Callable

import msgspec
import pytest

from support.flat_floor import Floor, Segment, box
from zteam.behaviors import Behavior, View, load_behavior
from zteam.geometry import Pose2
from zteam.messages import RobotStatus, Twist, Vector3

CORRIDOR: list[Segment] = box(-12.0, -0.9, 1.0, 0.9)
"""A dead end 1.8 m wide."""
COLUMN = [Pose2(-0.8 * i, 0.0, 0.0) for i in range(4)]


class Led(Behavior):
    """A leader that a test drives."""

    uses_tf = True

    def __init__(self, law: Callable[[View], Twist]) -> None:
        super().__init__(None)
        self._law = law

    def step(self, view: View) -> Twist:
        """By the law."""
        return self._law(view)


class FormationFloor(Floor):
    """A floor on which the robots know of each other's formation."""

    def view(self, robot_id: int) -> View:
        """As on any floor, with statuses and team."""
        team = tuple(range(len(self.poses)))
        statuses = {robot: RobotStatus(behavior="formation", leader=0) for robot in team[1:]}
        return msgspec.structs.replace(super().view(robot_id), inputs={"statuses": statuses}, team=team)


def follow(floor: Floor, leader: Behavior, shape: str, seconds: float, **params: float) -> tuple[list[set[str]], float]:
    """What each follower said, and the least distance between two robots."""
    followers = [
        load_behavior("formation", {"leader": 0, "shape": shape, **params}, robot)
        for robot in range(1, len(floor.poses))
    ]
    said: list[set[str]] = [set() for _ in followers]
    nearest = math.inf
    for _ in range(round(10 * seconds)):
        floor.step([leader, *followers])
        for robot, behavior in enumerate(followers):
            said[robot].add(behavior.reason)
        nearest = min(nearest, *(math.dist(a[:2], b[:2]) for i, a in enumerate(floor.poses) for b in floor.poses[:i]))
    return said, nearest


def test_a_leader_that_turns_in_a_dead_end_gets_out() -> None:
    """Its formation stands behind it; each robot says that it makes way, and the leader has room to drive back."""
    floor = FormationFloor(COLUMN, CORRIDOR)
    leader = Led(lambda view: Twist(angular=Vector3(z=1.0)))
    said, nearest = follow(floor, leader, "column", 15.0)
    assert all(pose.x < -1.4 for pose in floor.poses[1:])
    assert "makes way: robot_0 turns back" in said[0]
    assert nearest > 0.35


def test_a_leader_that_only_stands_is_waited_for() -> None:
    """Nobody leaves its slot while it does not turn."""
    floor = FormationFloor(COLUMN, CORRIDOR)
    said, _ = follow(floor, Led(lambda view: Twist()), "column", 10.0)
    assert all(reasons <= {"in its slot; leader robot_0 stands", ""} for reasons in said)
    assert all(math.dist(pose[:2], start[:2]) < 0.05 for pose, start in zip(floor.poses, COLUMN, strict=True))


@pytest.mark.few(1)
def test_a_robot_behind_a_corner_comes_along_the_trail() -> None:
    """Its leader has driven round a corner out of its sight: it does not stand at the wall between."""
    walls: list[Segment] = [(1.0, 0.6, 1.0, 6.0), (-1.0, 0.6, 1.0, 0.6), (3.0, -2.0, 3.0, 6.0)]
    floor = FormationFloor([Pose2(0.8, -0.5, 0.0), Pose2(-0.5, 0.25, 0.3)], walls)
    ways = [(2.0, -0.5), (2.0, 4.0)]

    def drive(view: View) -> Twist:
        own = view.map_from_base()
        assert own is not None
        while len(ways) > 1 and math.dist(ways[0], own[0][:2]) < 0.3:
            del ways[0]
        x, y, _ = own[0].inverse().compose(Pose2(*ways[0], 0.0))
        bearing = math.atan2(y, x)
        done = math.hypot(x, y) < 0.2
        return Twist() if done else Twist(Vector3(0.7 if abs(bearing) < 0.5 else 0.0), Vector3(z=2.0 * bearing))

    follow(floor, Led(drive), "column", 60.0, max_linear=0.3)
    assert math.dist(floor.poses[0][:2], floor.poses[1][:2]) < 1.0


def test_a_robot_that_has_no_room_to_turn_to_its_slot_backs_out() -> None:
    """In a pocket that is too narrow to turn in it drives back until it can, and comes to its slot."""
    pocket: list[Segment] = [(-0.1, 0.21, 0.4, 0.21), (-0.1, -0.21, 0.4, -0.21), (0.4, -0.21, 0.4, 0.21)]
    floor = FormationFloor([Pose2(-2.0, 1.0, math.pi), Pose2(0.0, 0.0, 0.0)], pocket)
    follow(floor, Led(lambda view: Twist()), "column", 40.0)
    assert math.dist(floor.poses[1][:2], (-1.2, 1.0)) < 0.15
