"""Rays of the laser kernels beside a fixed piece of numpy (docs/benchmarks.md).

100 scans of up to 30 m from free places of the office: against its bitmap, and against 100 robots.
"""

import math
from typing import Any

import numpy as np
import pytest

from zteam.cli.bench import place_robots
from zteam.config.resources import find_world
from zteam.kernels.simulator import BeamTable, Bitmaps, Fans, Rays, cast_edges, cast_squares
from zteam.simulator.core.casting import group_shapes, make_polygons, prepare_plans
from zteam.world import World, load_world

SCANS, ROUNDS = 100, 30


@pytest.fixture(scope="module")
def office() -> World:
    """The shipped world."""
    return load_world(find_world("office"))


def make_fans(world: World, beams: int, fov_deg: float) -> Fans:
    """Fans of rays from free places."""
    at = np.array([robot.pose for robot in place_robots(world, SCANS, seed=1).values()]).T.copy()
    rays = Rays(at, np.full(SCANS, world.floorplans[0].z_min + 0.1), np.full(SCANS, -1, np.int64))
    angles = np.radians(np.linspace(-fov_deg / 2, fov_deg / 2, beams))[None, :]
    increment = math.radians(fov_deg) / (beams - 1)
    return Fans(rays, BeamTable(np.cos(angles), np.sin(angles), math.radians(-fov_deg / 2), increment, 30.0))


def test_reference(benchmark: Any) -> None:
    """A fixed piece of numpy: how fast the machine is at the moment."""
    values = np.arange(1_000_000, dtype=np.float64)
    assert benchmark(lambda: np.sort(np.sin(values))).size == values.size


@pytest.mark.parametrize(("beams", "fov_deg"), [(1081, 270.0), (180, 180.0)])
def test_bitmap(benchmark: Any, office: World, beams: int, fov_deg: float) -> None:
    """Rays end at walls."""
    ((_, bitmap),) = prepare_plans(office.floorplans[:1])
    maps, fans = Bitmaps([bitmap]), make_fans(office, beams, fov_deg)
    benchmark.pedantic(lambda: cast_squares(maps, fans, 1), setup=lambda: fans.ranges.fill(30.0), rounds=ROUNDS)
    assert (fans.ranges < 30.0).mean() > 0.5


def test_robots(benchmark: Any, office: World) -> None:
    """Rays end at other robots."""
    robots = list(place_robots(office, SCANS, seed=2).values())
    polygons = make_polygons(group_shapes(robots, []))
    polygons.move(np.array([robot.pose for robot in robots], float))
    fans = make_fans(office, 1081, 270.0)
    benchmark.pedantic(lambda: cast_edges(polygons, fans), setup=lambda: fans.ranges.fill(30.0), rounds=ROUNDS)
    assert (fans.ranges < 30.0).any()
