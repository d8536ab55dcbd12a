"""Whether a corridor is clear, against the plain formula, whatever the scan."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from support.flat_floor import make_view
from zteam.behaviors import load_behavior
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan
from zteam.robot.behaviors.evasion import ANGULAR_GAIN, REACH, SIDE_MARGIN, STEP, STEPS
from zteam.robot.behaviors.follow import LEADER_ROOM
from zteam.robot.trials.situations import lookup_in
from zteam.robot.view import first_clear, is_clear, read_beams

LASERS = [
    (-2.3583762645721436, 0.004367363173514605, 1081),
    (2.3583762645721436, -0.004367363173514605, 1081),
    (-math.pi, math.tau / 360, 360),
    (0.0, math.tau / 360, 360),
    (math.pi, -math.tau / 100, 101),
    (-1.0, 0.2, 11),
    (0.3, 0.5, 40),
    (0.0, 0.0, 1),
]
"""First angle, increment and number of beams: usual ones, both ways round, whole turns and more, few beams."""
half_widths = st.sampled_from([0.2, 0.25]) | st.floats(0.01, 1.0)
reaches = st.sampled_from([0.35, 0.6]) | st.floats(-0.1, 2.0)
headings = st.sampled_from([0.0, 0.5 * math.pi, math.pi]) | st.floats(-6.0, 6.0)


@st.composite
def scans(draw: st.DrawFn, half_width: float, reach: float, heading: float) -> LaserScan:
    """Walls in some directions, perhaps hits on the very edge of the corridor, perhaps beams that say otherwise."""
    start, step, count = draw(st.sampled_from(LASERS))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    ranges = np.repeat(random.uniform(0.05, draw(st.sampled_from([0.5, 1.0, 5.0])), 1 + count // 9), 9)[:count]
    if draw(st.booleans()):
        ranges = ranges + 30.0 * (random.random(count) < draw(st.sampled_from([0.5, 0.99])))
    if draw(st.booleans()):
        off = start + step * np.arange(count) - heading
        with np.errstate(divide="ignore", over="ignore"):
            edge = np.abs(np.minimum(max(reach, 0.1) / np.cos(off), half_width / np.abs(np.sin(off))))
        on_edge = random.random(count) < draw(st.sampled_from([0.01, 0.5, 1.0]))
        ranges = np.where(on_edge, edge * (1.0 + draw(st.sampled_from([0.0, 1e-16, -1e-16, 1e-8, 1e-3]))), ranges)
    if draw(st.booleans()):
        said = random.choice([math.nan, math.inf, -math.inf, 0.0, 30.0, 1e-9], count)
        ranges = np.where(random.random(count) < 0.1, said, ranges)
    return LaserScan(
        angle_min=start,
        angle_increment=step,
        range_max=30.0,
        ranges=ranges.astype(draw(st.sampled_from([np.float32, np.float64]))),
    )


@st.composite
def cases(draw: st.DrawFn) -> tuple[LaserScan, float, float, list[float]]:
    """A scan, half the width and the length of a corridor, and headings."""
    half_width, reach = draw(half_widths), draw(reaches)
    asked = draw(st.lists(headings, min_size=1, max_size=25))
    return draw(scans(half_width, reach, asked[0])), half_width, reach, asked


def ends(scan: LaserScan) -> NDArray[np.float64]:
    """(2, n): where the beams with a hit ended."""
    beams = read_beams(scan)
    assert beams is not None
    angles, ranges = beams
    distances = np.maximum(ranges, 1e-6)
    hit = distances < math.inf
    return np.array((distances[hit] * np.cos(angles[hit]), distances[hit] * np.sin(angles[hit])))


def plainly_clear(scan: LaserScan, half_width: float, reach: float, heading: float, slack: float) -> bool:
    """The plain formula: no hit, turned by the heading, lies in the rectangle ahead, made larger by `slack`."""
    hit_x, hit_y = ends(scan)
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = cos * hit_x + sin * hit_y, cos * hit_y - sin * hit_x
    return not ((x > -slack) & (x < reach + slack) & (np.abs(y) <= half_width + slack)).any()


@given(cases())
def test_a_corridor_is_clear_where_the_plain_formula_says_so(case: tuple[LaserScan, float, float, list[float]]) -> None:
    """Towards each heading alone, and for the first of many; silence and whole turns included, and hits on the edge,
    which may count or not."""
    scan, half_width, reach, asked = case
    clear = [heading for heading in asked if is_clear(scan, half_width, reach, heading)]
    for heading in asked:
        least, most = (plainly_clear(scan, half_width, reach, heading, slack) for slack in (1e-9, -1e-9))
        assert least <= (heading in clear) <= most or reach <= 0.0
    found = first_clear(scan, half_width, reach, asked[0], tuple(heading - asked[0] for heading in asked[1:]))
    assert found == pytest.approx(clear[0]) if clear else found is None


@given(
    st.floats(-math.pi, math.pi),
    st.floats(0.81, 3.0),
    st.data(),
)
def test_a_follower_takes_the_first_clear_heading(bearing: float, distance: float, data: st.DataObject) -> None:
    """Over several scans: the leader's bearing, else the nearest clear detour, on the side that it took before."""
    behavior, side = load_behavior("follow", {"leader": 0, "law": "direct", "max_angular": math.pi}, robot_id=1), 0.0
    leader = Pose2(distance * math.cos(bearing), distance * math.sin(bearing), 0.0)
    bearing, distance = math.atan2(leader.y, leader.x), math.hypot(leader.x, leader.y)
    half_width, reach = make_view().base.half_width + SIDE_MARGIN, min(REACH, distance - LEADER_ROOM)
    for _ in range(3):
        scan = data.draw(scans(half_width, reach, bearing))
        view = make_view(scan, robot_id=1, lookup=lookup_in({0: leader, 1: (0.0, 0.0, 0.0)}, 0))
        turns = [sign * step * STEP for step in range(1, STEPS + 1) for sign in (1.0, -1.0)]
        if side:
            turns.sort(key=lambda turn: turn * side < 0.0)
        asked = [bearing, *(bearing + turn for turn in turns)]
        found = next((heading for heading in asked if is_clear(scan, half_width, reach, heading)), None)
        heading = bearing if found is None or found == bearing else normalize_angle(found)
        side = 0.0 if found is None or found == bearing else math.copysign(1.0, found - bearing)
        turn = max(-math.pi, min(math.pi, ANGULAR_GAIN * heading))
        assert behavior.step(view).angular.z == pytest.approx(turn, abs=1e-12)
