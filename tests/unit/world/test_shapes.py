"""zteam.world.shapes: outlines and how they are fitted."""

import math

import pytest

from zteam.geometry import Pose2, convex_hull, signed_area
from zteam.world.properties import Size3
from zteam.world.shapes import (
    UNIT_BOX,
    Block,
    Surface,
    boundary_slabs,
    fit_blocks,
    is_simple,
    place_blocks,
    without_repeats,
)

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def test_blocks_are_stretched_to_the_size_and_centred() -> None:
    """The units of a block do not matter, its proportions do not survive: the box of its points becomes the size."""
    (block,) = fit_blocks([Block(((10, 10), (30, 10), (30, 20), (10, 20)), 0, 5)], Size3(4, 6, 2))
    assert block.points == ((-2, -3), (2, -3), (2, 3), (-2, 3))
    assert (block.z_min, block.z_max) == (0, 2)


def test_blocks_of_a_model_are_fitted_together() -> None:
    """Two blocks keep their places to each other; heights are measured from 0, not from the lowest block."""
    left = Block(((0, 0), (1, 0), (1, 2), (0, 2)), 1, 2)
    right = Block(((3, 0), (4, 0), (4, 1), (3, 1)), 2, 4)
    fitted = fit_blocks([left, right], Size3(8, 2, 1))
    assert fitted[0].points == ((-4, -1), (-2, -1), (-2, 1), (-4, 1))
    assert fitted[1].points == ((2, -1), (4, -1), (4, 0), (2, 0))
    assert [(block.z_min, block.z_max) for block in fitted] == [(0.25, 0.5), (0.5, 1)]


def test_blocks_without_an_extent_cannot_be_fitted() -> None:
    """A line cannot be stretched to a size; blocks without a height are flat."""
    with pytest.raises(ValueError, match="extent"):
        fit_blocks([Block(((0, 0), (1, 0), (2, 0)), 0, 1)], Size3(1, 1, 1))
    (flat,) = fit_blocks([UNIT_BOX._replace(z_max=0)], Size3(1, 1, 1))
    assert (flat.z_min, flat.z_max) == (0, 0)


def test_placed_shapes_are_rotated_moved_raised_and_counter_clockwise() -> None:
    """A clockwise outline is turned round, and its pose and height applied."""
    block = Block(((-1, -1), (-1, 1), (2, 1), (2, -1)), 0, 1)
    (shape,) = place_blocks([block], Pose2(10, 20, math.pi / 2), 0.5, Surface(0.25, False, "blue"))
    assert signed_area(shape.points) == pytest.approx(6)
    assert sorted(shape.points) == [pytest.approx(p) for p in [(9, 19), (9, 22), (11, 19), (11, 22)]]
    assert (shape.z_min, shape.z_max, shape.ranger_return, shape.obstacle) == (0.5, 1.5, 0.25, False)


def test_a_boundary_is_four_thin_slabs_inside_the_box() -> None:
    """The slabs reach the box's faces, are 1 cm thick and as high as the box."""
    slabs = boundary_slabs(Size3(10, 4, 2))
    boxes = [(*map(min, zip(*slab.points, strict=True)), *map(max, zip(*slab.points, strict=True))) for slab in slabs]
    assert boxes == [(-5, -2, 5, -1.99), (-5, 1.99, 5, 2), (-5, -2, -4.99, 2), (4.99, -2, 5, 2)]
    assert all((slab.z_min, slab.z_max) == (0, 2) for slab in slabs)


@pytest.mark.parametrize(
    ("points", "simple"),
    [
        (SQUARE, True),
        (SQUARE[::-1], True),
        (((0, 0), (4, 0), (4, 3), (2, 1), (0, 3)), True),
        (((0, 0), (2, 0), (1, 0), (1, 1)), False),
        (((0, 0), (1, 1), (1, 0), (0, 1)), False),
        (((0, 0), (4, 0), (4, 2), (2, 0), (0, 2)), False),
        (((0, 0), (2, 0), (2, 1), (3, 1), (2, 1), (2, 2), (0, 2)), False),
        (((0, 0), (4, 0), (4, 4), (5, 4), (5, 1), (1, 1), (1, 4), (0, 4)), False),
    ],
)
def test_simple_outlines_are_told_from_crossing_ones(points: tuple[tuple[float, float], ...], simple: bool) -> None:
    """Concave is simple; a spike, a crossing, and a corner that touches an edge are not."""
    assert is_simple(tuple(points)) is simple


def test_the_hull_of_points() -> None:
    """Inner points and points on an edge are left out, and the hull runs counter-clockwise."""
    hull = convex_hull([(1, 1), (0, 0), (2, 0), (1, 0), (2, 2), (0, 2), (0, 0)])
    assert hull == ((0, 0), (2, 0), (2, 2), (0, 2))


def test_repeated_corners_are_dropped() -> None:
    """Neither a corner given twice nor a closing corner makes an edge of length zero."""
    assert without_repeats([*SQUARE[:2], SQUARE[1], *SQUARE[2:], SQUARE[0]]) == (*SQUARE[1:], SQUARE[0])
