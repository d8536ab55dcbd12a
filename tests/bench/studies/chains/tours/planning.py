"""How the tours of the study `robots` were planned; run it again to make their files anew.

`python -m studies.chains.tours.planning WORLD FILE` takes some minutes. The shortest way on a grid between random
places (Dijkstra), where a cell near a wall costs more; then it is smoothed and thinned out. A way is kept if it runs
indoors, starts straight, has turns, and comes near no wall.
"""

import heapq
import math
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.tours import LEAD_IN, Tour
from zteam.config.resources import find_world
from zteam.counter_random import uniform
from zteam.simulator.core.occupancy_grid import map_message
from zteam.world import World, load_world

Floats = NDArray[np.float64]
Cell = tuple[int, int]

COUNT = 30
LENGTHS = (25.0, 60.0)
"""Metres that the leader drives."""
CELL = 0.1
SPACE = 0.6
"""Metres to the next wall that a way keeps where it can."""
CLEARANCE = 0.35
"""Metres to the next wall that it keeps everywhere; an erratic's corner is 0.285 m from its base."""
INDOORS = 1.9
"""Metres: most of a way has a wall so near."""
WINDOW = 1.0
"""Metres over which a way is smoothed: its bends have a radius of about half of that."""
STRAIGHT = 6.0
"""Metres at the start without a turn of more than TURN: the team starts there."""
CHOICES = 50
"""Ends that are tried for one start."""
TURN = math.radians(30.0)
BENDS = 1.5 * math.pi
"""Radians of all turns together, at least."""
TOLERANCE = 0.002
"""Metres from the smooth way that the waypoints may be."""


def plan_tours(world: World, count: int = COUNT, seed: int = 1) -> list[Tour]:
    """Tours between random places; they depend only on the world and the seed."""
    message = map_message(world, CELL)
    occupied = message.data.reshape(message.info.height, message.info.width) > 0
    low = np.array([message.info.origin.position.x, message.info.origin.position.y])
    distance = distance_to_walls(occupied)
    cost = 1.0 + 4.0 * np.clip((SPACE - distance) / SPACE, 0.0, 1.0)
    cost[distance < CLEARANCE] = np.inf
    free = np.argwhere(np.isfinite(cost) & (distance < INDOORS))
    tours: list[Tour] = []
    for draw in range(10_000):
        if len(tours) == count:
            break
        start = tuple(free[int(uniform(seed, draw, 0, 0) * len(free))].tolist())
        wanted = LEAD_IN + LENGTHS[0] + (LENGTHS[1] - LENGTHS[0]) * uniform(seed, draw, 0, 1)
        before, ends = find_ways(cost, start, wanted / CELL)
        for choice in range(CHOICES if ends else 0):
            end = ends[int(uniform(seed, draw, 1, choice) * len(ends))]
            way = smooth(np.array(trace(before, end))[:, ::-1] * CELL + 0.5 * CELL + low)
            if is_good(way, distance, low):
                tours.append(Tour(tuple((round(float(x), 3), round(float(y), 3)) for x, y in thin_out(way))))
                break
    return tours


def distance_to_walls(occupied: NDArray[np.bool_], reach: int = round(2.0 / CELL)) -> Floats:
    """Metres from each cell's middle to the nearest occupied cell, at most `reach` cells; beyond the border is wall."""
    padded = np.pad(occupied, reach, constant_values=True)
    rows, columns = occupied.shape
    nearest = np.full(occupied.shape, float(reach))
    steps = [(dy, dx) for dy in range(-reach, reach + 1) for dx in range(-reach, reach + 1)]
    for dy, dx in steps:
        length = math.hypot(max(0.0, abs(dy) - 0.5), max(0.0, abs(dx) - 0.5))
        if length < reach:
            there = padded[reach + dy : reach + dy + rows, reach + dx : reach + dx + columns]
            nearest[there & (nearest > length)] = length
    return nearest * CELL


def find_ways(cost: Floats, start: Cell, cells: float) -> tuple[dict[Cell, Cell], list[Cell]]:
    """The cheapest ways to `start`, as each cell's next one, and the cells where they are so long (within 1 %)."""
    best, before, length = {start: 0.0}, {start: start}, {start: 0.0}
    done: set[Cell] = set()
    ends = []
    waiting = [(0.0, start)]
    while waiting:
        spent, cell = heapq.heappop(waiting)
        if cell in done:
            continue
        done.add(cell)
        if length[cell] >= cells:
            continue
        if length[cell] > 0.99 * cells:
            ends.append(cell)
        for neighbor, step in _neighbors(cost, cell):
            total = spent + step * float(cost[neighbor])
            if total < best.get(neighbor, math.inf):
                best[neighbor], before[neighbor] = total, cell
                length[neighbor] = length[cell] + step
                heapq.heappush(waiting, (total, neighbor))
    return before, ends


def trace(before: dict[Cell, Cell], end: Cell) -> list[Cell]:
    """The way from `end` on."""
    found = [end]
    while before[found[-1]] != found[-1]:
        found.append(before[found[-1]])
    return found


def _neighbors(cost: Floats, cell: Cell) -> Iterator[tuple[Cell, float]]:
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            other = (cell[0] + dy, cell[1] + dx)
            inside = 0 <= other[0] < cost.shape[0] and 0 <= other[1] < cost.shape[1]
            if other != cell and inside and cost[other] < math.inf:
                yield other, math.hypot(dy, dx)


def smooth(way: Floats) -> Floats:
    """The way as points 2 cm apart, each the mean of those around it, twice."""
    step = 0.02
    for _ in range(2):
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        even = np.arange(0.0, along[-1], step)
        points = np.stack([np.interp(even, along, way[:, axis]) for axis in (0, 1)], axis=1)
        half = round(0.5 * WINDOW / step)
        sums = np.concatenate([np.zeros((1, 2)), np.cumsum(points, axis=0)])
        index = np.arange(len(points))
        reach = np.minimum(half, np.minimum(index, len(points) - 1 - index))
        way = (sums[index + reach + 1] - sums[index - reach]) / (2 * reach + 1)[:, None]
    return way


def is_good(way: Floats, distance: Floats, low: Floats) -> bool:
    """Whether a way runs indoors, starts straight, has turns of three right angles together, and comes near no wall."""
    cells = ((way - low) / CELL).astype(int)
    beside = distance[cells[:, 1], cells[:, 0]]
    if beside.min() < CLEARANCE or np.quantile(beside, 0.8) > INDOORS:
        return False
    heading = np.unwrap(np.arctan2(*np.diff(way[::10], axis=0).T[::-1]))
    first = heading[: round(STRAIGHT / 0.2)]
    return bool(np.ptp(first) < TURN and np.abs(np.diff(heading)).sum() > BENDS)


def thin_out(way: Floats) -> Floats:
    """The fewest of the points whose straight connections are within TOLERANCE of all (Douglas and Peucker)."""
    if len(way) < 3:
        return way
    chord = way[-1] - way[0]
    length = math.hypot(*chord)
    offset = way - way[0]
    aside = np.abs(chord[0] * offset[:, 1] - chord[1] * offset[:, 0]) / length if length else np.hypot(*offset.T)
    farthest = int(aside.argmax())
    if aside[farthest] <= TOLERANCE:
        return way[[0, -1]]
    return np.concatenate([thin_out(way[: farthest + 1])[:-1], thin_out(way[farthest:])])


if __name__ == "__main__":
    Path(sys.argv[2]).write_bytes(msgspec.json.encode(plan_tours(load_world(find_world(sys.argv[1])))) + b"\n")
