"""How far a formation is squeezed."""

import math

import pytest

from support.flat_floor import LASER, Segment, cast, make_scan
from zteam.behaviors.squeezing import CLOSING, OPENING, approach, share_for_bend, share_for_room
from zteam.geometry import Pose2

HERE = [Pose2(0.0, 0.0, 0.0)]


def corridor(width: float, x0: float = -5.0, x1: float = 5.0) -> list[Segment]:
    """Two walls along x."""
    return [(x0, side * width / 2.0, x1, side * width / 2.0) for side in (-1.0, 1.0)]


def share(walls: list[Segment], reach: float = 1.0, others: list[tuple[float, float]] | None = None) -> float:
    """The share that slots `reach` metres to either side need, for robots 0.35 m wide."""
    discs = others or []
    scan = make_scan(cast(LASER, walls, discs))
    return share_for_room(scan, HERE, discs, reach, reach, 0.175)


def test_it_closes_faster_than_it_opens() -> None:
    """Each at its rate, and neither beyond what is needed."""
    assert approach(0.0, 1.0, 0.1) == pytest.approx(0.1 * CLOSING)
    assert approach(0.79, 0.8, 0.1) == 0.8
    assert approach(0.8, 0.0, 0.1) == pytest.approx(0.8 - 0.1 * OPENING)
    assert approach(0.505, 0.5, 0.1) == 0.5
    assert OPENING < CLOSING


def test_a_corridor_takes_its_share() -> None:
    """Wide enough: none. Narrower: as much as the walls take. Narrower than one robot: all of it."""
    assert share(corridor(4.0)) == 0.0
    assert share(corridor(1.55)) == pytest.approx(0.5, abs=0.01)
    assert share(corridor(0.4)) == 1.0


def test_walls_behind_and_far_ahead_do_not_count() -> None:
    """A passage that begins beyond two metres is not there yet, and one that it has passed is no more."""
    assert share(corridor(1.0, 2.0, 5.0)) == 0.0
    assert share(corridor(1.0, 1.0, 5.0)) > 0.5
    assert share(corridor(1.0, -5.0, -1.0)) == 0.0


def test_teammates_are_no_walls() -> None:
    """The robots of the formation themselves, beside it, take no room."""
    assert share([(50.0, 50.0, 51.0, 50.0)], others=[(0.0, 0.6), (0.5, -0.6)]) == 0.0


def test_a_column_needs_no_room_beside_it() -> None:
    """Slots that reach nowhere are not squeezed."""
    assert share(corridor(0.6), reach=0.0) == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bend_squeezes_its_inner_side(side: float) -> None:
    """The slots within the bend stay well within its radius; those outside it do not count."""
    left, right = (1.6, 0.0) if side > 0.0 else (0.0, 1.6)
    assert share_for_bend(side / 4.0, left, right) == 0.0
    tight = share_for_bend(side / 1.0, left, right)
    assert (1.0 - tight) * 1.6 == pytest.approx(0.9)
    assert share_for_bend(-side / 1.0, left, right) == 0.0


def test_no_scan_no_squeeze() -> None:
    """Beams that say nothing are no walls."""
    scan = make_scan([math.nan] * 271)
    assert share_for_room(scan, HERE, [], 1.0, 1.0, 0.175) == 0.0
