"""What a range means: one rule, in all that reads scans."""

import math
import struct

import numpy as np
import pytest

from studies.view.frames import decode_frame
from zteam.behaviors import read_beams
from zteam.geometry import Pose2
from zteam.kernels.navigation import find_hits
from zteam.messages import LaserScan
from zteam.messages.laser import read_ranges
from zteam.navigation.planning.scans import Scan
from zteam.transforms.rigid import scan_points
from zteam.view import frames

HIT, FREE, CLOSE, SILENT = "hit", "free", "too close", "silent"
MEANINGS = [
    (1.0, HIT),
    (0.1, HIT),
    (30.0, FREE),
    (math.inf, FREE),
    (-math.inf, CLOSE),
    (math.nan, SILENT),
    (0.0, SILENT),
    (-1.0, SILENT),
    (0.05, SILENT),
    (31.0, SILENT),
]


def meaning_of(distance: float) -> str:
    """What a distance that was read stands for."""
    return SILENT if math.isnan(distance) else {math.inf: FREE, 0.0: CLOSE}.get(distance, HIT)


@pytest.mark.parametrize(("value", "meaning"), MEANINGS)
def test_each_value_has_one_meaning(value: float, meaning: str) -> None:
    """Hit, no hit, too close or nothing said: as REP 117 and LaserScan's own comments have it."""
    found = read_ranges(np.array([value, 2.0], np.float32), 0.1, 30.0)
    assert meaning_of(found.distances[0]) == meaning
    assert found.distances[1] == 2.0
    assert bool(found.silent) == (meaning == SILENT)
    assert found.nearest <= np.nanmin(found.distances)


def test_limits_hold_however_they_were_rounded() -> None:
    """A range_max that float32 cannot hold is still "no hit" and not out of range."""
    for most in (30.1, 5.6):
        found = read_ranges(np.array([most, 0.1], np.float32), 0.1, most)
        assert found.distances.tolist() == [math.inf, pytest.approx(0.1)]


def test_no_beams_are_no_hit() -> None:
    """A scan without ranges says nothing, and fails nothing."""
    assert read_ranges([], 0.0, 30.0).distances.size == 0


@pytest.mark.parametrize(("value", "meaning"), MEANINGS)
def test_all_readers_agree(value: float, meaning: str) -> None:
    """Behaviours, costmap and localiser, the page and the points of a transformed scan have the same rule."""
    ranges = np.array([value], np.float32)
    scan = LaserScan(angle_increment=0.1, range_min=0.1, range_max=30.0, ranges=ranges)
    beams = read_beams(scan)
    assert beams is not None
    assert meaning_of(beams[1][0]) == meaning
    assert math.isnan(scan_points(scan)[0, 0]) is (meaning != HIT)
    # Where it is that is too close to measure, no cell says.
    origin = Pose2(0.0, 0.0, 0.0)
    hits = find_hits(Scan(ranges, 0.0, 0.1, 0.1, 30.0, origin), origin, 30.0, 1)
    assert hits[:, 0].tolist() == ([pytest.approx(value)] if meaning == HIT else [])
    frame = frames.encode_frame(1, 1, 0.0, 0.0, [frames.encode_scan(0, 0, scan, Pose2(0.0, 0.0, 0.0), 9)])
    (block,) = decode_frame(frame)[1]
    (steps,) = struct.unpack("<H", block[3][-2:])
    drawn = {CLOSE: frames.INVALID, SILENT: frames.INVALID, FREE: frames.NO_RETURN}
    assert steps == (drawn[meaning] if meaning in drawn else round(value / frames.RANGE_STEP))
