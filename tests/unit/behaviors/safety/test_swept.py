"""When a base on an arc meets points: leaving out those that it cannot meet changes nothing."""

import math

import numpy as np
import pytest

from zteam.base import Point2
from zteam.behaviors.safety.swept import Arc, Outline, meeting_time

SLIVERS: list[tuple[Point2, ...]] = [
    ((-5.0, 0.0), (5.0, 0.0), (5.0, 1e-7)),
    ((-5.0, -1e-9), (5.0, 0.0), (0.0, 1e-6)),
    ((-0.2, -5.0), (-0.2, 5.0), (-0.2 + 3e-8, 0.0)),
]
"""Outlines whose tips are so sharp that their sides look opposite ways; the least area that a base may have is 1e-6."""


def random_outline(random: np.random.Generator) -> tuple[Point2, ...]:
    """Three to eight corners about the origin."""
    return tuple((float(x), float(y)) for x, y in random.uniform(-0.6, 0.6, (int(random.integers(3, 9)), 2)))


@pytest.mark.parametrize("clearance", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(30))
def test_points_outside_of_the_swept_ring_are_not_met(
    seed: int, clearance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For outlines of all shapes, and those that are hardly wider than a line, on random arcs among random points."""
    random = np.random.default_rng(seed)
    footprint = SLIVERS[seed % 3] if seed < 6 else random_outline(random)
    outline = Outline(footprint)
    spread = 1.5 * outline.radius + 0.5
    cases = []
    for _ in range(40):
        arc = Arc(*random.uniform(-1.0, 1.0, 2).tolist())
        points = random.uniform(-spread, spread, (2, 20))
        cases.append((arc, points, meeting_time(outline, arc, 3.0, points, clearance)))
    met = [time for _, _, time in cases if time < math.inf]
    assert met
    monkeypatch.setattr(Outline, "ring", lambda *_: (-math.inf, math.inf))
    for arc, points, time in cases:
        # Products of matrices of another width are rounded otherwise.
        assert math.isclose(meeting_time(outline, arc, 3.0, points, clearance), time, abs_tol=1e-9)
