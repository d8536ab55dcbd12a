"""What a behaviour declares: the newest messages by the names that it gave them."""

from collections.abc import Mapping
from typing import Any

import pytest

from support.real_time_robot import RealTimeRobot
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.messages import Header, Pose, PoseStamped, RobotStatus, String, Twist, time_from_ns
from zteam.robot.behaviors.behavior import DeclaredInput, declared_inputs
from zteam.robot.process.inputs import DeclaredInputs

TICK = 100_000_000
GOAL = DeclaredInput("goal", "robot_1/goal_pose", PoseStamped)
OTHERS = DeclaredInput("others", "robot_$*/status", RobotStatus)


def goal(tick: int) -> PoseStamped:
    """A goal with the stamp of a tick."""
    return PoseStamped(Header(time_from_ns(tick * TICK)))


def status(robot_id: int, tick: int) -> RobotStatus:
    """A status with the stamp of a tick."""
    return RobotStatus(Header(time_from_ns(tick * TICK)), robot_id)


def test_each_name_is_there_before_anything_comes() -> None:
    """A name of one key has no message yet, a name of every robot has none of any robot."""
    assert dict(DeclaredInputs([GOAL, OTHERS]).view()) == {"goal": None, "others": {}}


def test_what_a_step_sees_does_not_change_afterwards() -> None:
    """A view that a behaviour looks at stays as it was when a message comes; the next one has it, by id."""
    inputs = DeclaredInputs([GOAL, OTHERS])
    before = inputs.view()
    inputs.take(GOAL, GOAL.key, goal(1), TICK)
    for robot_id in (2, 0):
        inputs.take(OTHERS, names.robot_key(robot_id, names.STATUS), status(robot_id, 1), TICK)
    assert dict(before) == {"goal": None, "others": {}}
    after = inputs.view()
    assert after["goal"] == goal(1)
    assert [*after["others"]] == [0, 2]


def test_a_jump_of_time_forgets_all() -> None:
    """After a jump back in time nothing counts."""
    inputs = DeclaredInputs([GOAL, OTHERS])
    inputs.take(GOAL, GOAL.key, goal(1), TICK)
    inputs.take(OTHERS, "robot_0/status", status(0, 3), TICK)
    inputs.forget()
    assert dict(inputs.view()) == {"goal": None, "others": {}}


class Looker(Behavior):
    """Keeps its views."""

    inputs = {  # noqa: RUF012
        "goal": ("goal_pose", PoseStamped),
        "others": ("robot_$*/status", RobotStatus),
        "of_robot_0": ("robot_0/orders", String),
        "all": ("/orders", String),
    }
    seen: list[Mapping[str, Any]]
    teams: list[tuple[int, ...]]

    def step(self, view: View) -> Twist:
        """It stands."""
        self.seen.append(view.inputs)
        self.teams.append(view.team)
        return Twist()


def test_a_robot_hears_what_its_behaviour_declares(monkeypatch: pytest.MonkeyPatch) -> None:
    """Own topics, keys of other robots, topics of every robot and keys of the team come to a running robot's view."""
    monkeypatch.setattr(Looker, "seen", [], raising=False)
    monkeypatch.setattr(Looker, "teams", [], raising=False)
    robot = RealTimeRobot(Looker)
    try:
        for key, message in (
            ("robot_1/goal_pose", PoseStamped(pose=Pose())),
            ("robot_0/goal_pose", PoseStamped(Header(frame_id="of another robot"))),
            ("robot_4/status", status(4, 1)),
            ("robot_0/orders", String("left")),
            ("orders", String("all left")),
        ):
            robot.say(key, message)
        robot.say_token("robot_4")
        robot.ready(1)
        robot.wait_for_commands(1)
        robot.say_time(2)
        robot.say_scan(2)
        robot.wait_for_commands(2)
        view = Looker.seen[-1]
        assert view["goal"] == PoseStamped(pose=Pose())
        assert view["others"][4] == status(4, 1)
        assert 1 in view["others"]
        assert (view["of_robot_0"], view["all"]) == (String("left"), String("all left"))
        assert Looker.teams[-1] == (1, 4)
    finally:
        robot.close()


def test_the_keys_of_a_robot() -> None:
    """A topic without a slash in front is of the own robot, unless it names a robot or stands for every robot."""
    keys = {declared.name: declared.key for declared in declared_inputs(Looker.inputs, 1)}
    assert keys == {
        "goal": "robot_1/goal_pose",
        "others": "robot_$*/status",
        "of_robot_0": "robot_0/orders",
        "all": "orders",
    }
