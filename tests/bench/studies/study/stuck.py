"""Which robots got stuck, by their true poses: one that stays in its place although there is a way to leave it."""

import math
from collections import deque
from collections.abc import Collection, Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.tracks import dense_outline, place_outline
from zteam.geometry import Pose2
from zteam.simulator.core.occupancy_grid import map_message
from zteam.simulator.world.model import footprint
from zteam.world import World, add_robot

STAYS, STAYS_FOR = 0.5, 30.0
"""Metres and seconds: a robot that does not come so far away in so long stays."""
HEAD_STAYS, HEAD_STAYS_FOR = 2.0, 60.0
"""The same of the robot that leads a line."""
AWAY = 2.0
"""Metres: there is a way out if it leads so far from where the robot began to stay."""
_EVERY = 5.0
"""Seconds between two looks."""
_CELL, _HEADINGS = 0.05, 16
"""Metres and number: the states of the search."""
_STEPS = [(round(2 * math.cos(h * math.tau / 16)), round(2 * math.sin(h * math.tau / 16))) for h in range(_HEADINGS)]
"""Cells, by heading: one step forward."""
_LOOSE = 2
"""Cells and headings about the start that it may be in whatever stands there: the map is that exact."""


class Stand(msgspec.Struct, frozen=True):
    """A robot that got stuck."""

    robot: int
    begin: float
    """Seconds."""
    seconds: float


class Floor:
    """What stands still in a world, and the robots' shape."""

    def __init__(self, world: World) -> None:
        robot = add_robot(world, "erratic", Pose2(0.0, 0.0, 0.0), "bench")
        outline = dense_outline(footprint(robot))
        message = map_message(world, _CELL)
        self.walls = message.data.reshape(message.info.height, message.info.width) > 0
        self.low = np.array([message.info.origin.position.x, message.info.origin.position.y])
        self.middle = outline.mean(axis=0)
        self.radius = float(np.hypot(*(outline - self.middle).T).max())
        """Of the disc about its middle that stands for another robot."""
        self.cells = []
        """By heading: the cells that the robot covers, from the cell of its pose."""
        for heading in range(_HEADINGS):
            pose = np.array([0.0, 0.0, heading * math.tau / _HEADINGS])
            placed = [
                place_outline(pose, self.middle + share * (outline - self.middle)) for share in (1.0, 0.75, 0.5, 0.25)
            ]
            self.cells.append(np.unique(np.round(np.concatenate(placed) / _CELL).astype(int), axis=0))

    def has_way(self, pose: NDArray[np.float64], others: NDArray[np.float64], begin: NDArray[np.float64]) -> bool:
        """Whether a robot at `pose` (x, y, yaw) can drive to a place AWAY from `begin`, while `others` (n, 3) stay."""
        aside = np.round((begin[:2] - pose[:2]) / _CELL).astype(int).tolist()
        reach = math.ceil((AWAY + 0.5) / _CELL) + max(map(abs, aside))
        at = np.floor((pose[:2] - self.low) / _CELL).astype(int)
        size = 2 * reach + 1
        columns, rows = (np.arange(size) + at[axis] - reach for axis in (0, 1))
        inside = ((rows >= 0) & (rows < self.walls.shape[0]))[:, None] & (
            (columns >= 0) & (columns < self.walls.shape[1])
        )
        taken = ~inside
        taken[inside] = self.walls[
            np.ix_(rows.clip(0, self.walls.shape[0] - 1), columns.clip(0, self.walls.shape[1] - 1))
        ][inside]
        x, y = self.low[0] + (columns + 0.5) * _CELL, self.low[1] + (rows + 0.5) * _CELL
        for other in others:
            cos, sin = math.cos(other[2]), math.sin(other[2])
            middle = (
                other[0] + cos * self.middle[0] - sin * self.middle[1],
                other[1] + sin * self.middle[0] + cos * self.middle[1],
            )
            taken |= (x[None] - middle[0]) ** 2 + (y[:, None] - middle[1]) ** 2 < self.radius**2
        blocked = np.ones((_HEADINGS, size, size), bool)
        edge = max(int(np.abs(cells).max()) for cells in self.cells)
        for heading, cells in enumerate(self.cells):
            core = np.zeros((size - 2 * edge, size - 2 * edge), bool)
            for dx, dy in cells:
                core |= taken[edge + dy : size - edge + dy, edge + dx : size - edge + dx]
            blocked[heading, edge : size - edge, edge : size - edge] = core
        first = round(pose[2] / (math.tau / _HEADINGS)) % _HEADINGS
        near = slice(reach - _LOOSE, reach + _LOOSE + 1)
        for turn in range(-_LOOSE, _LOOSE + 1):
            blocked[(first + turn) % _HEADINGS, near, near] = False
        return _leads_away(blocked, (first, reach, reach), (reach + aside[1], reach + aside[0]))


def _leads_away(blocked: NDArray[np.bool_], start: tuple[int, int, int], begin: tuple[int, int]) -> bool:
    """Whether a state AWAY from the cell `begin` can be reached by turns on the spot and straight steps both ways."""
    size, far = blocked.shape[1], (AWAY / _CELL) ** 2
    rows = blocked.tolist()
    seen, queue = {start}, deque([start])
    while queue:
        heading, row, column = queue.popleft()
        if (row - begin[0]) ** 2 + (column - begin[1]) ** 2 >= far:
            return True
        dx, dy = _STEPS[heading]
        for state in (
            ((heading + 1) % _HEADINGS, row, column),
            ((heading - 1) % _HEADINGS, row, column),
            (heading, row + dy, column + dx),
            (heading, row - dy, column - dx),
        ):
            if (
                state not in seen
                and 0 <= state[1] < size
                and 0 <= state[2] < size
                and not rows[state[0]][state[1]][state[2]]
            ):
                seen.add(state)
                queue.append(state)
    return False


def find_stuck(
    floor: Floor,
    poses: NDArray[np.float64],
    tick: float,
    followed: Sequence[Mapping[int, int]],
    waits: Sequence[Mapping[int, int]],
    *,
    is_line: bool,
) -> list[Stand]:
    """Robots that got stuck, each time once. `poses` are (ticks, robots, 3) in map, a tick is so many seconds.

    `followed` and `waits`: by tick, which robot each one follows, and for which one it waits (-1 for none).
    """
    robots, every = range(poses.shape[1]), round(_EVERY / tick)
    leads = np.array([[is_line and follows.get(robot, -1) < 0 for robot in robots] for follows in followed])
    anchors = [
        (find_anchors(poses, STAYS, np.ones_like(leads)), STAYS_FOR),
        (find_anchors(poses, HEAD_STAYS, leads), HEAD_STAYS_FOR),
    ]
    found: list[Stand] = []
    since: dict[int, float] = {}
    for end in range(every, len(poses), every):
        begins: dict[int, int] = {}
        for robot in robots:
            stays = [int(begin[end, robot]) for begin, least in anchors if (end - begin[end, robot]) * tick >= least]
            if stays:
                begins[robot] = min(stays)
        stuck = {
            robot
            for robot, begin in begins.items()
            if not _waits_for_one_that_moves(robot, waits[end], begins.keys())
            and floor.has_way(poses[end, robot], np.delete(poses[end], robot, axis=0), poses[begin, robot])
        }
        for robot in sorted(since.keys() - stuck):
            from_on = since.pop(robot)
            found.append(Stand(robot, round(from_on, 1), round(end * tick - from_on, 1)))
        for robot in stuck - since.keys():
            since[robot] = begins[robot] * tick
    return found + [
        Stand(robot, round(begin, 1), round(len(poses) * tick - begin, 1)) for robot, begin in sorted(since.items())
    ]


def find_anchors(places: NDArray[np.float64], metres: float, counts: NDArray[np.bool_]) -> NDArray[np.intp]:
    """(ticks, robots): the tick since which a robot is not so far from where it was then, or since when it `counts`."""
    found, places = np.zeros(places.shape[:2], np.intp), places[..., :2]
    robots = np.arange(places.shape[1])
    for tick in range(1, len(places)):
        away = np.hypot(*(places[tick] - places[found[tick - 1], robots]).T)
        found[tick] = np.where((away > metres) | ~counts[tick], tick, found[tick - 1])
    return found


def _waits_for_one_that_moves(robot: int, waits: Mapping[int, int], staying: Collection[int]) -> bool:
    """Whether a robot waits, directly or through others, for a robot that does not stay: it is not stuck then."""
    seen = {robot}
    other = waits.get(robot, -1)
    while other >= 0 and other not in seen:
        if other not in staying:
            return True
        seen.add(other)
        other = waits.get(other, -1)
    return False
