"""Teams of real processes drive."""

import math

import pytest

from zteam.testing.team import TeamFixture

pytestmark = pytest.mark.team


def test_a_follower_follows(team: TeamFixture) -> None:
    """Two robots in the arena get GO, and the follower drives after its leader."""
    team.start("arena", robots=2, follow={1: 0})
    team.wait_for_go()
    start = team.robot(1).pose
    team.until(lambda: team.robot(1).distance_travelled > 1.0, within=40)
    end = team.robot(1).pose
    assert math.dist(start[:2], end[:2]) > 0.3
    assert team.robot(0).distance_travelled > 0.5
