"""The kernels of the safety layer give what their formulas say, and whatever they are given is defined."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from support.flat_floor import TICK, make_odometry, make_view
from zteam import names
from zteam.behaviors import SafetyLayer
from zteam.geometry import Point2, Pose2, Velocity, normalize_angle
from zteam.kernels import escape, view
from zteam.kernels.binding import ffi
from zteam.messages import Header, LaserScan, Twist, Vector3, time_from_ns
from zteam.messages.base import DEFAULT_BASE
from zteam.robot.safety.motion import limits_of

Floats = NDArray[np.float64]
odd = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-300, 1e300, -1e300]) | st.floats()
NEAR = 1e-9


@given(arrays(np.float64, (4, 4), elements=st.floats(-9.0, 9.0)), st.integers(0, 3))
def test_poses_in_the_frame_of_one_of_them(poses: Floats, own: int) -> None:
    """As Pose2 says, with yaws between -pi and pi."""
    seen = np.reshape(view.see_poses(ffi.new("double[]", poses.ravel().tolist()), own), (-1, 3))
    for found, pose in zip(seen.tolist(), poses.tolist(), strict=True):
        expected = Pose2(*poses[own, :3].tolist()).inverse().compose(Pose2(*pose[:3]))
        assert math.isclose(found[0], expected.x, abs_tol=1e-13)
        assert math.isclose(found[1], expected.y, abs_tol=1e-13)
        assert abs(found[2]) <= math.pi
        assert abs(normalize_angle(found[2] - expected.yaw)) < 1e-13


LASERS = [(-2.356, 0.1, 48), (-math.pi, math.tau / 36, 36), (0.3, 0.5, 40), (-0.5, 0.005, 300)]
"""First angle, increment and number of beams: a whole turn and more, and beams of which the nearest of three counts."""
FAR, SPAN = 4.0, 3.0
ranges = st.floats(0.03125, 6.0, width=32) | st.sampled_from([math.nan, math.inf])


@st.composite
def looks(draw: st.DrawFn) -> list[tuple[Pose2, tuple[float, float, int], Floats]]:
    """Poses in `odom`, each with a laser and what it sees, or nothing: any laser, as of a robot with two."""
    found = []
    for _ in range(draw(st.integers(1, 9))):
        laser = draw(st.sampled_from(LASERS))
        pose = Pose2(draw(st.floats(-0.4, 0.4)), draw(st.floats(-0.4, 0.4)), draw(st.floats(-3.0, 3.0)))
        values = np.full(laser[2], math.nan, np.float32)
        if draw(st.booleans()):
            values = draw(arrays(np.float32, laser[2], elements=ranges))
        found.append((pose, laser, values))
    return found


class Remembered(NamedTuple):
    """A point in `odom`, and how far the base had travelled when it was seen."""

    x: float
    y: float
    way: float


@given(looks(), st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)))
def test_what_is_remembered(script: list[tuple[Pose2, tuple[float, float, int], Floats]], place: Point2) -> None:
    """As the slow loop does: a scan forgets the points up to the ends of its beams, and adds its hits; what is far, or
    was seen more than 3 m of travel ago, is forgotten. Points on the edge of a rule are not drawn."""
    layer, known, way, last, now = SafetyLayer(), list[Remembered](), 0.0, script[0][0], TICK
    for pose, (start, step, count), values in script:
        now, way, last = now + TICK, way + math.dist(pose[:2], last[:2]), pose
        scan = LaserScan(Header(time_from_ns(now)), start, 0.0, step, range_max=30.0, ranges=values)
        layer.limit(Twist(), make_view(scan, now=now, odom=make_odometry(pose), laser=place))
        laser, kept = pose.compose(Pose2(*place, 0.0)), []
        for point in known:
            x, y = laser.locate(point.x, point.y)
            away, beam = math.hypot(x, y), (math.atan2(y, x) - start) / step
            at = round(beam) % round(math.tau / step)
            told = at < count and not math.isnan(values[at]) and float(values[at]) >= away - 0.05
            edge = abs(beam % 1.0 - 0.5), abs(away - FAR), abs(point.way - way + SPAN)
            assume(min(edge) > NEAR and not (at < count and abs(float(values[at]) - away + 0.05) < NEAR))
            if not told and away <= FAR and point.way >= way - SPAN:
                kept.append(point)
        few = max(1, int(math.radians(1.0) / step + 1e-6))
        for first in range(0, count, few):
            hits = [(float(values[i]), i) for i in range(first, min(count, first + few)) if values[i] < FAR]
            if hits:
                away, i = min(hits)
                x, y, _ = laser.compose(
                    Pose2(away * math.cos(start + i * step), away * math.sin(start + i * step), 0.0)
                )
                kept.append(Remembered(x, y, way))
        known = kept
    expected = np.reshape([pose.locate(point.x, point.y) for point in known], (-1, 2))
    assert layer.points.T.shape == expected.shape
    assert np.allclose(layer.points.T, expected, rtol=0.0, atol=1e-5)


@given(
    arrays(np.float64, (3, 4), elements=odd), arrays(np.float64, 5, elements=odd), st.lists(odd, min_size=9, max_size=9)
)
def test_odd_numbers_give_defined_results(known: Floats, distances: Floats, n: list[float]) -> None:
    """No number, infinity or magnitude leads out of an array: a time or a distance is no NaN."""
    with np.errstate(all="ignore"):
        distances, nearest, seen = view.Directions(n[5], n[6], 5).read(distances.astype(np.float32), n[0], n[1], 0.0)
    assert not math.isnan(limits_of(DEFAULT_BASE).meeting_time(Velocity(*n[:3]), n[3], known[:2], n[4]))
    assert not math.isnan(view.look_along(seen, n[0], n[1]))
    assert view.first_clear(seen, n[0], n[1], np.array(n)) < len(n)
    assert len(view.see_poses(ffi.new("double[]", 2 * [*n[:8]]), 3)) == 12
    assert nearest >= 0.0
    assert seen.silent == np.isnan(distances).sum()


numbers = odd | st.floats(-2.0, 2.0)
poses = st.builds(Pose2, numbers, numbers, numbers)


@given(
    st.lists(
        st.tuples(
            poses,
            st.tuples(numbers, numbers),
            arrays(np.float32, st.sampled_from([0, 1, 2, 48, 90]), elements=st.floats(width=32)),
            st.tuples(numbers, numbers, numbers),
            st.lists(st.none() | st.tuples(poses, st.integers(0, 2 * TICK)), min_size=1, max_size=3),
            st.sampled_from([0, 1, 21]),
            st.floats(0.0, 9.0),
        ),
        max_size=4,
    )
)
def test_whatever_comes_the_command_is_within_the_limits(steps: list[tuple[Any, ...]]) -> None:
    """Odd poses, lasers, ranges, commands and stamps, no teammates and 20 of them, from step to step: the command is a
    number, and the base's."""
    layer, now = SafetyLayer(), TICK
    for pose, laser, values, (x, turn, angle), mates, count, dt in steps:
        now += TICK
        at = {names.robot_frame(i + 1, names.BASE_FOOTPRINT): mate for i, mate in enumerate(20 * mates)}
        at[names.robot_frame(0, names.BASE_FOOTPRINT)] = Pose2(0.0, 0.0, 0.0), now
        scan = LaserScan(Header(time_from_ns(now)), angle, 0.0, laser[0], range_max=laser[1], ranges=values)
        seen = make_view(
            scan, now=now, dt=dt, odom=make_odometry(pose) if math.isfinite(pose.yaw) else None, laser=laser,
            team=tuple(range(count)), lookup=lambda _target, source, at=at: at.get(source),
        )  # fmt: skip
        command, _ = layer.limit(Twist(Vector3(x), Vector3(z=turn)), seen)
        assert abs(command.linear.x) <= DEFAULT_BASE.max_vel_x
        assert abs(command.angular.z) <= DEFAULT_BASE.max_vel_theta
        assert len(layer.points.T) <= 4 * 90


@pytest.mark.parametrize("beams", [0, 1, 100_000])
def test_a_scan_of_any_size(beams: int) -> None:
    """Also one that is larger than all before it, with beams that say nothing: the way ahead is blind, or free."""
    layer, now = SafetyLayer(), TICK
    for count, value in ((541, 20.0), (beams, math.nan), (beams, 20.0), (541, 20.0)):
        now += 10 * TICK
        scan = LaserScan(Header(time_from_ns(now)), -2.0, 0.0, 4.0 / max(1, count - 1), range_max=30.0)
        scan.ranges = np.full(count, value, np.float32)
        command, reason = layer.limit(Twist(Vector3(0.3)), make_view(scan, now=now, dt=0.0))
        is_free = count > 1 and value == 20.0
        assert (command.linear.x == 0.3, reason == "") == (is_free, is_free)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda a: limits_of(DEFAULT_BASE).meeting_time(Velocity(), 1.0, a[:1]), "points"),
        (lambda _: view.see_poses(ffi.new("double[8]"), 2), "own"),
        (lambda a: view.Directions(0.0, 0.1, 3).read(a[:, ::2], 0.0, 9.0, 0.0), "ranges"),
        (lambda a: view.first_clear(None, 0.1, 1.0, a), "headings"),
        (lambda a: escape.find_moves(a, 0.3, (), 0, (), (), (), a, 0.05, [0.0] * 3), "headings"),
        (
            lambda a: escape.find_moves(a, 0.3, (), 0, (), (), (), np.full((16, 5), 3.0), 0.05, [0.0] * 3),
            "headings",
        ),
    ],
)
def test_what_does_not_fit_is_refused(call: Any, name: str) -> None:
    """Wrong shapes and orders of arrays: the argument is named."""
    with pytest.raises(ValueError, match=f"^{name}: "):
        call(np.ones((3, 4)))


@pytest.mark.parametrize("kind", ["float64", "int16", "float16", ">f4", "object"])
def test_arrays_of_another_type_are_refused(kind: str) -> None:
    """Also of types that the kernels lack altogether, and with bytes in another order."""
    with pytest.raises((TypeError, ValueError), match=r"^ranges: |'float \*'"):
        view.read_ranges(np.ones(3, kind), 0.0, 30.0)
