"""The figures of the study `nav`, each beside a reference that is no part of zteam and runs in the same rounds."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from studies.navigation.scene import (
    NavFigure,
    Progress,
    costmap_of,
    find_map,
    find_starts,
    find_ways,
    make_robot,
    outline_of,
    scan_of,
    wander,
)
from studies.navigation.teams import TEAM_ROWS
from studies.navigation.ways import cost_of, length_of
from zteam.cli.bench import figure
from zteam.cli.tables import format_table
from zteam.clock import process_time
from zteam.geometry import Pose2
from zteam.navigation.planning.amcl import Amcl, AmclOptions
from zteam.navigation.planning.costmap import CostmapOptions, make_circle, make_costmap
from zteam.navigation.planning.planner import AStarPlanner
from zteam.world import World, load_world

FINE, COARSE = 0.025, 0.05
"""Metres a cell: for search and costmap, and for localisation."""
_PAIRS, _LEAST = 21, 15.0
_ROUNDS = 7
_AMCL_SECONDS = 120.0
_FOUND = 0.5
"""Metres from the truth within which a robot is found."""
_LOST_FOR = 60.0
"""Simulated seconds in which it must be found, and stay so."""


def measure_navigation(path: Path, rows: list[str], tours: int, progress: Progress) -> Iterator[NavFigure]:
    """The rows of ROWS and TEAM_ROWS that are asked for."""
    world = load_world(path)
    for row in rows:
        if row in TEAM_ROWS:
            yield from TEAM_ROWS[row](path, world, tours, progress)
        else:
            yield from ROWS[row](world, tours, progress)


def reference_ms() -> float:
    """A fixed piece of numpy, ms of processor time: says how fast the machine is at the moment."""
    values = np.arange(1_000_000, dtype=np.float64)
    begin = process_time()
    np.sort(np.sin(values))
    return 1e3 * (process_time() - begin)


def _least_ms(call: Callable[[], object], rounds: int = _ROUNDS) -> float:
    """The cheapest of several rounds: nothing disturbed it."""
    spent = []
    for _ in range(rounds):
        begin = process_time()
        call()
        spent.append(1e3 * (process_time() - begin))
    return min(spent)


def _plan(world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    grid = find_map(world, FINE)
    options = CostmapOptions(inflation_radius=0.55, cost_scaling_factor=10.0)
    costmap = make_costmap(grid, make_circle(0.325), options)
    planner = AStarPlanner()
    ways = find_ways(costmap, _PAIRS, _LEAST)
    field = planner.prepare(costmap)
    search, smooth, lengths, costs, references = [], [], [], [], []
    for number, way in enumerate(ways, 1):
        progress("plan", number, len(ways))
        first, last = (costmap.frame.cell_at(pose.x, pose.y) for pose in (way.start, way.goal))
        cells = field.find_way(first, last)
        assert cells is not None
        found = cells
        corners = field.shorten(found)
        search.append(_least_ms(lambda a=first, b=last: (planner.prepare(costmap), field.find_way(a, b))))  # type: ignore[misc]
        smooth.append(_least_ms(lambda way=found: field.shorten(way)))  # type: ignore[misc]
        lengths.append(length_of(corners) / length_of(found))
        costs.append(cost_of(field, corners) / cost_of(field, found))
        references.append(reference_ms())
    both = np.array(search) + np.array(smooth)
    scene = f"{costmap.costs.size / 1e6:.2f} million cells, {_PAIRS} pairs over {_LEAST:g} m"
    detail = f"{scene}, max {max(search):.0f}; reference {np.median(references):.1f} ms"
    yield NavFigure("A* search, median", float(np.median(search)), "ms", 25.0, detail)
    yield NavFigure("A* search and any-angle way, median", float(np.median(both)), "ms", 45.0, f"max {both.max():.0f}")
    detail = f"max {max(lengths):.3f}"
    yield NavFigure("length, any-angle / octile ways, mean", float(np.mean(lengths)), "", 0.97, detail)
    yield NavFigure("cost, any-angle / octile ways, largest", max(costs), "", 1.0)


def _costmap(world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    progress("costmap", 1, 1)
    grid = find_map(world, FINE)
    options = CostmapOptions(inflation_radius=0.55, cost_scaling_factor=10.0)
    costmap = make_costmap(grid, make_circle(0.325), options)

    def anew() -> None:
        costmap.set_map(grid)
        costmap.update()

    detail = f"{costmap.costs.size / 1e6:.2f} million cells; reference {_least_ms(reference_ms):.1f} ms"
    yield NavFigure("costmap anew", _least_ms(anew), "ms", 90.0, detail)


def _amcl(world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    progress("amcl", 1, 1)
    grid = find_map(world, COARSE)
    costmap = costmap_of(grid, outline_of(make_robot(world, Pose2(0.0, 0.0, 0.0))))
    (start,) = find_starts(costmap, 1)
    localiser = Amcl(grid, AmclOptions(min_particles=2000, max_particles=2000))
    localiser.set_pose(start)
    spent = []
    for robot in wander(world, start, _AMCL_SECONDS, 1):
        scan, odom = scan_of(robot), robot.odom
        begin = process_time()
        if localiser.update(odom, scan):
            spent.append(1e3 * (process_time() - begin))
    most, reference = np.percentile(spent, 90), _least_ms(reference_ms)
    detail = f"{len(spent)} updates, 90 % below {most:.2f}; reference {reference:.1f} ms"
    yield NavFigure("AMCL update, 2000 particles x 60 beams, median", float(np.median(spent)), "ms", 0.8, detail)


def _anywhere(world: World, tours: int, progress: Progress) -> Iterator[NavFigure]:
    grid = find_map(world, COARSE)
    costmap = costmap_of(grid, outline_of(make_robot(world, Pose2(0.0, 0.0, 0.0))))
    starts = find_starts(costmap, max(1, tours * 2 // 3))
    times: list[float] = []
    for number, start in enumerate(starts, 1):
        progress("global", number, len(starts))
        localiser = Amcl(grid, seed=number)
        localiser.localize_globally()
        since, seconds = math.inf, world.interval / 1e9
        for tick, robot in enumerate(wander(world, start, _LOST_FOR, number)):
            localiser.update(robot.odom, scan_of(robot))
            seen = localiser.map_from_odom.compose(robot.odom)
            near = math.hypot(seen.x - robot.truth.x, seen.y - robot.truth.y) <= _FOUND
            since = min(since, tick * seconds) if near and not localiser.is_lost else math.inf
        times.append(since)
    found = [t for t in times if math.isfinite(t)]
    detail = f"{len(starts)} starts; the last one was found after {max(found, default=math.inf):.1f} s"
    yield NavFigure("found on the whole map within 60 s", len(found) / len(starts), "share", 0.9, detail)


ROWS: dict[str, Callable[[World, int, Progress], Iterator[NavFigure]]] = {
    "plan": _plan,
    "costmap": _costmap,
    "amcl": _amcl,
    "global": _anywhere,
}


def format_navigation(rows: Sequence[NavFigure]) -> str:
    """One row a figure."""
    header = ["figure", "measured", "required", "remark"]
    cells = [
        [row.what, f"{figure(row.value)} {row.unit}".strip(), "-" if row.must is None else f"{row.must:g}", row.detail]
        for row in rows
    ]
    return format_table(header, cells)
