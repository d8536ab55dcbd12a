"""What the true poses of a chain of robots say: how far from the leader's path, how far apart, and what was hit."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.recorder import Tracks
from zteam.simulator.core.occupancy_grid import map_message
from zteam.world import World

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

TOUCH = 0.02
"""Metres: a robot has hit a wall or a robot when its outline is so near; also the error of the maps used for that."""
_STEP = 0.02
"""Metres between the points of a path, and of an outline."""
_BACK, _AHEAD = 0.5, 1.5
"""Metres of the path around a robot's last place in which its next one is sought."""
_MOVED, _ARRIVED = 0.01, 0.4
"""Metres from its first place, and from the end of its path, where a leader has begun and has arrived."""


class Samples(msgspec.Struct):
    """One run of a chain. Every list is by robot behind the leader, and its samples are those of all ticks from the
    leader's first move to its arrival; metres."""

    deviations: list[list[float]]
    """From the leader's path; only where the leader itself drove, not where the team stood at the start."""
    gaps: list[list[float]]
    """Arc length along the leader's path to the robot before."""
    arrived: bool
    """Whether the leader came to the end, and each robot to its place behind it at last."""
    wall_hits: int
    """Robots that came as near as TOUCH to a wall, or were blocked."""
    touches: int
    """Pairs of robots that came as near as TOUCH to each other."""
    seconds: float
    """Simulated seconds of the samples."""


def take_samples(tracks: Tracks, lead_in: Floats, end: Floats, gap: float, walls: "Walls", tick: float) -> Samples:
    """The samples of a chain whose robots are `gap` apart.

    `lead_in` (points, 2) is the way behind the leader's start, on which the others stand; `end` the end of its tour.
    """
    leader = tracks.poses[:, 0, :2]
    moved = np.flatnonzero(np.hypot(*(leader - leader[0]).T) > _MOVED)
    near = np.flatnonzero(np.hypot(*(leader - end).T) < _ARRIVED)
    begin = int(moved[0]) if len(moved) else len(leader) - 1
    final = int(near[0]) + 1 if len(near) else len(leader)
    path = resample(np.concatenate([lead_in, leader]))
    start = _length(lead_in) if len(lead_in) > 1 else 0.0
    places, asides = [], []
    for robot in range(tracks.poses.shape[1]):
        place, aside = follow_path(path, tracks.poses[:, robot, :2], start - gap * robot)
        places.append(place)
        asides.append(aside)
    followers = range(1, len(places))
    goal = _length(path)
    return Samples(
        deviations=[asides[i][begin:final][places[i][begin:final] > start].tolist() for i in followers],
        gaps=[(places[i - 1] - places[i])[begin:final].tolist() for i in followers],
        arrived=bool(len(near)) and all(abs(goal - gap * i - places[i][-1]) < _ARRIVED for i in followers),
        wall_hits=int((walls.touched(tracks.poses) | tracks.stalled).any(axis=0).sum()),
        touches=count_touches(tracks.poses, walls.outline),
        seconds=(final - begin) * tick,
    )


def resample(points: Floats) -> Floats:
    """The same path with points _STEP apart. A robot that stands adds nothing to it."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.concatenate([[True], steps > 1e-4])]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    even = np.arange(0.0, along[-1] + 1e-9, _STEP)
    return np.stack([np.interp(even, along, points[:, axis]) for axis in (0, 1)], axis=1)


def _length(path: Floats) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def follow_path(path: Floats, track: Floats, place: float) -> tuple[Floats, Floats]:
    """The place on `path` (arc length) and the distance from it, for each point of a robot's way that began at `place`.

    The place is sought around the last one: where a path crosses itself, a robot does not jump.
    """
    places, asides = np.empty(len(track)), np.empty(len(track))
    for i, point in enumerate(track):
        low = max(0, min(int((place - _BACK) / _STEP), len(path) - 2))
        piece = path[low : int((place + _AHEAD) / _STEP) + 2]
        away = point - piece[:-1]
        edge = np.diff(piece, axis=0)
        share = np.clip((away * edge).sum(axis=1) / (edge * edge).sum(axis=1), 0.0, 1.0)
        distance = np.hypot(*(away - share[:, None] * edge).T)
        nearest = int(distance.argmin())
        place = (low + nearest + float(share[nearest])) * _STEP
        places[i], asides[i] = place, distance[nearest]
    return places, asides


class Walls:
    """Everything that stands still in a world, as a fine grid, and the outline of a robot that may touch it."""

    def __init__(self, world: World, outline: Sequence[tuple[float, float]]) -> None:
        self.outline = dense_outline(outline)
        message = map_message(world, TOUCH)
        self._occupied = message.data.reshape(message.info.height, message.info.width) > 0
        self._low = np.array([message.info.origin.position.x, message.info.origin.position.y])

    def touched(self, poses: Floats) -> Bools:
        """(ticks, robots): whether the outline, TOUCH wider, meets a wall."""
        found = np.zeros(poses.shape[:2], bool)
        points = place_outline(poses, self.outline)
        for aside in np.array([(-TOUCH, 0.0), (TOUCH, 0.0), (0.0, -TOUCH), (0.0, TOUCH)]):
            found |= self.are_walls(points + aside).any(axis=2)
        return found

    def are_walls(self, points: Floats) -> Bools:
        """Whether these points (…, 2) lie in a wall. Beyond the map nothing stands."""
        cells = np.floor((points - self._low) / TOUCH).astype(int)
        rows, columns = self._occupied.shape
        inside = (cells >= 0).all(axis=-1) & (cells[..., 0] < columns) & (cells[..., 1] < rows)
        cells = np.where(inside[..., None], cells, 0)
        walls: Bools = self._occupied[cells[..., 1], cells[..., 0]] & inside
        return walls


def dense_outline(corners: Sequence[tuple[float, float]]) -> Floats:
    """Points _STEP apart around an outline."""
    closed = np.array([*corners, corners[0]], float)
    return resample(closed)


def place_outline(poses: Floats, outline: Floats) -> Floats:
    """(…, points, 2): the outline at each of the poses (…, 3)."""
    cos, sin = np.cos(poses[..., 2, None]), np.sin(poses[..., 2, None])
    x, y = outline.T
    return np.stack([poses[..., 0, None] + cos * x - sin * y, poses[..., 1, None] + sin * x + cos * y], axis=-1)


def count_touches(poses: Floats, outline: Floats) -> int:
    """Pairs of robots whose outlines came as near as TOUCH to each other, in any tick."""
    robots, reach = poses.shape[1], 2.0 * float(np.hypot(*outline.T).max()) + TOUCH
    return sum(_touch(poses[:, a], poses[:, b], outline, reach) for a in range(robots) for b in range(a + 1, robots))


def _touch(a: Floats, b: Floats, outline: Floats, reach: float) -> bool:
    near = np.flatnonzero(np.hypot(*(a[:, :2] - b[:, :2]).T) <= reach)
    for tick in near:
        between = place_outline(a[tick], outline)[:, None] - place_outline(b[tick], outline)[None]
        if math.sqrt(float((between**2).sum(axis=-1).min())) <= TOUCH + 0.5 * _STEP:
            return True
    return False
