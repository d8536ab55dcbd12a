"""What is read from true poses: deviations, gaps, hits, on paths whose answer is known."""

import math

import numpy as np
import pytest

from studies.chains.recorder import Moment, Tracks, make_tracks
from studies.chains.tracks import Walls, count_touches, follow_path, resample, take_samples
from support.small_worlds import BODY, make_world

LEAD_IN = np.array([[-5.0, 0.0], [0.0, 0.0]])


def along(ticks: int, start: float, aside: float = 0.0, begin: int = 10) -> list[tuple[float, float, float]]:
    """A robot that drives along x at 0.5 m/s from tick `begin` on."""
    return [(start + 0.05 * max(0, tick - begin), aside, 0.0) for tick in range(ticks)]


def tracks_of(*robots: list[tuple[float, float, float]], stalled: bool = False) -> Tracks:
    """The tracks of these robots."""
    return make_tracks(
        [Moment(i, [*poses], [stalled] * len(robots)) for i, poses in enumerate(zip(*robots, strict=True))]
    )


def walls(at: float = 100.0) -> Walls:
    """A wall far away, or at `at`."""
    return Walls(make_world(wall_at=at), BODY)


def samples_of(tracks: Tracks, at: float = 100.0):
    """The samples of a chain 0.8 m apart that drives 10 m along x."""
    return take_samples(tracks, LEAD_IN, np.array([10.0, 0.0]), 0.8, walls(at), 0.1)


def test_a_chain_that_keeps_its_path_has_no_error() -> None:
    """Two robots one behind the other: no deviation, the gap that they have, all arrived."""
    seen = samples_of(tracks_of(along(211, 0.0), along(211, -0.8)))
    assert max(seen.deviations[0]) < 1e-9
    assert seen.gaps[0] == pytest.approx([0.8] * len(seen.gaps[0]))
    assert (seen.arrived, seen.wall_hits, seen.touches) == (True, 0, 0)
    assert seen.seconds == pytest.approx(0.1 * len(seen.gaps[0]))


def test_deviation_and_gap_are_measured() -> None:
    """A follower 0.1 m aside and 0.3 m too far behind shows both; the start, where no robot moved, does not count."""
    seen = samples_of(tracks_of(along(211, 0.0), along(211, -1.1, aside=0.1)))
    assert seen.deviations[0] == pytest.approx([0.1] * len(seen.deviations[0]))
    assert seen.gaps[0] == pytest.approx([1.1] * len(seen.gaps[0]))
    assert 180 < len(seen.gaps[0]) < 200


def test_only_the_leaders_own_way_counts_for_deviations() -> None:
    """Where the leader stood at the start and behind it there is no way of its own to deviate from."""
    seen = samples_of(tracks_of(along(211, 0.0), along(211, -0.8)))
    assert len(seen.gaps[0]) - len(seen.deviations[0]) == pytest.approx(0.8 / 0.05, abs=2)


def test_a_robot_that_stays_behind_has_not_arrived() -> None:
    """The leader came to the end, the follower stands a metre too far back."""
    assert not samples_of(tracks_of(along(211, 0.0), along(211, -1.8))).arrived


def test_walls_are_hit_by_the_outline() -> None:
    """A robot of 0.4 m touches a wall 0.21 m ahead, and not one 0.3 m ahead; a blocked one counts as well."""
    still = tracks_of([(0.0, 0.0, 0.0)] * 30)
    for distance, hits in ((0.21, 1), (0.3, 0)):
        assert int(walls(distance).touched(still.poses).any()) == hits
    driving = along(211, 0.0), along(211, -0.8)
    assert samples_of(tracks_of(*driving, stalled=True)).wall_hits == 2
    assert samples_of(tracks_of(*driving), at=9.0).wall_hits == 2


def test_robots_that_touch_are_counted_by_pairs() -> None:
    """Two of three robots come nearer to each other than 2 cm."""
    poses = np.array([[(0.0, 0.0, 0.0), (0.41, 0.0, 0.0), (3.0, 0.0, 0.0)]])
    outline = walls().outline
    assert count_touches(poses, outline) == 1
    poses[0, 1, 0] = 0.45
    assert count_touches(poses, outline) == 0


def test_a_path_that_crosses_itself_is_followed_in_order() -> None:
    """On a figure of eight a robot stays on its branch at the crossing."""
    angle = np.linspace(0.0, 2.0 * math.pi, 2000)
    path = resample(np.stack([3.0 * np.sin(2.0 * angle), 6.0 * np.sin(angle)], axis=1))
    places, asides = follow_path(path, path[::5], 0.0)
    assert np.all(np.diff(places) > 0.0) and asides.max() < 1e-9
