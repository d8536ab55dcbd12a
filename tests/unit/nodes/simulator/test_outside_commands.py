"""Velocities and goals from outside of lock-step are counted, those of participants are not."""

import pytest

from support.in_process_team import InProcessTeam, TeamOptions
from zteam import names
from zteam.messages import Message, PoseStamped, Twist, TwistStamped


@pytest.mark.parametrize(
    ("topic", "message"),
    [(names.CMD_VEL_TELEOP, Twist()), (names.CMD_VEL_NAV, TwistStamped()), (names.GOAL_POSE, PoseStamped())],
)
def test_what_comes_from_outside_is_counted(topic: str, message: Message) -> None:
    """From GO on each message counts that a process sends which takes no part, to a robot of the world; what a
    participant sends to any robot does not."""
    with InProcessTeam(TeamOptions(paused=True)) as team:
        outside, key = team.hub.bus(), names.robot_key(1, topic)
        team.step(5)
        before = team.report().external_commands
        for _ in range(2):
            outside.publisher(key, type(message)).put(message)
        outside.publisher(names.robot_key(9, topic), type(message)).put(message)
        team.nodes["robot_0"].bus.publisher(key, type(message)).put(message)
        assert (before, team.report().external_commands) == (0, 2)
