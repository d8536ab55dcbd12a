"""Keeping a place in a formation."""

import math
from collections.abc import Iterator
from itertools import combinations
from typing import get_args

import pytest

from support.flat_floor import clearance, drive
from support.team_floor import Commanded, TeamFloor
from zteam.behaviors import Behavior, load_behavior
from zteam.geometry import Pose2
from zteam.messages import RobotStatus, Twist, Vector3
from zteam.robot.behaviors.formation import Shape, assign, slots_of
from zteam.testing import make_view

FREE = [30.0] * 91
STAND, FORWARD = Twist(), Twist(Vector3(0.4))
POSES = {
    0: Pose2(0.0, 0.0, 0.0),
    1: Pose2(-1.0, 0.9, 2.0),
    2: Pose2(-0.8, -0.9, -1.0),
    3: Pose2(-1.9, 0.3, 3.0),
    4: Pose2(-2.0, -1.0, 0.0),
}


class Squad:
    """Leader 0 and its formation on a floor without end."""

    def __init__(self, **params: object) -> None:
        self.poses = dict(POSES)
        self.behaviors: dict[int, Behavior] = {}
        for robot in (1, 2, 3, 4):
            self.join(robot, **params)
        self.commands: dict[int, Twist] = {}
        self._ticks = 10

    def join(self, robot: int, **params: object) -> None:
        """One more robot with the behaviour."""
        self.behaviors[robot] = load_behavior("formation", {"leader": 0, **params}, robot)

    def run(self, seconds: float, leader: Twist) -> None:
        """All decide on the same instant and move together."""
        for _ in range(round(10 * seconds)):
            self._ticks += 1
            statuses = {robot: RobotStatus(behavior="formation", leader=0) for robot in self.behaviors}
            self.commands = {
                robot: behavior.step(
                    make_view(
                        FREE,
                        fov=4.7,
                        robot_id=robot,
                        poses=self.poses,
                        now=0.1 * self._ticks,
                        inputs={"statuses": statuses},
                    )
                )
                for robot, behavior in self.behaviors.items()
            }
            commands = {0: leader, **self.commands}
            self.poses = {robot: drive(pose, commands.get(robot, STAND), 0.1) for robot, pose in self.poses.items()}

    def worst(self, shape: str, robots: tuple[int, ...] = (1, 2, 3, 4), spacing: float = 0.8) -> float:
        """Metres by which the worst robot is off its slot behind a leader that has driven straight on."""
        seen = [self.poses[0].inverse().compose(self.poses[robot]) for robot in robots]
        slots = slots_of(shape, len(robots), spacing)  # type: ignore[arg-type]
        table = [[math.hypot(x + slot.back, y - slot.lateral) for slot in slots] for x, y, _ in seen]
        return max(table[row][column] for row, column in enumerate(assign(table)))


@pytest.mark.parametrize("shape", get_args(Shape))
def test_each_shape_is_formed(shape: str) -> None:
    """Behind a leader that drives straight on all are within 3 cm of the slots after 10 s, each in its own."""
    squad = Squad(shape=shape)
    squad.run(10.0, FORWARD)
    assert squad.worst(shape) < 0.03


def test_a_standing_leader_has_a_standing_formation() -> None:
    """All come to their slots, turn to the leader's heading and stand there, and say so."""
    squad = Squad(shape="diamond")
    squad.run(2.0, FORWARD)
    squad.run(20.0, STAND)
    assert squad.worst("diamond") < 0.05
    assert all(command == STAND for command in squad.commands.values())
    assert all(abs(squad.poses[robot].yaw) < 0.06 for robot in squad.behaviors)
    assert {behavior.reason for behavior in squad.behaviors.values()} == {"in its slot; leader robot_0 stands"}


def test_a_robot_that_is_gone_leaves_no_gap() -> None:
    """The three others form the shape of three, and that of four again when it has come back."""
    squad = Squad(shape="line")
    squad.run(8.0, FORWARD)
    del squad.behaviors[1]
    gone = squad.poses.pop(1)
    squad.run(8.0, FORWARD)
    assert squad.worst("line", (2, 3, 4)) < 0.05
    squad.poses[1] = Pose2(gone.x, gone.y - 3.0, 0.0)
    squad.join(1, shape="line")
    squad.run(20.0, FORWARD)
    assert squad.worst("line") < 0.05


def test_who_runs_something_else_is_no_member() -> None:
    """A robot that only drives there gets no slot; with `team`, only those that are named get one."""
    squad = Squad(shape="column")
    del squad.behaviors[4]
    squad.run(10.0, FORWARD)
    assert squad.worst("column", (1, 2, 3)) < 0.05
    named = Squad(shape="column", team=[1, 2])
    del named.behaviors[3], named.behaviors[4]
    named.run(10.0, FORWARD)
    assert named.worst("column", (1, 2)) < 0.05


def test_without_its_leader_it_stands_and_says_why() -> None:
    """Before the leader is seen the robot is not ready; afterwards it stands while the leader's pose is old."""
    behavior = load_behavior("formation", {"leader": 0}, 1)
    alone = make_view(FREE, robot_id=1, poses={1: (0, 0, 0)})
    assert behavior.missing(alone) == ["the pose of its leader robot_0"]
    assert behavior.step(alone) == STAND
    assert behavior.reason == "leader robot_0 not seen"
    lost = make_view(FREE, robot_id=1, poses={0: (math.nan, 0, 0), 1: (0, 0, 0)})
    assert behavior.step(lost) == STAND
    assert behavior.reason == "the pose of leader robot_0 is no number"
    seen = make_view(FREE, robot_id=1, poses={0: (3, 0, 0), 1: (0, 0, 0)})
    assert behavior.missing(seen) == []
    assert behavior.step(seen).linear.x > 0.0


def in_corridor(leader: Behavior, seed: int = 1) -> Iterator[TeamFloor]:
    """A wedge of four with its leader before the closed end of a corridor that leads into the open: after each tick."""
    team = [leader, *(load_behavior("formation", {"leader": 0}, robot) for robot in (1, 2, 3))]
    walls = [(0.0, -0.5, 4.0, -0.5), (0.0, 0.5, 4.0, 0.5), (4.0, -0.5, 4.0, 0.5)]
    floor = TeamFloor([(Pose2(3.4 - 0.8 * i, 0.0, 0.0), behavior) for i, behavior in enumerate(team)], walls, seed=seed)
    for _ in range(600):
        floor.tick()
        assert all(math.dist(a[:2], b[:2]) > 0.4 for a, b in combinations(floor.poses, 2))
        assert min(clearance(pose, walls) for pose in floor.poses) > 0.12
        yield floor


@pytest.mark.parametrize("seed", [1, 2])
def test_a_formation_gets_out_of_a_dead_end(seed: int) -> None:
    """Its last robot leads it out as a line, and behind its leader it is a formation again."""
    for floor in in_corridor(load_behavior("wander", {}, 0), seed):
        is_out = all(pose.x < -0.3 or abs(pose.y) > 0.5 for pose in floor.poses)
        if is_out and [(behavior.leader, behavior.gap) for behavior in floor.team[1:]] == 3 * [(0, 0.0)]:
            return
    pytest.fail("it is not out after a minute")


def test_all_robots_of_a_formation_are_in_the_file_or_none_is() -> None:
    """The first of them says it, and the others hear it in its next status, half a second later at most."""
    apart = [
        len({behavior.gap for behavior in floor.team[1:]}) > 1 for floor in in_corridor(load_behavior("wander", {}, 0))
    ]
    assert not any(all(apart[tick : tick + 8]) for tick in range(len(apart) - 8))


def test_a_formation_makes_room_for_a_leader_that_is_driven_out_of_a_dead_end() -> None:
    """One behind the other they stand behind a leader that turns round, and go before it as it comes."""
    *_, floor = in_corridor(Commanded((0.0, 0.5, 63), (0.2, 0.0, 200)))
    assert floor.poses[0].x < 0.5
