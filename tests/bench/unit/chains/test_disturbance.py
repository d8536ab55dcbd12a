"""Disturbed transforms: late, wrong, and the same for all."""

import math

import pytest

from studies.chains.disturbance import Disturbance
from zteam.testing import make_view


def moving(now: float, robot_id: int = 1):
    """Robot 0 drives along x at 1 m/s; robot 1 stands."""
    return make_view(robot_id=robot_id, poses={0: (now, 0.0, 0.0), 1: (-1.0, 0.0, 0.0)}, now=now)


def test_teammates_come_late_and_the_own_pose_does_not() -> None:
    """After 0.3 s of history the leader is seen where it was 0.3 s ago, with that stamp; the own pose is of now."""
    disturbance = Disturbance(0.3, 0.0)
    for tick in range(10):
        seen = disturbance.disturb(moving(1.0 + 0.1 * tick))
        leader = seen.lookup("map", "robot_0/base_footprint")
        assert leader is not None
    assert leader[0].x == pytest.approx(1.6) and leader[1] == 1_600_000_000
    own = seen.map_from_base()
    assert own is not None and own[1] == 1_900_000_000
    between = seen.base_from_robot(0)
    assert between is not None and between[0].x == pytest.approx(2.6) and between[1] == 1_600_000_000


def test_errors_have_the_size_that_was_asked_for() -> None:
    """Over many ticks the own pose errs by 2 cm along each axis."""
    disturbance, errors = Disturbance(0.0, 0.02), []
    for tick in range(1, 1000):
        own = disturbance.disturb(moving(0.1 * tick)).map_from_base()
        assert own is not None
        errors += [own[0].x + 1.0, own[0].y]
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) == pytest.approx(0.02, rel=0.1)


def test_all_see_the_same_error() -> None:
    """Two robots that look a third one up get the same wrong pose, and it gets that pose too."""
    views = [Disturbance(0.0, 0.02).disturb(moving(1.0, robot_id)) for robot_id in (0, 1)]
    first, second = (view.lookup("map", "robot_0/base_footprint") for view in views)
    assert first == second and first is not None and first[0].x != 1.0


def test_what_is_not_known_stays_unknown() -> None:
    """A frame without a pose has none with a disturbance either."""
    assert Disturbance(0.3, 0.02).disturb(make_view()).map_from_base() is None
