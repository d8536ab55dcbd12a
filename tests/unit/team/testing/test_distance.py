"""`distance_travelled` and the report's `distance_m` are what the wheels drove."""

from collections.abc import Callable, Iterator

import pytest

from zteam.testing import Team

SPEED = 0.3
SECONDS = 2.0


@pytest.fixture
def driving() -> Iterator[Team]:
    """Robot 0 drives straight on at SPEED, and has driven for SECONDS."""
    team = Team()
    team.start("arena", 1, behavior="forward", params={0: {"speed": SPEED}}, in_process=True)
    team.wait_for_go()
    team.run(1)
    team.sim.reset()
    team.run(SECONDS)
    yield team
    team.close()


def put_back(team: Team) -> None:
    """Out of the world and in again, elsewhere."""
    team.sim.remove(0)
    team.run(1)
    team.sim.spawn(1.0, 3.0, robot_id=0)


CHANGES: list[Callable[[Team], object]] = [lambda team: team.sim.move(0, 2.0, 3.5), put_back]


@pytest.mark.parametrize("change", CHANGES, ids=["move", "spawn"])
def test_what_puts_a_robot_elsewhere_adds_no_metres(driving: Team, change: Callable[[Team], object]) -> None:
    """Neither the test's own count nor the report's grows by the way between the two places."""
    before = driving.robot(0).distance_travelled
    assert before == pytest.approx(SPEED * SECONDS, abs=0.1)
    place = driving.robot(0).pose
    change(driving)
    driving.run(0.1)
    assert abs(driving.robot(0).pose.y - place.y) + abs(driving.robot(0).pose.x - place.x) > 0.5
    assert driving.robot(0).distance_travelled == pytest.approx(before, abs=SPEED * 0.1)
    assert driving.report.robots[0].distance_m == pytest.approx(before, abs=SPEED * 0.1)


def test_a_reset_starts_at_zero(driving: Team) -> None:
    """The way back to the start adds nothing either, and the same drive has the same length."""
    driven = driving.robot(0).distance_travelled
    driving.sim.reset()
    assert driving.robot(0).distance_travelled == 0.0
    driving.run(SECONDS)
    assert driving.robot(0).distance_travelled == driven
    assert driving.report.robots[0].distance_m == pytest.approx(driven, abs=1e-6)
