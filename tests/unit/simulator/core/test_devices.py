"""Fiducial finders, bumpers and blob finders."""

import math
from typing import Any

import pytest

from support.small_worlds import drive, make_box, make_robot, make_world
from zteam.geometry import Pose2
from zteam.sim import Engine
from zteam.simulator.world.devices import Blobfinder, BumperPiece, Finder
from zteam.simulator.world.model import FiducialMarker, Robot

MARK = (FiducialMarker(7, 0, 0.0, 0.0, 0.0),)


def finder(**changes: Any) -> Finder:
    """A finder that looks ahead over 180°, 5 m far, reading ids up to 3 m."""
    fields: dict[str, Any] = {"fov": math.pi, "range_min": 0.0, "range_max": 5.0, "range_max_id": 3.0}
    return Finder("f", 0.0, 0.0, 0.1, 0.0, **(fields | changes))


def seer(**changes: Any) -> Robot:
    """A robot with a finder."""
    return make_robot(devices=(finder(**changes),))


@pytest.mark.parametrize(
    ("robot", "mate"),
    [
        (seer(), make_robot(-1.0, 0.0, markers=MARK)),
        (seer(), make_robot(0.0, 5.5, markers=MARK)),
        (seer(range_min=2.0), make_robot(1.0, 0.0, markers=MARK)),
        (seer(key=4), make_robot(1.0, 0.0, markers=MARK)),
        (seer(), make_robot(1.0, 0.0)),
        (seer(), make_robot(5.0, 0.0, markers=MARK)),
    ],
    ids=["behind", "too far", "too near", "other key", "no mark", "behind the wall"],
)
def test_what_cannot_be_seen_is_not_found(robot: Robot, mate: Robot) -> None:
    """Field of view, range, key, mark and line of sight all have to agree."""
    assert Engine(make_world(robot, mate)).observe().robots[0].fiducials == ((),)


def test_far_marks_are_found_but_not_read() -> None:
    """Beyond range_max_id the id is 0."""
    mate = make_robot(0.0, 4.0, markers=MARK)
    ((sighting,),) = Engine(make_world(seer(), mate)).observe().robots[0].fiducials
    assert sighting.id == 0


def test_a_finder_looks_over_what_is_lower_unless_told_not_to() -> None:
    """A ray above the marked robot misses it; with ignore_zloc the mark counts if nothing stands in the way."""
    mate = make_robot(1.0, 0.0, markers=MARK)
    high = Finder("f", 0.0, 0.0, 0.6, 0.0, math.pi, 0.0, 5.0, 5.0)
    easy = Finder("f", 0.0, 0.0, 0.6, 0.0, math.pi, 0.0, 5.0, 5.0, ignore_zloc=True)
    assert Engine(make_world(make_robot(devices=(high,)), mate)).observe().robots[0].fiducials == ((),)
    assert len(Engine(make_world(make_robot(devices=(easy,)), mate)).observe().robots[0].fiducials[0]) == 1
    behind_wall = make_robot(4.0, 0.0, markers=MARK)
    assert Engine(make_world(make_robot(devices=(easy,)), behind_wall)).observe().robots[0].fiducials == ((),)


def test_marked_things_are_found_and_hidden_ones_are_not() -> None:
    """A marked box is found; a second one behind it is not, although both stand still."""
    boxes = (
        make_box("near", 1.0, 0.0, markers=MARK),
        make_box("far", 2.0, 0.0, markers=(FiducialMarker(9, 0, 0.0, 0.0, 0.0),)),
    )
    ((sighting,),) = Engine(make_world(seer(), others=boxes)).observe().robots[0].fiducials
    assert (sighting.id, sighting.range) == (7, pytest.approx(1.0))


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
def test_the_bumper_that_touches_is_pressed(physics: str) -> None:
    """At the wall the front piece is pressed and the rear one is not; away from it neither is."""
    pieces = BumperPiece("front", 0.2, 0.0, 0.1, 0.0, 0.3), BumperPiece("rear", -0.2, 0.0, 0.1, math.pi, 0.3)
    engine = Engine(make_world(make_robot(1.0, devices=pieces), physics=physics))
    assert engine.observe().robots[0].bumpers == (False, False)
    for speed in (0.8, 0.1, 0.02):
        for _ in range(40):
            seen = engine.step({0: drive(speed)}).robots[0]
    assert seen.bumpers == (True, False)
    for _ in range(5):
        seen = engine.step({0: drive(-0.5)}).robots[0]
    assert seen.bumpers == (False, False)


def test_a_blob_finder_names_the_colours_it_looks_for() -> None:
    """A blue box before a green wall: two blobs of the wall and the box between, or the box alone."""
    box = make_box("b", 1.0, 0.0)
    every = Blobfinder("b", 0.0, 0.0, 0.1, 0.0, math.radians(90), 91, 12.0)
    blue = Blobfinder("b", 0.0, 0.0, 0.1, 0.0, math.radians(90), 91, 12.0, ("blue",))
    seen = Engine(make_world(make_robot(devices=(every, blue)), others=(box,))).observe().robots[0]
    assert [blob.name for blob in seen.blobs[0]] == ["green", "blue", "green"]
    (blob,) = seen.blobs[1]
    assert blob.bearing == pytest.approx(0.0, abs=1e-9)
    assert blob.width == pytest.approx(2 * math.atan2(0.2, 0.8), abs=math.radians(2.0))
    assert blob.range == pytest.approx(0.8, abs=1e-6)
    assert seen.blobs[0][0].bearing < seen.blobs[0][2].bearing


def test_a_single_pixel_looks_straight_ahead() -> None:
    """A blob finder of one pixel sees what is in front of it, not what is at the edge of its field of view."""
    eye = Blobfinder("b", 0.0, 0.0, 0.1, 0.0, math.radians(60.0), 1, 12.0)
    others = (make_box("ahead", 2.0, 0.0), make_box("aside", 2.0, -2.0 * math.tan(math.radians(30.0))))
    seen = Engine(make_world(make_robot(devices=(eye,)), others=others)).observe().robots[0]
    ((blob,),) = seen.blobs
    assert blob.range == pytest.approx(1.8)
    assert blob.bearing == pytest.approx(0.0)


@pytest.mark.parametrize("turn", [1.1, -2.5])
def test_robots_in_a_circle_find_each_other(turn: float) -> None:
    """Of twelve robots on a circle that look inwards, each finds all others where they are, in the order of ids."""
    eye = Finder("f", 0.0, 0.0, 0.1, 0.0, math.tau, 0.0, 20.0, 20.0)
    around = [turn + k * math.tau / 12 for k in range(12)]
    poses = [Pose2(4.0 * math.cos(a), 4.0 * math.sin(a), a + math.pi) for a in around]
    marks = [(FiducialMarker(k + 1, 0, 0.0, 0.0, 0.0),) for k in range(12)]
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
