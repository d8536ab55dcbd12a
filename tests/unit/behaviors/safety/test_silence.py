"""Beams that say nothing are not free space: for a moment their last word counts."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from support.flat_floor import TICK, make_scan, make_view
from zteam.behaviors import SafetyLayer
from zteam.behaviors.safety.silence import LastWords
from zteam.behaviors.scans import Beams, beams_of
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Twist, Vector3

START = 100 * TICK
BEAMS = 541
"""Of half a degree each."""


def scan_with(value: float, half_deg: float, bearing_deg: float, now: int) -> LaserScan:
    """A free scan whose beams within `half_deg` of a bearing say `value`."""
    ranges = np.full(BEAMS, 20.0)
    middle = BEAMS // 2 + round(2 * bearing_deg)
    ranges[max(0, middle - round(2 * half_deg)) : middle + round(2 * half_deg) + 1] = value
    scan = make_scan(ranges, now, math.radians(270.0))
    scan.range_min = 0.2
    return scan


def drive(value: float, half_deg: float, bearing_deg: float = 0.0, free_ticks: int = 0) -> list[tuple[float, str]]:
    """What is left of 0.4 m/s straight on, and why, after so many steps with a free scan."""
    layer, found = SafetyLayer(), []
    for tick in range(free_ticks + 10):
        now = START + tick * TICK
        scan = scan_with(20.0 if tick < free_ticks else value, half_deg, bearing_deg, now)
        command, why = layer.limit(Twist(Vector3(0.4)), make_view(scan, now=now))
        found.append((command.linear.x, why))
    return found[free_ticks:]


@pytest.mark.parametrize("value", [math.nan, 0.0, 0.1, -1.0, 31.0])
def test_a_silent_way_is_no_free_way(value: float) -> None:
    """NaN, 0, below range_min, below 0, beyond range_max: the robot stands as long as such beams point into its way."""
    assert drive(value, 5.0) == [(0.0, "blind ahead")] * 10


@pytest.mark.parametrize("value", [math.inf, 30.0, 20.0])
def test_no_hit_is_a_free_way(value: float) -> None:
    """Beams that met nothing are free space."""
    assert drive(value, 5.0) == [(0.4, "")] * 10


def test_the_last_word_of_a_beam_counts_for_half_a_second() -> None:
    """A short silence stops no robot; a longer one does."""
    found = drive(math.nan, 5.0, free_ticks=3)
    assert [speed for speed, _ in found] == [0.4] * 5 + [0.0] * 5


@pytest.mark.parametrize("bearing_deg", [100.0, -120.0])
def test_silent_beams_to_the_side_stop_nobody(bearing_deg: float) -> None:
    """Only what points into the way counts."""
    assert drive(math.nan, 10.0, bearing_deg) == [(0.4, "")] * 10


@pytest.mark.parametrize(("half_deg", "speed"), [(0.0, 0.4), (0.5, 0.0)])
def test_one_silent_beam_is_bridged(half_deg: float, speed: float) -> None:
    """One beam of half a degree between two that speak hides nothing that a robot could hit; three do."""
    assert drive(math.nan, half_deg)[-1][0] == speed


def test_a_teammate_explains_dazzled_beams() -> None:
    """Beams around a teammate that stands far ahead are dazzled by its laser: the robot drives on; without the
    teammate they hide the way."""
    for team, expected in (((0, 1), 0.4), ((0,), 0.0)):
        layer = SafetyLayer()
        for tick in range(10):
            now = START + tick * TICK
            ahead = (Pose2(0.0, 0.0, 0.0), now), (Pose2(6.0, 0.0, 0.0), now)
            view = make_view(
                scan_with(math.nan, 2.0, 0.0, now),
                now=now,
                team=team,
                lookup=lambda target, source, ahead=ahead: ahead[source.startswith("robot_1")],
            )
            command, _ = layer.limit(Twist(Vector3(0.4)), view)
        assert command.linear.x == expected


def read(word: list[float]) -> Beams:
    """A scan, read: a new object each time."""
    beams = beams_of(make_scan(word, START))
    assert beams is not None
    return beams


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(1, 9)), min_size=1, max_size=8))
@example([(0, 2), (1, 8), (2, 4), (0, 1)])
@example([(1, 9), (3, 1), (1, 9), (2, 9)])
@example([(1, 9), (0, 1), (1, 1)])
def test_a_scan_that_stays_the_same_is_filled_as_new_ones_are(seen: list[tuple[int, int]]) -> None:
    """Whatever comes before and after it: distances and silent beams are the same in each step."""
    nothing = [math.nan] * 8
    words = [[2.0] * 16, [2.0] * 8 + nothing, nothing + [3.0] * 8, [3.0] * 8 + [1.0] * 8]
    known, kept, other, now = [read(word) for word in words], LastWords(), LastWords(), START
    for which, ticks in seen:
        for _ in range(ticks):
            distances, silent = kept.fill(known[which], now)
            expected, expected_silent = other.fill(read(words[which]), now)
            assert np.array_equal(distances, expected, equal_nan=True)
            assert (silent is None) == (expected_silent is None)
            assert silent is None or np.array_equal(silent, expected_silent)
            now += TICK


def test_what_stays_silent_is_the_same_object() -> None:
    """What follows from it needs not to be worked out again."""
    words, same = LastWords(), read([2.0] * 8 + [math.nan] * 8)
    first, silent = words.fill(same, START)
    again, still_silent = words.fill(same, START + TICK)
    assert first is again
    assert silent is still_silent
