"""The history of one frame: its length, duplicate samples and its rate."""

import math

import pytest

from support.transforms import S, stamped
from zteam.geometry import Pose2
from zteam.tf import Buffer


def test_exact_duplicates_are_counted_silently() -> None:
    """An equal sample is counted without an error; another value for the same time is refused."""
    buffer = Buffer()
    assert buffer.set_transform(stamped("map", "base", S, 1.0), "test") is None
    assert buffer.set_transform(stamped("map", "base", S, 1.0), "test") is None
    assert buffer.duplicates == 1
    refused = buffer.set_transform(stamped("map", "base", S, 2.0), "test")
    assert refused is not None
    assert refused.code == "TF_REPEATED_DATA"


def test_old_samples_are_forgotten_and_refused() -> None:
    """Samples older than the cache, counted back from the edge's newest stamp, are forgotten or refused."""
    buffer = Buffer(cache_time=10.0)
    for second in range(1, 31):
        buffer.set_transform(stamped("map", "base", second * S, float(second)), "test")
    info = buffer.frames()["base"]
    assert (info.oldest, info.newest, info.samples) == (20 * S, 30 * S, 11)
    assert info.rate == pytest.approx(1.0)
    refused = buffer.set_transform(stamped("map", "base", 19 * S), "test")
    assert refused is not None
    assert refused.code == "TF_OLD_DATA"


def test_a_sample_exactly_as_old_as_the_cache_is_kept() -> None:
    """A sample exactly as old as the cache is stored and kept; one a nanosecond older is not."""
    buffer = Buffer(cache_time=10.0)
    buffer.set_transform(stamped("map", "base", 20 * S, 2.0), "test")
    assert buffer.set_transform(stamped("map", "base", 10 * S, 1.0), "test") is None
    refused = buffer.set_transform(stamped("map", "base", 10 * S - 1), "test")
    assert refused is not None
    assert refused.code == "TF_OLD_DATA"
    assert buffer.frames()["base"].oldest == 10 * S
    buffer.set_transform(stamped("map", "base", 20 * S + 1), "test")
    assert buffer.frames()["base"].oldest == 20 * S


def test_the_cache_is_counted_per_frame() -> None:
    """New samples of one frame do not shorten the history of another frame."""
    buffer = Buffer(cache_time=2.0)
    buffer.set_transform(stamped("map", "slow", S, 1.0), "test")
    for second in range(1, 60):
        buffer.set_transform(stamped("map", "fast", second * S), "test")
    assert buffer.frames()["slow"].newest == S
    assert buffer.lookup_pose2("map", "slow", S)[0].x == 1.0


def test_rates_are_counted_from_intervals() -> None:
    """Twenty intervals in a second give 20 Hz; a single sample gives 0."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    assert buffer.frames()["base"].rate == 0.0
    for i in range(1, 21):
        buffer.set_transform(stamped("map", "base", S + i * S // 20), "test")
    assert buffer.frames()["base"].rate == pytest.approx(20.0)


def test_a_helix_is_followed_between_its_samples() -> None:
    """Between samples at 100 Hz, a frame on a helix is interpolated close to its true pose."""
    buffer = Buffer()

    def pose_at(t: float) -> Pose2:
        return Pose2(2.0 * math.cos(t), 2.0 * math.sin(t), t)

    for i in range(101):
        x, y, yaw = pose_at(i / 100)
        transform = stamped("map", "base", S + i * S // 100, x, y, yaw)
        transform.transform.translation.z = i / 100
        buffer.set_transform(transform, "test")
    for i in range(1, 1000):
        found = buffer.lookup_transform("map", "base", S + i * S // 1000).transform
        x, y, yaw = pose_at(i / 1000)
        # The chord lies at most r (1 - cos(half a step)) inside the arc.
        assert (found.translation.x, found.translation.y) == pytest.approx((x, y), abs=2.0 * (1 - math.cos(0.005)))
        assert found.translation.z == pytest.approx(i / 1000, abs=1e-9)
        assert 2.0 * math.atan2(found.rotation.z, found.rotation.w) == pytest.approx(yaw, abs=1e-9)


def test_the_authority_is_the_newest_samples() -> None:
    """The authority is that of the newest sample."""
    buffer = Buffer()
    for second, authority in enumerate(["first", "first", "second", "third"], start=1):
        buffer.set_transform(stamped("map", "base", second * S), authority)
        assert buffer.frames()["base"].authority == authority
