"""What a scan says, hostile scans included."""

import math

import numpy as np
import pytest

from support.flat_floor import make_scan
from zteam.geometry import quaternion_from_rpy
from zteam.messages import LaserScan
from zteam.robot.view import beams_of, is_seen, look_ahead, look_along, read_beams
from zteam.transforms.lasers import turn_scan

CONE = math.radians(60.0)


def full_turn(nearest_at: float, *, start: float, step: float) -> LaserScan:
    """A scan of one degree a beam with one hit 1 m away at the bearing `nearest_at` (radians), 5 m elsewhere."""
    angles = start + step * np.arange(360)
    off = np.abs(np.remainder(angles - nearest_at + math.pi, math.tau) - math.pi)
    ranges = np.where(off == off.min(), 1.0, 5.0).astype(np.float32)
    return LaserScan(angle_min=start, angle_increment=step, range_max=30.0, ranges=ranges)


@pytest.mark.parametrize("bearing", [0.0, 0.9, -0.9])
@pytest.mark.parametrize(("start", "step"), [(-math.pi, 1), (math.pi, -1), (0.0, 1), (0.0, -1)])
def test_a_hit_is_found_whichever_way_the_scan_runs(bearing: float, start: float, step: int) -> None:
    """Clockwise scans and scans from 0 to 2 pi put the hit where it is."""
    scan = full_turn(bearing, start=start, step=step * math.radians(1.0))
    cone = look_ahead(scan, CONE)
    assert cone is not None
    assert cone.nearest == 1.0
    assert cone.bearing == pytest.approx(bearing, abs=math.radians(0.51))


@pytest.mark.parametrize(
    ("bearing_deg", "seen"), [(59.9, True), (60.0, True), (61.0, False), (-60.0, True), (-61.0, False)]
)
def test_a_cone_ends_at_its_edge(bearing_deg: float, seen: bool) -> None:
    """The beam on the edge counts, the next one does not."""
    scan = full_turn(math.radians(bearing_deg), start=-math.pi, step=math.radians(1.0))
    cone = look_ahead(scan, CONE)
    assert cone is not None
    assert (cone.nearest == 1.0) is seen


@pytest.mark.parametrize(
    "scan",
    [
        make_scan([]),
        LaserScan(ranges=np.ones(3, np.float32), range_max=30.0),
        LaserScan(ranges=np.ones(3, np.float32), range_max=30.0, angle_increment=math.nan),
        LaserScan(ranges=np.ones(3, np.float32), range_max=30.0, angle_increment=0.1, angle_min=math.inf),
    ],
    ids=["empty", "no increment", "nan increment", "inf start"],
)
def test_a_scan_without_angles_shows_nothing(scan: LaserScan) -> None:
    """Where no beam is known to look ahead, nothing is said about what is ahead."""
    assert read_beams(scan) is None
    assert look_ahead(scan, CONE) is None


def test_silent_beams_are_counted_and_not_taken_for_hits() -> None:
    """The first beam being NaN hides nothing, and the share of such beams is told."""
    cone = look_ahead(make_scan([math.nan, 0.3, math.nan, 0.0], fov=1.0), CONE)
    assert cone is not None
    assert (cone.nearest, cone.invalid) == (pytest.approx(0.3), 0.75)
    silent = look_ahead(make_scan([math.nan] * 3, fov=1.0), CONE)
    assert silent is not None
    assert (silent.nearest, silent.invalid) == (math.inf, 1.0)


def test_a_corridor_is_as_wide_ahead_as_here() -> None:
    """A post beside the way does not count however far ahead, one in the way does, one behind never."""
    beside, ahead, behind = (0.5, 1.0), (0.1, 1.0), (0.0, -0.2)

    def along(y: float, x: float) -> float:
        angle, reach = math.atan2(y, x), math.hypot(x, y)
        scan = LaserScan(angle_min=angle, range_max=30.0, ranges=np.array([reach], np.float32))
        return look_along(scan, 0.2)

    assert along(*beside) == math.inf
    assert along(*ahead) == pytest.approx(1.0)
    assert along(*behind) == math.inf


def test_a_corridor_may_lead_aside() -> None:
    """Towards a heading the same things are ahead, beside and behind as if the laser were turned there."""
    scan = full_turn(math.radians(90.0), start=-math.pi, step=math.radians(1.0))
    assert look_along(scan, 0.2, math.radians(90.0)) == pytest.approx(1.0, abs=1e-3)
    assert look_along(scan, 0.2, math.radians(80.0)) == pytest.approx(math.cos(math.radians(10.0)), abs=0.02)
    assert look_along(scan, 0.2, math.radians(60.0)) > 4.0
    assert look_along(scan, 0.2, math.radians(-90.0)) > 4.0


def test_a_scan_is_read_once() -> None:
    """A scan as it comes from the bus, whose ranges cannot be changed."""
    scan = make_scan([1.0, 2.0, 3.0])
    assert isinstance(scan.ranges, np.ndarray)
    scan.ranges.flags.writeable = False
    first, beside = beams_of(scan), beams_of(make_scan([1.0]))
    assert beams_of(scan) is first is not beside


def test_ranges_that_can_be_changed_are_read_each_time() -> None:
    """A behaviour's test may write into the scan that it has shown before."""
    scan = make_scan([1.0, 2.0])
    assert isinstance(scan.ranges, np.ndarray)
    before = beams_of(scan)
    scan.ranges[0] = 0.5
    after = beams_of(scan)
    assert before is not None and after is not None
    assert (before.ranges[0], after.ranges[0]) == (1.0, 0.5)


def test_a_laser_that_looks_back_sees_what_is_behind() -> None:
    """Its angles go beyond pi; a heading is seen if beams look to both sides of it."""
    scan = make_scan([5.0] * 181, fov=math.pi)
    scan.angle_min += math.pi
    seen = [is_seen(scan, math.radians(heading)) for heading in (180.0, -180.0, 100.0, -100.0, 90.0, 0.0)]
    assert seen == [True, True, True, True, False, False]


@pytest.mark.parametrize("angle", [math.nan, math.inf, -math.inf, 1e308])
def test_a_scan_without_usable_angles_sees_nothing(angle: float) -> None:
    """Whatever the message says, it ends nobody's step."""
    scan = make_scan([5.0] * 181, fov=math.pi)
    scan.angle_min = angle
    assert not is_seen(scan, 0.0)
    tilted = turn_scan(scan, quaternion_from_rpy(0.1, 0.0, 1.0))
    assert not is_seen(tilted, 0.0)
