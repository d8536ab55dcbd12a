"""What a behaviour may declare as its inputs: mistakes are told in one line when the class is loaded."""

from typing import Any

import pytest

from zteam.errors import UsageError
from zteam.messages import Odometry, PoseStamped, RobotStatus, String, Twist
from zteam.robot.behaviors.behavior import check_inputs


@pytest.mark.parametrize(
    ("inputs", "text"),
    [
        ([("goal_pose", PoseStamped)], "not a dict such as"),
        ({"goal": PoseStamped}, "'goal': <class 'zteam.messages.geometry_msgs.PoseStamped'> is no topic with its type"),
        ({"goal": ("goal_pose",)}, "is no topic with its type"),
        ({7: ("goal_pose", PoseStamped)}, "7: "),
        ({"goal": (7, PoseStamped)}, "'goal': 7 is no topic, such as 'goal_pose'"),
        ({"goal": ("", PoseStamped)}, "'goal': '' is no topic"),
        ({"goal": ("goal//pose", PoseStamped)}, "'goal': 'goal//pose' is no topic: "),
        ({"goal": ("goal_pose/", PoseStamped)}, "'goal': 'goal_pose/' is no topic: "),
        ({"all": ("robot_*/status", RobotStatus)}, "'robot_*/status' stands for many keys"),
        ({"all": ("robot_$*/*", RobotStatus)}, "'robot_$*/*' stands for many keys"),
        ({"all": ("/**", String)}, "'/**' stands for many keys"),
        ({"goal": ("goal_pose", int)}, "'goal': goal_pose: int is no message type"),
        ({"goal": ("goal_pose", "PoseStamped")}, "'PoseStamped' is no message type"),
        ({"goal": ("goal_pose", Twist)}, "'goal': goal_pose carries PoseStamped, not Twist"),
        ({"all": ("robot_$*/odom", Twist)}, "robot_$*/odom carries Odometry, not Twist"),
        ({"chief": ("robot_0/status", Twist)}, "robot_0/status carries RobotStatus, not Twist"),
    ],
)
def test_a_mistake_is_told(inputs: Any, text: str) -> None:
    """Each mistake names the input and what is wrong, on one line."""
    with pytest.raises(UsageError) as caught:
        check_inputs("inputs", inputs)
    assert str(caught.value).startswith("inputs")
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "inputs",
    [
        {},
        {"goal": ("goal_pose", PoseStamped)},
        {"all": ("robot_$*/odom", Odometry), "orders": ("orders", String)},
        {"chief": ("robot_0/status", RobotStatus), "news": ("/news", String)},
    ],
)
def test_what_may_be_declared(inputs: Any) -> None:
    """Own topics, topics of every robot, keys of one robot and of the team, of zteam and of one's own."""
    check_inputs("inputs", inputs)
