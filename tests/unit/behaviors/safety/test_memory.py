"""Remembered points: each is found in the boxes that it lies in, wherever the base has gone since."""

import math

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from zteam.behaviors.safety.memory import ScanMemory
from zteam.behaviors.safety.sectors import Sectors
from zteam.behaviors.safety.swept import DRIVE_MARGIN, Box
from zteam.geometry import Pose2

STILL = Pose2(0.0, 0.0, 0.0)
OUTLINE = 0.225, 0.125, 0.175, 0.285
"""What the base reaches to: rear, front, either side, corners."""
moves = st.builds(Pose2, st.floats(-0.3, 0.3), st.floats(-0.05, 0.05), st.floats(-0.5, 0.5))
looks = st.tuples(moves, st.floats(0.2, 0.9))


def room(radius: float) -> Sectors:
    """A scan of a round room."""
    return Sectors(-0.75 * math.pi, math.radians(1.0), np.full(271, radius))


PILLARS = Sectors(-0.75 * math.pi, math.radians(1.0), np.linspace(0.25, 1.0, 271)[np.arange(271) * 7 % 271])
"""A scan of things at all distances."""


def into(frame: Pose2, points: np.ndarray) -> np.ndarray:
    """Points in a frame of the pose `frame`."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    x, y = points[0] - frame.x, points[1] - frame.y
    return np.array((cos * x + sin * y, cos * y - sin * x))


@given(st.lists(looks, min_size=1, max_size=12), st.floats(-0.9, 0.0), st.floats(0.0, 0.9))
@example([(STILL, 0.3), (STILL, 0.9)], -0.9, 0.9)
@example([(STILL, 0.3), (Pose2(0.09, 0.0, 0.0), 0.39)], -0.9, 0.9)
def test_all_points_in_a_box_are_found(steps: list[tuple[Pose2, float]], left: float, right: float) -> None:
    """Whatever was asked for before, with new scans in between."""
    memory, pose, box = ScanMemory(*OUTLINE), STILL, Box(left, right, -0.3, 0.2)
    for move, reach in steps:
        pose = pose.compose(move)
        if memory.move(pose):
            memory.keep(PILLARS, 0.25, STILL)
        found = memory.remembered(box, reach)
        # Asking has brought all scans into the cloud, if any point may be near.
        x, y = into(pose, memory._cloud)
        away = np.hypot(x, y)
        inside = (away < reach - 1e-9) & (x >= box.left) & (x <= box.right) & (y >= box.bottom) & (y <= box.top)
        shown = set(zip(*found.tolist(), strict=True))
        assert memory._pending or set(zip(x[inside].tolist(), y[inside].tolist(), strict=True)) <= shown
        assert all(math.hypot(*point) < reach + 1e-9 for point in shown)
        assert all(box.away(*point) <= math.sqrt(2.0) * DRIVE_MARGIN + 1e-9 for point in shown)


def test_a_kept_scan_is_asked_for_at_once() -> None:
    """The part of the cloud that is kept is none of an older cloud."""
    memory, box = ScanMemory(*OUTLINE), Box(-1.0, 1.0, -1.0, 1.0)
    memory.move(STILL)
    memory.keep(room(0.6), 0.6, STILL)
    assert memory.remembered(box, 0.9).shape[1] == 271
    memory.move(Pose2(0.0, 0.0, 0.3))
    memory.keep(room(0.7), 0.6, STILL)
    found = memory.remembered(box, 0.9)
    assert np.isclose(np.hypot(*found), 0.7).sum() == 271
