"""Devices of crowds and of one pixel."""

import math

import pytest

from support.small_worlds import make_box, make_robot, make_world
from zteam.geometry import Pose2
from zteam.sim import Engine
from zteam.world.devices import Blobfinder, Finder
from zteam.world.model import Marker

MARK = (Marker(7, 0, 0.0, 0.0, 0.0),)


def test_a_single_pixel_looks_straight_ahead() -> None:
    """A blob finder of one pixel sees what is in front of it, not what is at the edge of its field of view."""
    eye = Blobfinder("b", 0.0, 0.0, 0.1, 0.0, math.radians(60.0), 1, 12.0)
    others = (make_box("ahead", 2.0, 0.0), make_box("aside", 2.0, -2.0 * math.tan(math.radians(30.0))))
    seen = Engine(make_world(make_robot(devices=(eye,)), others=others)).observe().robots[0]
    ((blob,),) = seen.blobs
    assert blob.range == pytest.approx(1.8)
    assert blob.bearing == pytest.approx(0.0)


@pytest.mark.parametrize("turn", [0.0, 1.1, 3.1, -2.5])
def test_robots_in_a_circle_find_each_other(turn: float) -> None:
    """Of twelve robots on a circle that look inwards, each finds all others where they are, in the order of ids."""
    eye = Finder("f", 0.0, 0.0, 0.1, 0.0, math.tau, 0.0, 20.0, 20.0)
    around = [turn + k * math.tau / 12 for k in range(12)]
    poses = [Pose2(4.0 * math.cos(a), 4.0 * math.sin(a), a + math.pi) for a in around]
    marks = [(Marker(k + 1, 0, 0.0, 0.0, 0.0),) for k in range(12)]
    robots = [make_robot(*pose, devices=(eye,), markers=mark) for pose, mark in zip(poses, marks, strict=True)]
    seen = Engine(make_world(*robots, wall_at=50.0)).observe().robots
    for i, here in enumerate(poses):
        (found,) = seen[i].fiducials
        assert [sighting.id for sighting in found] == [k + 1 for k in range(12) if k != i]
        for sighting in found:
            there = poses[sighting.id - 1]
            heading = here.yaw + sighting.bearing
            assert here.x + sighting.range * math.cos(heading) == pytest.approx(there.x, abs=1e-9)
            assert here.y + sighting.range * math.sin(heading) == pytest.approx(there.y, abs=1e-9)
            assert math.cos(here.yaw + sighting.orientation - there.yaw) == pytest.approx(1.0)
