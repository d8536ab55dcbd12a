"""A* on a grid: the compiled search, and the same on numpy.

Costs are whole numbers, so what a cell costs does not depend on the order in which cells are visited. The search goes
on until nothing is left that may be as cheap as the goal. So both ways find the same costs, and the path that is read
from them is the same.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.planning.jit import compiled, plainly

UNREACHED = 0xFFFFFFFF
"""Cost of a cell that the search has not met."""
_CELL, _COST, _NEXT = 0, 1, 2
"""Columns of the table of queued cells."""
_NONE = 0xFFFFFFFF
_ROOM = 1 << 14
"""Queued cells that fit at first."""
_BUCKETS = 1 << 10


class Steps(NamedTuple):
    """What steps cost."""

    straight: int
    """At weight 1."""
    diagonal: int
    least: int
    """The least weight of a cell that can be entered."""


Costs = NDArray[np.uint32]
"""Of the way from the start to each cell; flat, as `weights`."""
Weights = NDArray[np.uint8]
"""What a step into a cell costs as a multiple of the step's length, 0 for cells that cannot be entered; flat, and with
a border of zeros."""
Queue = NDArray[np.uint32]


@compiled
def _heuristic(x: int, y: int, goal_x: int, goal_y: int, straight: int, diagonal: int) -> int:
    """Octile distance: no way on the grid is cheaper. `straight` and `diagonal` are the cheapest steps."""
    dx, dy = abs(x - goal_x), abs(y - goal_y)
    return straight * (dx - dy) + diagonal * dy if dx > dy else straight * (dy - dx) + diagonal * dx


@compiled
def _grow(queue: Queue) -> Queue:
    larger = np.empty((2 * queue.shape[0], 3), np.uint32)
    larger[: queue.shape[0]] = queue
    return larger


def _search_numpy(
    weights: Weights, columns: int, start: int, goal: int, steps: Steps, shift: int, costs: Costs,
    box: NDArray[np.int64],
) -> bool:  # fmt: skip
    """A wave over whole buckets of cells. Wider buckets than the compiled search has do not change the result."""
    straight, diagonal, least = steps
    shift += 6
    goal_y, goal_x = divmod(goal, columns)
    moves = [
        (1, 0, straight), (-1, 0, straight), (0, 1, straight), (0, -1, straight),
        (1, 1, diagonal), (1, -1, diagonal), (-1, 1, diagonal), (-1, -1, diagonal),
    ]  # fmt: skip

    def bucket_of(cells: NDArray[np.int64]) -> NDArray[np.int64]:
        y, x = np.divmod(cells, columns)
        dx, dy = np.abs(x - goal_x), np.abs(y - goal_y)
        small, large = np.minimum(dx, dy), np.maximum(dx, dy)
        rest = least * (straight * (large - small) + diagonal * small)
        found: NDArray[np.int64] = (costs[cells].astype(np.int64) + rest) >> shift
        return found

    costs[start] = 0
    met = np.array([start])
    waiting: dict[int, list[NDArray[np.int64]]] = {int(bucket_of(met)[0]): [met]}
    reached = [met]
    while waiting:
        current = min(waiting)
        while current in waiting:
            cells = np.unique(np.concatenate(waiting.pop(current)))
            cells = cells[bucket_of(cells) == current]
            changed = []
            for dx, dy, step in moves:
                to = cells + (dy * columns + dx)
                free = weights[to] > 0
                if dx and dy:
                    free &= (weights[cells + dx] > 0) & (weights[cells + dy * columns] > 0)
                to = to[free]
                cost = costs[cells[free]] + (np.uint32(step) * weights[to])
                cheaper = cost < costs[to]
                costs[to[cheaper]] = cost[cheaper]
                changed.append(to[cheaper])
            found = np.unique(np.concatenate(changed))
            reached.append(found)
            buckets = bucket_of(found)
            for bucket in np.unique(buckets).tolist():
                waiting.setdefault(bucket, []).append(found[buckets == bucket])
        if costs[goal] != UNREACHED and int(costs[goal]) >> shift <= current:
            break
    y, x = np.divmod(np.concatenate(reached), columns)
    box[:] = y.min(), y.max(), x.min(), x.max()
    return bool(costs[goal] != UNREACHED)


@plainly(_search_numpy)
@compiled
def search(
    weights: Weights, columns: int, start: int, goal: int, steps: Steps, shift: int, costs: Costs,
    box: NDArray[np.int64],
) -> bool:  # fmt: skip
    """Find the cheapest way from `start` to `goal` (indexes of cells): its costs are written to `costs`.

    Return whether there is one. If not, all cells that can be reached have been. A diagonal step needs both cells
    beside it to be free. Cells whose cost plus heuristic have the same digits above `shift` are visited in no order;
    no step may raise that sum by 2^(`shift` + 10). `box` becomes the first and last row and column with costs.
    """
    straight, diagonal, least = steps
    least_straight, least_diagonal = straight * least, diagonal * least
    goal_y, goal_x = goal // columns, goal % columns
    move_to = np.array([1, -1, columns, -columns, columns + 1, columns - 1, 1 - columns, -1 - columns])
    move_x, move_y = np.array([1, -1, 0, 0, 1, -1, 1, -1]), np.array([0, 0, 1, -1, 1, 1, -1, -1])
    free = np.zeros(8, np.bool_)
    queue = np.empty((_ROOM, 3), np.uint32)
    heads = np.full(_BUCKETS, _NONE, np.uint32)
    used, spare, waiting = 1, np.uint32(_NONE), 1
    box[0], box[1], box[2], box[3] = start // columns, start // columns, start % columns, start % columns
    costs[start] = 0
    queue[0, _CELL], queue[0, _COST], queue[0, _NEXT] = start, 0, _NONE
    bucket = _heuristic(start % columns, start // columns, goal_x, goal_y, least_straight, least_diagonal) >> shift
    heads[bucket & (_BUCKETS - 1)] = 0
    while waiting > 0:
        entry = heads[bucket & (_BUCKETS - 1)]
        if entry == _NONE:
            if costs[goal] != UNREACHED and costs[goal] >> shift <= bucket:
                break
            bucket += 1
            continue
        heads[bucket & (_BUCKETS - 1)] = queue[entry, _NEXT]
        queue[entry, _NEXT] = spare
        spare = entry
        waiting -= 1
        cell, cost = np.int64(queue[entry, _CELL]), np.int64(queue[entry, _COST])
        if cost != costs[cell]:
            # It has been met on a cheaper way since.
            continue
        y = cell // columns
        x = cell - y * columns
        if y < box[0]:
            box[0] = y
        if y > box[1]:
            box[1] = y
        if x < box[2]:
            box[2] = x
        if x > box[3]:
            box[3] = x
        for k in range(8):
            to = cell + move_to[k]
            weight = np.int64(weights[to])
            if k < 4:
                free[k] = weight > 0
                length = straight
            else:
                if not (free[(k & 1)] and free[2 + ((k - 4) >> 1)]):
                    continue
                length = diagonal
            if weight == 0:
                continue
            new = cost + length * weight
            if new >= costs[to]:
                continue
            costs[to] = new
            total = new + _heuristic(x + move_x[k], y + move_y[k], goal_x, goal_y, least_straight, least_diagonal)
            place = (total >> shift) & (_BUCKETS - 1)
            if spare != _NONE:
                entry = spare
                spare = queue[entry, _NEXT]
            else:
                if used == queue.shape[0]:
                    queue = _grow(queue)
                entry = np.uint32(used)
                used += 1
            queue[entry, _CELL], queue[entry, _COST], queue[entry, _NEXT] = to, new, heads[place]
            heads[place] = entry
            waiting += 1
    # The neighbours of what was visited have costs too.
    box[0] -= 1
    box[1] += 1
    box[2] -= 1
    box[3] += 1
    return bool(costs[goal] != UNREACHED)


@compiled
def trace(
    weights: Weights, columns: int, start: int, goal: int, steps: Steps, costs: Costs,
    out: NDArray[np.int64],
) -> int:  # fmt: skip
    """Write the cells of the way that `search` has found, from the goal back to the start; return how many they are,
    or 0 if `out` has too little room."""
    straight, diagonal, _ = steps
    cell, count = goal, 0
    while True:
        if count == out.shape[0]:
            return 0
        out[count] = cell
        count += 1
        if cell == start:
            return count
        weight, cost = np.int64(weights[cell]), np.int64(costs[cell])
        before = -1
        # Always the same one of several ways that cost the same.
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                step = diagonal if dx != 0 and dy != 0 else straight
                other = cell + dy * columns + dx
                if (dx == 0 and dy == 0) or np.int64(costs[other]) + step * weight != cost or weights[other] == 0:
                    continue
                if dx != 0 and dy != 0 and (weights[cell + dx] == 0 or weights[cell + dy * columns] == 0):
                    continue
                before = other
        cell = before
