"""The accidents that the lectures' start protocol does not survive: zteam's gate does.

Each scenario runs with both. That the lectures' logic fails shows that the scenario is hard enough.
"""

from collections.abc import Callable

import pytest

from support.start_protocols import LecturesTeam, StartingTeam, ZteamTeam
from zteam.bus import presence

IDS = (0, 1, 2, 3)

Scenario = Callable[[StartingTeam], None]


@pytest.fixture(autouse=True)
def no_claim_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """In memory a token is seen at once."""
    monkeypatch.setattr(presence, "CLAIM_WAIT", 0.0)


def start_apart(team: StartingTeam, *robot_ids: int) -> None:
    """Robots begin one after the other, so that no two messages come together."""
    for robot_id in robot_ids:
        team.start_robot(robot_id)
        team.pass_seconds(2)


def lost_ready(team: StartingTeam) -> None:
    """The first messages of one robot are lost."""
    team.start_monitor()
    team.lossy.add(2)
    start_apart(team, *IDS)
    team.lossy.clear()
    team.pass_seconds(5)
    assert team.driving == [*IDS]


def monitor_first(team: StartingTeam) -> None:
    """The monitor waits when all robots begin together, as a launch file starts them."""
    team.start_monitor()
    team.pass_seconds(5)
    for robot_id in IDS:
        team.start_robot(robot_id)
    team.pass_seconds(5)
    assert team.driving == [*IDS]


def monitor_last(team: StartingTeam) -> None:
    """All robots are ready before there is a monitor."""
    start_apart(team, *IDS)
    team.start_monitor()
    team.pass_seconds(5)
    assert team.driving == [*IDS]


def monitor_restarted_before_go(team: StartingTeam) -> None:
    """The monitor is started again when half the team is ready."""
    team.start_monitor()
    start_apart(team, 0, 1)
    team.end_monitor()
    team.start_monitor()
    start_apart(team, 2, 3)
    team.pass_seconds(5)
    assert team.driving == [*IDS]


def monitor_restarted_after_go(team: StartingTeam) -> None:
    """The monitor is started again while the team drives; then a robot is too."""
    team.start_monitor()
    start_apart(team, *IDS)
    team.end_monitor()
    team.start_monitor()
    team.pass_seconds(5)
    assert team.driving == [*IDS]
    assert team.counted == [*IDS]
    team.end_robot(1)
    start_apart(team, 1)
    team.pass_seconds(5)
    assert team.driving == [*IDS]


def late_joiner(team: StartingTeam) -> None:
    """A robot begins while the others drive already."""
    team.start_monitor()
    start_apart(team, *IDS, 7)
    team.pass_seconds(5)
    assert team.driving == [*IDS, 7]


def death_after_ready(team: StartingTeam) -> None:
    """A robot is killed after it was ready: the team waits for it to come back."""
    team.start_monitor()
    start_apart(team, 0)
    team.end_robot(0)
    start_apart(team, 1, 2, 3)
    team.pass_seconds(5)
    assert team.driving == []
    assert team.counted == [1, 2, 3]
    start_apart(team, 0)
    team.pass_seconds(5)
    assert team.driving == [*IDS]


def ids_from_one(team: StartingTeam) -> None:
    """The team has the ids 1 to 4: after GO the monitor knows of no robot 0."""
    team.start_monitor()
    start_apart(team, *team.ids)
    team.pass_seconds(5)
    assert team.driving == [1, 2, 3, 4]
    assert team.counted == [1, 2, 3, 4]


def duplicate(team: StartingTeam) -> None:
    """Two processes begin as robot 1: one of them drives, and the team does not count it twice."""
    team.start_monitor()
    start_apart(team, 0, 1, 1, 2)
    team.pass_seconds(5)
    assert team.driving == []
    start_apart(team, 3)
    team.pass_seconds(5)
    assert team.driving == [*IDS]


def not_ready(team: StartingTeam) -> None:
    """A robot says that it is not ready: no robot drives."""
    team.start_monitor()
    start_apart(team, 0, 1, 2)
    team.start_robot(3, is_ready=False)
    team.pass_seconds(5)
    assert team.driving == []
    assert team.counted == [0, 1, 2]


SCENARIOS: list[Scenario] = [
    lost_ready,
    monitor_first,
    monitor_last,
    monitor_restarted_before_go,
    monitor_restarted_after_go,
    late_joiner,
    death_after_ready,
    ids_from_one,
    duplicate,
    not_ready,
]


def ids_of(scenario: Scenario) -> tuple[int, ...]:
    """The team of a scenario."""
    return (1, 2, 3, 4) if scenario is ids_from_one else IDS


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.__name__)
def test_zteam_starts_whatever_happens(scenario: Scenario) -> None:
    """The scenario ends as its text says."""
    scenario(ZteamTeam(ids_of(scenario)))


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.__name__)
def test_the_lectures_protocol_fails(scenario: Scenario) -> None:
    """The same scenario defeats the lectures' logic, so the test above can fail."""
    with pytest.raises(AssertionError, match="assert"):
        scenario(LecturesTeam(ids_of(scenario)))


def test_the_lectures_protocol_starts_when_nothing_happens() -> None:
    """The double is no straw man: monitor first, one robot after the other, ids from 0, and all drive at once."""
    team = LecturesTeam(IDS)
    team.start_monitor()
    start_apart(team, 0, 1, 2)
    assert team.driving == []
    start_apart(team, 3)
    assert team.driving == [*IDS]
