"""Narrow places that a seed draws: corridors, mazes, spirals and rooms, and a team that stands in one."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from PIL import Image

from zteam.config.toml_values import toml_text
from zteam.counter_random import uniform
from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline

CELL = 0.05
"""Metres: side of a cell of the bitmaps."""
GAP = 0.8
"""Metres between two robots at the start, where a room does not need less."""
_EDGE = 0.2
"""Metres of wall around everything."""
_WORLD = """name "narrow"
interval_sim 100
define scanner ranger ( size [0.05 0.05 0.1] sensor ( range [0 30] fov 270.25 samples 1081 ) )
define erratic position
(
  size [0.35 0.35 0.25]
  origin [-0.05 0 0 0]
  drive "diff"
  scanner ( pose [0.05 0 -0.1 0] )
)
model ( name "walls" bitmap "walls.png" size [{width:.2f} {height:.2f} 0.8] pose [{x:.2f} {y:.2f} 0 0] )
"""

Point = tuple[float, float]
Draw = Callable[..., float]
"""A number in [0, 1) of some whole numbers."""


class Place(NamedTuple):
    """What was drawn."""

    halls: list[tuple[Point, Point]]
    """Opposite corners of the rectangles that are free, metres in map."""
    way: list[Point]
    """The robots stand on it in a line, the last one at its begin."""
    gap: float = GAP


def _along(points: Sequence[Point], width: float) -> list[tuple[Point, Point]]:
    """The rectangles of a corridor along an axis-parallel way."""
    half = 0.5 * width
    return [
        ((min(a[0], b[0]) - half, min(a[1], b[1]) - half), (max(a[0], b[0]) + half, max(a[1], b[1]) + half))
        for a, b in pairwise(points)
    ]


def _legs(lengths: Sequence[float], turns: Sequence[int]) -> list[Point]:
    """A way of straight legs; `turns` are the quarter turns to the left before each one."""
    x, y, heading, points = 0.0, 0.0, 0, [(0.0, 0.0)]
    for length, turn in zip(lengths, turns, strict=True):
        heading += turn
        x, y = x + length * round(math.cos(heading * math.pi / 2)), y + length * round(math.sin(heading * math.pi / 2))
        points.append((x, y))
    return points


def _corridor(draw: Draw, count: int) -> Place:
    """Up to four legs, 0.9 to 1.4 m wide, closed at both ends; the head looks to either of them."""
    legs, width = 1 + int(4 * draw(1)), 0.9 + 0.5 * draw(2)
    lengths = [(GAP * count + 4.0 if leg == 0 else 4.0) + 6.0 * draw(3, leg) for leg in range(legs)]
    side = 1 if draw(4) < 0.5 else -1
    # It goes off to one side and back to the first direction, so it never meets itself.
    points = _legs(lengths, [0, *(side if leg % 2 else -side for leg in range(1, legs))])
    way = points if draw(5) < 0.5 else _back(points, 0.4 + GAP * count)
    return Place(_along(points, width), way)


def _spiral(draw: Draw, count: int) -> Place:
    """A spiral, 1.0 to 1.4 m wide; the head looks inwards or outwards."""
    width = 1.0 + 0.4 * draw(1)
    legs = 10 + count // 4
    points = _legs([(leg // 2 + 1) * (width + 0.2) for leg in range(legs)], [1] * legs)
    return Place(_along(points, width), points if draw(2) < 0.5 else points[::-1])


_MAZE = 8


def _maze(draw: Draw, count: int) -> Place:
    """A maze of 0.9 to 1.2 m with a few loops; in a third of the draws the head begins in a dead end."""
    pitch = 1.1 + 0.3 * draw(1)
    cells = [(i, j) for i in range(_MAZE) for j in range(_MAZE)]
    doors: dict[tuple[int, int], list[tuple[int, int]]] = {cell: [] for cell in cells}
    seen, stack, step = {cells[0]}, [cells[0]], 0
    while stack:
        step += 1
        open_to = [cell for cell in _beside(stack[-1]) if cell in doors and cell not in seen]
        if not open_to:
            stack.pop()
            continue
        chosen = open_to[int(len(open_to) * draw(2, step))]
        doors[stack[-1]].append(chosen)
        doors[chosen].append(stack[-1])
        seen.add(chosen)
        stack.append(chosen)
    for number, cell in enumerate(cells):
        for other in _beside(cell)[:2]:
            if other in doors and other not in doors[cell] and draw(3, number) < 0.05:
                doors[cell].append(other)
                doors[other].append(cell)
    ends = [cell for cell in cells if len(doors[cell]) == 1]
    begin = ends[int(len(ends) * draw(4))]
    before = {begin: begin}
    for cell in (queue := [begin]):
        for other in doors[cell]:
            if other not in before:
                before[other] = cell
                queue.append(other)
    path = [queue[-1]]
    while path[-1] != begin:
        path.append(before[path[-1]])
    way = [(i * pitch, j * pitch) for i, j in reversed(path)]
    if draw(5) >= 2.0 / 3.0:
        way = _back(way, GAP * count)
    halls = [
        hall
        for cell in cells
        for other in doors[cell]
        for hall in _along([_at(cell, pitch), _at(other, pitch)], pitch - 0.2)
    ]
    return Place(halls, way)


def _at(cell: tuple[int, int], pitch: float) -> Point:
    return cell[0] * pitch, cell[1] * pitch


def _beside(cell: tuple[int, int]) -> list[tuple[int, int]]:
    i, j = cell
    return [(i + 1, j), (i, j + 1), (i - 1, j), (i, j - 1)]


def _back(points: Sequence[Point], length: float) -> list[Point]:
    """The first so many metres of a way, the other way round: the head looks to where it begins."""
    kept, along = [points[0]], 0.0
    for a, b in pairwise(points):
        along += math.dist(a, b)
        if along >= length:
            break
        kept.append(b)
    return [Polyline(points).at(length)[:2], *reversed(kept)]


def _rooms(draw: Draw, count: int) -> Place:
    """One room of 3 to 5 m, or 2 × 2 or 3 × 2 of them with doors of 0.8 to 1 m; the team begins in one."""
    width, depth = 3.0 + 2.0 * draw(1), 3.0 + 2.0 * draw(2)
    gaps = (GAP, 0.7, 0.62)

    def rows_of(gap: float) -> tuple[int, int]:
        return int((width - 0.9) / gap + 1e-9) + 1, int((depth - 0.9) / gap + 1e-9) + 1

    while math.prod(rows_of(gaps[-1])) < count:
        width, depth = width + 0.25, depth + 0.25
    gap = next(gap for gap in gaps if math.prod(rows_of(gap)) >= count)
    columns, rows = (1, 1) if draw(3) < 0.5 else (2 + int(2 * draw(4)), 2)
    halls = [
        ((i * (width + 0.2), j * (depth + 0.2)), (i * (width + 0.2) + width, j * (depth + 0.2) + depth))
        for i in range(columns)
        for j in range(rows)
    ]
    for number, ((x, y), (right, top)) in enumerate(halls):
        door = 0.8 + 0.2 * draw(5, number)
        at_x, at_y = (0.5 + (side - 1.0 - door) * draw(6, number, axis) for axis, side in enumerate((width, depth)))
        if right < columns * (width + 0.2) - 0.3:
            halls = [*halls, ((right - CELL, y + at_y), (right + 0.2 + CELL, y + at_y + door))]
        if top < rows * (depth + 0.2) - 0.3:
            halls = [*halls, ((x + at_x, top - CELL), (x + at_x + door, top + 0.2 + CELL))]
    in_row = rows_of(gap)[0]
    way: list[Point] = []
    for row in range(math.ceil(count / in_row)):
        y, ends = 0.45 + gap * row, (0.45, 0.45 + gap * (in_row - 1))
        way += [(x, y) for x in (ends if row % 2 == 0 else ends[::-1])]
    return Place(halls, way if draw(7) < 0.5 else _back(way, gap * (count - 1) + 0.01), gap)


KINDS: dict[str, Callable[[Draw, int], Place]] = {
    "corridor": _corridor,
    "maze": _maze,
    "spiral": _spiral,
    "rooms": _rooms,
}


def draw_place(kind: str, seed: int, count: int) -> tuple[np.ndarray, Point, list[Pose2]]:
    """Which cells are free (rows from below), the lower left corner of them, and where so many robots stand."""
    number = list(KINDS).index(kind)
    place = KINDS[kind](lambda *what: uniform(seed, 49, number, *what), count)
    low = [min(hall[0][axis] for hall in place.halls) - _EDGE for axis in (0, 1)]
    high = [max(hall[1][axis] for hall in place.halls) + _EDGE for axis in (0, 1)]
    free = np.zeros([math.ceil((high[axis] - low[axis]) / CELL) for axis in (1, 0)], bool)
    for hall in place.halls:
        (left, lower), (right, upper) = (
            [round((corner[axis] - low[axis]) / CELL) for axis in (0, 1)] for corner in hall
        )
        free[lower:upper, left:right] = True
    way = Polyline(place.way)
    length = sum(math.dist(a, b) for a, b in pairwise(place.way))
    head = min(length, place.gap * (count - 1) + 0.01)
    return free, (low[0], low[1]), [Pose2(*way.at(max(0.0, head - place.gap * i))) for i in range(count)]


HEAD_ROOM, ASIDE = 2.0, 0.45
"""Metres that the head of a line that goes round a room needs before its last robot, and beside the wall."""


def why_too_small(kind: str, seed: int, count: int) -> str:
    """Why a line of so many robots cannot go round in what a seed draws; empty where it can, or need not."""
    place = KINDS[kind](lambda *what: uniform(seed, 49, list(KINDS).index(kind), *what), count)
    if kind != "rooms" or len(place.halls) > 1:
        return ""
    (left, lower), (right, upper) = place.halls[0]
    way, needs = 2.0 * (right - left + upper - lower - 4.0 * ASIDE), GAP * (count - 1) + HEAD_ROOM
    if way >= needs:
        return ""
    size = f"{right - left:.1f} x {upper - lower:.1f} m"
    return f"the way along the walls of a room of {size} is {way:.1f} m, a line of {count} needs {needs:.1f} m"


class Narrow(msgspec.Struct, frozen=True):
    """A case of the study `lines` in a drawn narrow place."""

    kind: str
    robots: int
    shape: str = ""
    """Of a formation behind a robot that wanders; without it the robots are a line."""
    team: str = ""
    speed: float | None = None
    is_driven: bool = False

    def write(self, folder: Path, seed: int) -> Path:
        """Write its world and its team file; the latter's path."""
        free, (x, y), starts = draw_place(self.kind, seed, self.robots)
        Image.fromarray(np.where(free[::-1], 255, 0).astype(np.uint8)).save(folder / "walls.png")
        rows, columns = free.shape
        width, height = columns * CELL, rows * CELL
        text = _WORLD.format(width=width, height=height, x=x + 0.5 * width, y=y + 0.5 * height)
        (folder / "narrow.world").write_text(text)
        lines = ["[team]", 'world = "narrow.world"']
        for i, pose in enumerate(starts):
            entries = {"id": i, "model": "erratic", "pose": [round(value, 3) for value in pose]}
            if i == 0:
                entries |= {"behavior": "wander", "speed": 0.4}
            elif self.shape:
                entries |= {"behavior": "formation", "leader": 0, "shape": self.shape}
            else:
                entries |= {"follow": i - 1}
            lines += ["[[robots]]", *(f"{key} = {toml_text(value)}" for key, value in entries.items())]
        path = folder / "team.toml"
        path.write_text("\n".join(lines) + "\n")
        return path


SHAPES = "line", "column", "wedge", "diamond", "circle"
NARROW = {f"{kind}-{count}": Narrow(kind, count) for kind in KINDS for count in (4, 8, 12)} | {
    f"{kind}-{shape}": Narrow(kind, 5, shape) for kind in KINDS for shape in SHAPES
}
"""By name: a line of so many robots, or a formation of five in this shape."""
