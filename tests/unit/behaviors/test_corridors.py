"""What a laser's corridor is certain of."""

import math

import numpy as np
import pytest

from zteam.behaviors.corridors import find_corridor

LASER = (-0.75 * math.pi, 1.5 * math.pi / 1080, 1081)
ANGLES = LASER[0] + LASER[1] * np.arange(LASER[2])


@pytest.mark.parametrize("heading", [0.0, 0.3, -2.0, 4.0])
@pytest.mark.parametrize(("share", "blocked"), [(0.97, True), (1.03, False)])
def test_it_is_certain_of_what_is_not_at_its_edge(heading: float, share: float, blocked: bool) -> None:
    """A wall 3 % inside of the rectangle blocks it, one 3 % outside does not, and neither is left open."""
    off = np.remainder(ANGLES - heading + math.pi, math.tau) - math.pi
    with np.errstate(divide="ignore"):
        edge = np.minimum(0.6 / np.cos(off), 0.25 / np.abs(np.sin(off)))
    distances = np.where(np.abs(off) < 0.49 * math.pi, edge * share, math.inf)
    assert find_corridor(LASER, 0.25, 0.6).is_blocked(distances, heading) is blocked


def test_it_leaves_the_edge_open() -> None:
    """Where a hit stands on the edge itself, nothing is certain."""
    distances = np.full(LASER[2], math.inf)
    distances[540] = 0.6
    assert find_corridor(LASER, 0.25, 0.6).is_blocked(distances, 0.0) is None


@pytest.mark.parametrize("laser", [(0.0, 0.0, 1), (0.0, 1e-6, 9), (200.0, 0.1, 9), (0.0, 1e30, 2)])
def test_it_is_certain_of_nothing_where_angles_are_not_exact(laser: tuple[float, float, int]) -> None:
    """Lasers that no table fits are left to the plain formula."""
    corridor = find_corridor(laser, 0.25, 0.6)
    distances = np.full(laser[2], 0.3)
    assert corridor.is_blocked(distances, 0.0) is None
    assert not any(corridor.are_blocked(distances, 0.0, (0.0, 1.0)))


def test_a_few_beams_show_the_headings_that_a_wall_blocks() -> None:
    """A wall in front: those towards it are blocked for certain, those along and away from it are left."""
    with np.errstate(divide="ignore"):
        distances = np.where(np.abs(ANGLES) < 1.4, 0.4 / np.cos(ANGLES), math.inf)
    turns = tuple(math.radians(turn - 10.0) for turn in (0.0, 30.0, -30.0, 110.0, -110.0))
    blocked = find_corridor(LASER, 0.25, 0.6).are_blocked(distances, math.radians(10.0), turns)
    assert [bool(seen) for seen in blocked] == [True, True, True, False, False]
