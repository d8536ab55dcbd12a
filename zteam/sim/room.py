"""Whether there is room for a robot at a place: within the world, and outside of everything that collides."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.sim.fields import Fields
from zteam.sim.grids import make_grids
from zteam.sim.occupancy_grid import find_bounds
from zteam.sim.overlaps import NOTHING, convex_solids, corner_room, find_overlap
from zteam.sim.polygons import group_shapes, make_outlines, move_outlines
from zteam.world.model import Floorplan, Robot, World


def find_refusal(
    world: World,
    floorplans: Sequence[tuple[Floorplan, Fields]],
    robots: Mapping[int, Robot],
    poses: NDArray[np.float64],
    robot_id: int,
    robot: Robot,
    pose: Pose2,
) -> str | None:
    """Why `robot`, by the name of `robot_id`, has no room at `pose` (in `map`); None if it has.

    `poses` (movers, 3) are those of all `robots`, in their order, and of what can be pushed. A robot of the same id
    counts as gone. Touching is allowed.
    """
    outside = _outside(world, pose)
    if outside:
        return outside
    ids = [other for other in robots if other != robot_id]
    kept = [row for row, other in enumerate(robots) if other != robot_id]
    moved = np.vstack((poses[kept], [pose], poses[len(robots) :]))
    groups = group_shapes([*(robots[other] for other in ids), robot], world.obstacles)
    groups = [group._replace(shapes=convex_solids(group.shapes)) for group in groups]
    groups = [group for group in groups if group.shapes]
    mine = [number for number, group in enumerate(groups) if group.owner == len(ids)]
    if not mine:
        return None
    outlines = make_outlines(groups)
    move_outlines(outlines, moved)
    px, py = np.empty((2, corner_room(outlines)))
    found = find_overlap(outlines, mine[0], make_grids(floorplans), 0.0, np.zeros(len(moved), bool), px, py)
    if found == NOTHING:
        return None
    if found < NOTHING:
        solid = [plan.name for plan, _ in floorplans if plan.obstacle]
        return f"it would stand in a wall of {solid[-2 - found]!r}"
    source = groups[found].source
    if source < len(ids):
        return f"it would stand in robot {ids[source]}"
    return f"it would stand in {world.obstacles[source - len(ids) - 1].name!r}"


def _outside(world: World, pose: Pose2) -> str | None:
    """A world whose robots start in the open, beyond the box about all that stands still, has no outside."""
    bounds = find_bounds(world)
    if bounds is None:
        return None
    low, high = bounds
    starts = np.array([robot.pose[:2] for robot in world.robots], float).reshape(-1, 2)
    if ((starts < low) | (starts > high)).any() or bool(((low <= pose[:2]) & (pose[:2] <= high)).all()):
        return None
    return (
        f"it would stand outside of the world, which reaches from x {low[0]:g}, y {low[1]:g} "
        f"to x {high[0]:g}, y {high[1]:g}"
    )
