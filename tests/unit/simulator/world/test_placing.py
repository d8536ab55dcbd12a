"""Whether a robot can stand at a pose."""

import math

import numpy as np
import pytest

from zteam.geometry import Pose2
from zteam.simulator.world.model import Floorplan, Obstacle, Robot, Shape, World
from zteam.simulator.world.placing import find_hindrance, find_places


def box(width: float, depth: float, z_min: float = 0.0, z_max: float = 0.5) -> tuple[Shape, ...]:
    """A box around the origin."""
    x, y = width / 2, depth / 2
    return (Shape(((-x, -y), (x, -y), (x, y), (-x, y)), z_min, z_max),)


def robot(x: float, y: float, yaw: float = 0.0) -> Robot:
    """A robot of 0.4 m by 0.2 m, 0.25 m high."""
    return Robot("robot_9", "box", Pose2(x, y, yaw), box(0.4, 0.2, z_max=0.25), ())


def world(*obstacles: Obstacle, plans: tuple[Floorplan, ...] = ()) -> World:
    """A world of these things."""
    return World("w", 100_000_000, plans, obstacles, ())


def plan(z_min: float = 0.0, yaw: float = 0.0) -> Floorplan:
    """10 m by 6 m from (1, 2), of cells of 0.1 m, with a wall of one cell around."""
    occupied = np.ones((60, 100), bool)
    occupied[1:-1, 1:-1] = False
    return Floorplan("floor", occupied, (0.1, 0.1), Pose2(1.0, 2.0, yaw), z_min, z_min + 1.0)


PILLAR = Obstacle("pillar", Pose2(2.0, 0.0, math.pi / 4), box(1.0, 1.0))


@pytest.mark.parametrize(
    ("x", "y", "yaw", "free"),
    [
        (2.0, 0.0, 0.0, False),  # inside
        (1.15, 0.0, 0.0, False),  # its nose in the corner, which reaches to 1.29
        (1.05, 0.0, 0.0, True),
        (1.15, 0.0, math.pi / 2, True),
        (1.25, 0.0, math.pi / 2, False),
        (1.4, 0.6, 0.0, True),  # in the corner of the pillar's box, outside of the pillar
    ],
)
def test_a_robot_does_not_stand_in_things(x: float, y: float, yaw: float, free: bool) -> None:
    """The bodies themselves count, however they are turned, and not the boxes around them."""
    told = find_hindrance(world(PILLAR), robot(x, y, yaw), {})
    assert told == ("" if free else "would stand in 'pillar'")


def test_a_cross_of_two_bars_collides() -> None:
    """Two bodies of which neither has a corner or its centre in the other."""
    bar = Obstacle("bar", Pose2(0.15, 0.0, 0.0), box(0.05, 3.0))
    assert find_hindrance(world(bar), robot(0.0, 0.0), {}) == "would stand in 'bar'"


def test_touching_is_standing_beside() -> None:
    """A robot may stand against a wall, and against another robot."""
    wall = Obstacle("wall", Pose2(0.0, 1.0, 0.0), box(4.0, 0.2))
    assert find_hindrance(world(wall), robot(0.0, 0.8), {}) == ""
    assert find_hindrance(world(wall), robot(0.0, 0.8), {9: robot(0.4, 0.8)}) == ""
    assert find_hindrance(world(wall), robot(0.0, 0.8), {9: robot(0.39, 0.8)}) == "would stand in robot 9"


def test_what_is_above_or_no_obstacle_is_no_hindrance() -> None:
    """A table's top, a bridge, and what bodies pass through."""
    top = Obstacle("top", Pose2(0.0, 0.0, 0.0), box(2.0, 2.0, 0.7, 0.8))
    ghost = Obstacle("ghost", Pose2(0.0, 0.0, 0.0), (Shape(box(2.0, 2.0)[0].points, 0.0, 1.0, obstacle=False),))
    assert find_hindrance(world(top, ghost), robot(0.0, 0.0), {}) == ""
    assert find_hindrance(world(plans=(plan(0.5),)), robot(5.0, 2.05), {}) == ""


@pytest.mark.parametrize("yaw", [0.0, math.pi / 6])
def test_the_walls_of_a_bitmap_are_in_the_way(yaw: float) -> None:
    """Cells are where the bitmap's own pose puts them."""

    def told(along: float, across: float) -> str:
        x = 1.0 + math.cos(yaw) * along - math.sin(yaw) * across
        y = 2.0 + math.sin(yaw) * along + math.cos(yaw) * across
        return find_hindrance(world(plans=(plan(yaw=yaw),)), robot(x, y, yaw), {})

    assert told(5.0, 3.0) == told(0.31, 0.21) == told(9.69, 5.79) == ""
    assert told(0.2, 3.0) == told(9.8, 3.0) == told(5.0, 0.1) == told(5.0, 5.9) == "would stand in a wall of 'floor'"


def test_a_part_of_a_cell_is_in_the_way() -> None:
    """A corner of a coarse cell is in the way, although the middle of the cell stays free; its rim of 5 cm is not."""
    cells = np.zeros((4, 4), bool)
    cells[2, 2] = True
    coarse = Floorplan("blocks", cells, (1.0, 1.0), Pose2(0.0, 0.0, 0.0), 0.0, 1.0)
    assert find_hindrance(world(plans=(coarse,)), robot(1.86, 2.1), {}) == "would stand in a wall of 'blocks'"
    assert find_hindrance(world(plans=(coarse,)), robot(1.84, 2.1), {}) == ""


def test_there_is_room_in_the_hollow_of_a_thing() -> None:
    """Between the arms of a U a robot is free; in an arm, and in the base between them, it is not."""
    points = ((-2.0, -1.0), (2.0, -1.0), (2.0, 2.0), (1.0, 2.0), (1.0, 0.0), (-1.0, 0.0), (-1.0, 2.0), (-2.0, 2.0))
    dock = world(Obstacle("dock", Pose2(0.0, 0.0, 0.0), (Shape(points, 0.0, 1.0),)))
    assert find_hindrance(dock, robot(0.0, 0.1), {}) == find_hindrance(dock, robot(0.0, 0.75), {}) == ""
    for x, y in ((1.5, 1.0), (0.0, -0.5), (0.81, 1.0)):
        assert find_hindrance(dock, robot(x, y), {}) == "would stand in 'dock'"


def test_outside_is_beyond_what_stands_still() -> None:
    """A floor plan bounds a world; a plain with a pillar and no robots of its own goes on for 1,000 km."""
    told = find_hindrance(world(plans=(plan(),)), robot(40.0, 3.0), {})
    assert told == "would stand outside of the world, which reaches from x 1, y 2 to x 11, y 8"
    assert "outside" in find_hindrance(world(plans=(plan(),)), robot(5.0, 1.5), {})
    assert find_hindrance(world(PILLAR), robot(40.0, 3.0), {}) == ""
    assert "outside" in find_hindrance(world(plans=(plan(),)), robot(1e308, -1e308), {})
    assert "outside" in find_hindrance(world(PILLAR), robot(1e308, -1e308), {})


def test_a_door_does_not_open_a_house() -> None:
    """Places are inside of walls that have a door, while there is room; beside them only after that."""
    occupied = np.zeros((100, 100), bool)
    occupied[20:80, 20:80] = True
    occupied[22:78, 22:78] = False
    occupied[20:22, 45:60] = False
    inside = find_places(occupied, 0.1, 30)
    assert len(inside) == 30 and all(2.2 < x < 7.8 and 2.0 < y < 7.8 for x, y in inside)
    everywhere = find_places(occupied, 0.1, 200)
    assert len(everywhere) == 200 and any(x < 2.0 for x, _ in everywhere)
