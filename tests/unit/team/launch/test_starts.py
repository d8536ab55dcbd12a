"""Robots that are started while their team runs."""

import pytest

from zteam.errors import UsageError
from zteam.node.process_options import RobotOptions, from_line
from zteam.team.file.entries import RobotEntry, Team
from zteam.team.launch.plan import robot_job
from zteam.team.launch.team_launch import TeamLaunch

LAUNCH = TeamLaunch(Team([RobotEntry(2, follow=1, safety=False)]), None, given_seed=7)


def test_a_new_robot_gets_what_the_team_has_in_common() -> None:
    """Its process has the id, the behaviour and the team's seed."""
    name, options = from_line(robot_job(LAUNCH, 5, "wander")[1].words)
    assert isinstance(options, RobotOptions)
    assert (name, options.robot_id, options.behavior, options.seed, options.safety) == ("robot_5", 5, "wander", 7, True)


def test_a_robot_of_the_team_file_keeps_all_but_its_behavior() -> None:
    """The behaviour of the request takes the place of the one it follows by."""
    _, options = from_line(robot_job(LAUNCH, 2, "avoid")[1].words)
    assert isinstance(options, RobotOptions)
    assert (options.behavior, options.params, options.safety) == ("avoid", {}, False)


@pytest.mark.parametrize(
    ("behavior", "text"), [("os:system", "no behaviour 'os:system'"), ("follow", "leader"), ("path", "behaviour path")]
)
def test_what_cannot_be_started_is_refused(behavior: str, text: str) -> None:
    """No module of the asker's choice is imported, and no behaviour starts that lacks a parameter."""
    with pytest.raises(UsageError, match=text):
        robot_job(LAUNCH, 5, behavior)
