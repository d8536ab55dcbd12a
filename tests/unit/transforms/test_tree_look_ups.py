"""Walks through the tree: rings, deep chains, common ancestors and the latest common time."""

import itertools
import math

import pytest

from support.transforms import S, chain, stamped
from zteam.geometry import Pose2
from zteam.tf import BackwardExtrapolationException, Buffer, ExtrapolationException, NoDataForExtrapolationException


def test_a_ring_of_frames_seen_from_everywhere() -> None:
    """Look-ups between eight frames at 45 degrees are right, at sampled times and between them."""
    step = Pose2(math.cos(math.pi / 4) - 1.0, math.sin(math.pi / 4), math.pi / 4)
    buffer = Buffer()
    for stamp in (S, 2 * S):
        for i in range(7):
            buffer.set_transform(stamped(f"r{i}", f"r{i + 1}", stamp, *step), "test")
    poses = list(itertools.accumulate([step] * 7, Pose2.compose, initial=Pose2(0.0, 0.0, 0.0)))
    for (i, a), (j, b) in itertools.product(enumerate(poses), repeat=2):
        expected = a.inverse().compose(b)
        for time in (0, S, 3 * S // 2, 2 * S):
            pose, _ = buffer.lookup_pose2(f"r{i}", f"r{j}", time)
            assert pose[:2] == pytest.approx(expected[:2], abs=1e-9)
            assert math.cos(pose.yaw - expected.yaw) == pytest.approx(1.0, abs=1e-12)


def test_a_very_deep_chain_is_not_called_a_loop() -> None:
    """A chain of any depth is walked (tf2 stops at a thousand frames)."""
    buffer = chain(1500)
    assert buffer.lookup_pose2("f0", "f1500", 0)[0].x == 1500.0
    assert buffer.lookup_pose2("f1500", "f700", S)[0].x == -800.0


def test_what_is_missing_above_the_common_ancestor_does_not_matter() -> None:
    """Two frames of one robot are connected also at a time without data for the robot's own pose."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S, 50.0), "test")
    for stamp in (S, 5 * S):
        buffer.set_transform(stamped("base", "left", stamp, 0.0, 1.0), "test")
        buffer.set_transform(stamped("base", "right", stamp, 0.0, -1.0), "test")
    pose, stamp = buffer.lookup_pose2("right", "left", 4 * S)
    assert pose.y == 2.0
    assert buffer.lookup_pose2("right", "left", 0)[1] == 5 * S
    with pytest.raises(ExtrapolationException):
        buffer.lookup_transform("map", "left", 4 * S)


def test_the_latest_common_time_is_the_slowest_edges_newest() -> None:
    """It is the minimum over the path's moving edges; 0 if all are static, None without a path."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0), "test")
    buffer.set_transform_static(stamped("base", "laser", 0), "test")
    buffer.set_transform(stamped("odom", "base", 3 * S), "test")
    buffer.set_transform(stamped("map", "other", 2 * S), "test")
    buffer.set_transform_static(stamped("moon", "crater", 0), "test")
    assert buffer.latest_common_time("map", "laser") == 3 * S
    assert buffer.latest_common_time("laser", "other") == 2 * S
    assert buffer.latest_common_time("odom", "map") == 0
    assert buffer.latest_common_time("map", "crater") is None
    assert buffer.latest_common_time("map", "nowhere") is None


def test_a_moving_frame_stamped_0_does_not_hold_back_the_others() -> None:
    """As in tf2, a sample stamped 0 does not count for the latest common time, and is valid only at 0."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "odom", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "odom", 0) == (Pose2(1.0, 0.0, 0.0), 0)
    buffer.set_transform(stamped("odom", "base", 3 * S), "test")
    assert buffer.latest_common_time("map", "base") == 3 * S
    # It is not used in a longer path, even if the other edges have data at time 0.
    buffer.set_transform(stamped("odom", "base", 0, 1.0), "test")
    for _ in range(2):
        with pytest.raises(NoDataForExtrapolationException):
            buffer.lookup_transform("map", "base", 0)


def test_the_latest_common_time_may_lie_before_an_edges_history() -> None:
    """If one edge's only sample is older than another edge's history, the latest look-up is an extrapolation."""
    buffer = Buffer(cache_time=1.0)
    buffer.set_transform(stamped("map", "odom", S), "test")
    for second in (5, 6):
        buffer.set_transform(stamped("odom", "base", second * S), "test")
    with pytest.raises(BackwardExtrapolationException):
        buffer.lookup_transform("map", "base", 0)


def test_a_frames_latest_common_time_with_itself_is_its_newest() -> None:
    """The time equals tf2's, which is the stamp of the frame's newest sample."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", 3 * S), "test")
    assert buffer.latest_common_time("base", "base") == 3 * S
