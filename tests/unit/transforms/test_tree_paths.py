"""Prepared paths: they give the same answers as the walk, and are dropped when an edge changes its form or parent."""

import math

import pytest

from support.transforms import S, stamped
from zteam.geometry import quaternion_from_rpy
from zteam.messages import Quaternion
from zteam.tf import BackwardExtrapolationException, Buffer, NoDataForExtrapolationException


@pytest.mark.parametrize("roll", [0.0, 0.1], ids=["planar", "spatial"])
def test_what_is_older_than_the_cache_is_not_used(roll: float) -> None:
    """No look-up uses samples that are older than the cache, to the nanosecond."""
    buffer = Buffer(cache_time=1.0)
    step = S // 50
    for tick in range(50, 400):
        message = stamped("map", "base", tick * step, float(tick))
        message.transform.rotation = Quaternion(*quaternion_from_rpy(roll, 0.0, 0.0))
        buffer.set_transform(message, "test")
        newest = tick * step
        oldest = max(newest - S, S)
        if newest > oldest:
            assert buffer.lookup_pose2("map", "base", oldest)[0].x == oldest // step
            assert buffer.lookup_pose2("map", "base", newest)[0].x == tick
            with pytest.raises(BackwardExtrapolationException):
                buffer.lookup_transform("map", "base", oldest - 1)
    assert buffer.frames()["base"].samples == 51


def test_after_a_long_silence_there_is_one_sample() -> None:
    """A gap longer than the cache is never interpolated, even with a short history."""
    for count in (1, 2, 60, 120):
        buffer = Buffer(cache_time=1.0)
        for tick in range(count):
            buffer.set_transform(stamped("map", "base", S + tick * S // 50, 1.0), "test")
        silent = S + (count - 1) * S // 50 + S + 1
        buffer.set_transform(stamped("map", "base", silent, 2.0), "test")
        with pytest.raises(NoDataForExtrapolationException):
            buffer.lookup_transform("map", "base", silent - 1)
        assert buffer.lookup_pose2("map", "base", 0)[0].x == 2.0


def test_a_robot_may_leave_the_plane() -> None:
    """A look-up follows a change of z and pitch in the middle of a stream; earlier samples stay unchanged."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("base", "tip", 0, 1.0), "test")
    for second in (1, 2):
        buffer.set_transform(stamped("map", "base", second * S, float(second)), "test")
    assert buffer.lookup_transform("map", "tip", 3 * S // 2).transform.translation.x == 2.5
    raised = stamped("map", "base", 3 * S, 3.0)
    raised.transform.translation.z = 1.0
    assert buffer.set_transform(raised, "test") is None
    found = buffer.lookup_transform("map", "tip", 5 * S // 2).transform.translation
    assert (found.x, found.y, found.z) == pytest.approx((3.5, 0.0, 0.5))
    pitched = stamped("map", "base", 4 * S, 4.0)
    pitched.transform.rotation = Quaternion(*quaternion_from_rpy(0.0, -math.pi / 2, 0.0))
    assert buffer.set_transform(pitched, "test") is None
    found = buffer.lookup_transform("map", "tip", 0).transform.translation
    assert (found.x, found.y, found.z) == pytest.approx((4.0, 0.0, 1.0))
    assert buffer.lookup_transform("map", "tip", 3 * S // 2).transform.translation.x == pytest.approx(2.5)
    assert buffer.frames()["base"].samples == 4


def test_a_tilted_sensor_on_a_planar_robot() -> None:
    """A static rotation about y is applied: a point ahead of the tilted camera lies below the robot."""
    buffer = Buffer()
    camera = stamped("base", "camera", 0, 0.5)
    camera.transform.rotation = Quaternion(*quaternion_from_rpy(0.0, math.pi / 2, 0.0))
    buffer.set_transform_static(camera, "test")
    buffer.set_transform_static(stamped("camera", "seen", 0, 2.0), "test")
    for second in (1, 3):
        buffer.set_transform(stamped("map", "base", second * S, 0.0, float(second), math.pi / 2), "test")
    for _ in range(2):
        found = buffer.lookup_transform("map", "seen", 2 * S).transform.translation
        assert (found.x, found.y, found.z) == pytest.approx((0.0, 2.5, -2.0))
        back = buffer.lookup_transform("seen", "map", 2 * S).transform.translation
        assert (back.x, back.y, back.z) == pytest.approx((-2.0, 0.0, -2.5))


def test_a_changed_parent_is_forgotten_with_its_samples() -> None:
    """Look-ups follow each change of parent, also after the samples of the former parent were forgotten."""
    buffer = Buffer(cache_time=1.0)
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    parents = ["map"] * 20 + ["room"] * 100 + ["map"] * 20
    for tick, parent in enumerate(parents, start=50):
        buffer.set_transform(stamped(parent, "base", tick * S // 50, 1.0), "test")
        for time in (0, tick * S // 50):
            expected = 101.0 if parent == "room" else 1.0
            assert buffer.lookup_pose2("map", "base", time)[0].x == expected
    assert buffer.lookup_pose2("map", "base", 169 * S // 50)[0].x == 101.0


def test_samples_that_come_late_are_used_on_a_known_path() -> None:
    """A sample that arrives after a look-up, between two others, changes the next look-up."""
    buffer = Buffer()
    for second in (1, 5):
        buffer.set_transform(stamped("map", "base", second * S, float(second)), "test")
    assert buffer.lookup_pose2("map", "base", 3 * S)[0].x == 3.0
    buffer.set_transform(stamped("map", "base", 3 * S, 30.0), "test")
    assert buffer.lookup_pose2("map", "base", 3 * S)[0].x == 30.0
    assert buffer.lookup_pose2("map", "base", 2 * S)[0].x == 15.5


@pytest.mark.parametrize("still", ["x", "yaw", "both"])
def test_what_stands_still_between_two_samples(still: str) -> None:
    """If only the place or only the yaw changes between two samples, it is still interpolated."""
    buffer = Buffer()
    x, yaw = (0.0 if still != "yaw" else 2.0), (0.0 if still != "x" else 1.0)
    buffer.set_transform(stamped("map", "base", S, 5.0, 6.0, 0.5), "test")
    buffer.set_transform(stamped("map", "base", 3 * S, 5.0 + x, 6.0, 0.5 + yaw), "test")
    pose, _ = buffer.lookup_pose2("map", "base", 2 * S)
    assert pose == pytest.approx((5.0 + x / 2, 6.0, 0.5 + yaw / 2))
