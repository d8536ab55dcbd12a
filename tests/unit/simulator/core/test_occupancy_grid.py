"""The map of what stands still: thin walls are walls, and a map that fits no memory is refused."""

import math

import numpy as np
import pytest

from support.small_worlds import is_occupied, make_box, make_robot
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.simulator.core.occupancy_grid import map_message
from zteam.simulator.world.bodies import boundary_slabs, place_blocks
from zteam.simulator.world.model import Floorplan, Obstacle, Shape, World
from zteam.simulator.world.placing import map_metadata
from zteam.simulator.world.properties import Size3


def occupied(*things: Obstacle | Floorplan, resolution: float) -> np.ndarray:
    """The map's cells, rows from the bottom."""
    plans = tuple(thing for thing in things if isinstance(thing, Floorplan))
    obstacles = tuple(thing for thing in things if isinstance(thing, Obstacle))
    message = map_message(World("w", 100_000_000, plans, obstacles, (make_robot(),)), resolution)
    return np.asarray(message.data).reshape(message.info.height, message.info.width) == 100


@pytest.mark.parametrize("shift", [0.0, 0.013, 0.021, 0.037])
def test_a_boundary_is_closed_on_the_map(shift: float) -> None:
    """Walls of 1 cm close a map of 5 cm cells all around, wherever they lie in their cells; its inside is free."""
    slabs = place_blocks(boundary_slabs(Size3(4.0 + shift, 3.0, 1.0)), Pose2(0.0, 0.0, 0.0), 0.0, (1.0, True, "red"))
    cells = occupied(Obstacle("slabs", Pose2(shift, 0.0, 0.0), slabs), resolution=0.05)
    assert cells[[0, -1]].all()
    assert cells[:, [0, -1]].all()
    assert not cells[2:-2, 2:-2].any()


def test_a_slanting_thin_wall_has_no_gaps() -> None:
    """Every row and column that the wall passes has a cell of it."""
    wall = Shape(((0.0, 0.0), (3.0, 0.0), (3.0, 0.01), (0.0, 0.01)), 0.0, 1.0)
    cells = occupied(Obstacle("wall", Pose2(0.0, 0.0, 0.6), (wall,)), resolution=0.05)
    assert cells.any(axis=0).all()
    assert cells.any(axis=1).all()


def test_fine_pixels_are_not_lost_between_centres() -> None:
    """A line one pixel of 1 cm wide is on a map of 5 cm cells."""
    bitmap = np.zeros((100, 100), bool)
    bitmap[:, 11] = bitmap[70, :] = True
    plan = Floorplan("floor", bitmap, (0.01, 0.01), Pose2(0.0, 0.0, 0.0), 0.0, 1.0)
    cells = occupied(plan, resolution=0.05)
    assert cells[:, 2].all()
    assert cells[14].all()
    assert np.count_nonzero(cells) == 39


@pytest.mark.parametrize("yaw", [0.0, 0.4, math.pi / 2, -2.0, math.pi])
def test_a_cell_is_what_the_bitmap_has_at_its_centre(yaw: float) -> None:
    """However the bitmap lies in the map, and beside it, where everything is free."""
    bitmap = np.random.default_rng(3).random((70, 45)) < 0.4
    plan = Floorplan("floor", bitmap, (0.11, 0.07), Pose2(0.3, -0.2, yaw), 0.0, 1.0)
    world = World("w", 100_000_000, (plan,), (make_box("box", 9.0, 9.0),), (make_robot(),))
    message = map_message(world, 0.05)
    info = message.info
    cells = np.asarray(message.data).reshape(info.height, info.width) == 100
    left, bottom = info.origin.position.x, info.origin.position.y
    own = [
        (row, column)
        for row in range(info.height)
        for column in range(info.width)
        if is_occupied(plan, left + (column + 0.5) * 0.05, bottom + (row + 0.5) * 0.05)
    ]
    expected = np.zeros_like(cells)
    expected[tuple(np.transpose(own))] = True
    # The box stands beside the bitmap.
    beside = left + (np.arange(info.width) + 0.5) * 0.05 > 8.0
    assert (cells == expected)[:, ~beside].all()
    assert len(own) > 1000
    assert np.count_nonzero(cells[:, beside]) == 64


def test_thick_things_are_no_fatter_than_before() -> None:
    """A box of eight cells a side that lies on the grid covers 64 cells."""
    assert np.count_nonzero(occupied(make_box("box", 0.0, 0.0), resolution=0.05)) == 64


def test_a_map_too_large_names_the_way_out() -> None:
    """Boxes a thousand kilometres apart do not end in a MemoryError."""
    with pytest.raises(UsageError, match="--map-resolution"):
        occupied(make_box("a", -5e5, -5e5), make_box("b", 5e5, 5e5), resolution=0.05)


def test_the_metadata_is_that_of_the_message() -> None:
    """Origin and size can be asked for without the cells."""
    info = map_metadata(World("w", 100_000_000, (), (make_box("box", 2.0, 1.0),), (make_robot(),)), 0.07)
    assert (info.width, info.height, info.resolution) == (6, 6, 0.07)
    assert (info.origin.position.x, info.origin.position.y) == pytest.approx((1.8, 0.8))


def test_an_empty_world_has_a_map() -> None:
    """A world without robots and models, whose robots come later, has a map of one cell."""
    grid = map_message(World("w", 100_000_000, (), (), ()), 0.1)
    assert (grid.info.width, grid.info.height, grid.data.tolist()) == (1, 1, [0])
