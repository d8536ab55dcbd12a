"""Fiducial finders, bumpers and blob finders: what they notice, by casting rays of their own."""

import math
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, compose2, normalize_angle
from zteam.sim.casting import Beams, Caster, Rays
from zteam.sim.lasers import Mounts, mount_devices, rays_of
from zteam.sim.polygons import NOBODY
from zteam.world.model import Blobfinder, Bumper, Finder, Marker, Obstacle, Robot

Floats = NDArray[np.float64]

_TOUCH = 0.02
"""A bumper is pressed by what is this near: Stage's raster."""
_BEHIND = 0.02
"""Metres behind its line where a bumper's rays start, so that what has been pressed in still counts."""
_SPACING = 0.02
"""Metres between a bumper's rays."""


class Sighting(NamedTuple):
    """A marker that a fiducial finder sees."""

    id: int
    """0 where it is too far to be read."""
    range: float
    """Metres from the finder to the marked model's origin."""
    bearing: float
    """Radians in the finder's frame."""
    orientation: float
    """Heading of the marked model in the finder's frame."""


class Blob(NamedTuple):
    """Neighbouring pixels of one colour."""

    color: str
    bearing: float
    """Of its middle: radians in the blob finder's frame."""
    width: float
    """Radians."""
    range: float
    """Metres to its nearest point."""


class Detections(NamedTuple):
    """What the devices of one robot notice, each in file order."""

    sightings: tuple[tuple[Sighting, ...], ...] = ()
    bumpers: tuple[bool, ...] = ()
    blobs: tuple[tuple[Blob, ...], ...] = ()


class _Target(NamedTuple):
    """A marker and the model that bears it."""

    marker: Marker
    source: int
    """As in `zteam.sim.polygons.Group`; so is the mover."""
    mover: int
    fixed: Pose2
    """Where the model stands if nobody moves it."""

    def place(self, poses: Floats) -> Pose2:
        """In `map`."""
        model = self.fixed if self.mover == NOBODY else Pose2(*poses[self.mover].tolist())
        return compose2(model, Pose2(self.marker.x, self.marker.y, self.marker.yaw))


def _targets(robots: Sequence[Robot], obstacles: Sequence[Obstacle]) -> list[_Target]:
    found = [_Target(marker, i, i, robot.pose) for i, robot in enumerate(robots) for marker in robot.markers]
    movers = len(robots)
    for source, obstacle in enumerate(obstacles, len(robots)):
        mover = NOBODY
        if obstacle.mass is not None:
            mover, movers = movers, movers + 1
        found += [_Target(marker, source, mover, obstacle.pose) for marker in obstacle.markers]
    return found


def _ahead(limit: float) -> Beams:
    """A single ray straight ahead."""
    return Beams(np.ones((1, 1)), np.zeros((1, 1)), 0.0, 0.0, limit)


def _bumper_rays(owner: int, bumper: Bumper) -> Mounts:
    """Rays outward along a bumper."""
    count = max(2, math.ceil(bumper.length / _SPACING) + 1)
    along = np.linspace(-0.5 * bumper.length, 0.5 * bumper.length, count)
    cos, sin = math.cos(bumper.yaw), math.sin(bumper.yaw)
    return Mounts(
        bumper.x - sin * along - cos * _BEHIND,
        bumper.y + cos * along - sin * _BEHIND,
        np.full(count, bumper.z),
        np.full(count, bumper.yaw),
        np.full(count, owner, np.int64),
    )


class Devices:
    """All devices of all robots. `solid` casts against what collides, `visible` against what lasers see."""

    def __init__(
        self, robots: Sequence[Robot], obstacles: Sequence[Obstacle], visible: Caster, solid: Caster | None
    ) -> None:
        self._robots = robots
        self._visible = visible
        self._solid = solid
        self._finders = [(i, finder) for i, robot in enumerate(robots) for finder in robot.finders]
        self._bumpers = [(i, bumper) for i, robot in enumerate(robots) for bumper in robot.bumpers]
        self._blobfinders = [(i, finder) for i, robot in enumerate(robots) for finder in robot.blobfinders]
        self._targets = _targets(robots, obstacles)
        self._target_sources = np.array([target.source for target in self._targets], np.int64)
        self._target_keys = np.array([target.marker.key for target in self._targets], np.int64)
        self._finders_at = mount_devices(self._finders)
        self._rays = [_bumper_rays(i, bumper) for i, bumper in self._bumpers]
        if self._rays:
            self._bumpers_at = Mounts._make(np.concatenate(parts) for parts in zip(*self._rays, strict=True))

    def notice(self, poses: Floats) -> dict[int, Detections]:
        """What every robot with devices notices with the movers at `poses`; the casters have been moved there."""
        if not (self._finders or self._bumpers or self._blobfinders):
            return {}
        sightings = self._find(poses)
        pressed = self._press(poses)
        blobs = [(i, self._look(i, finder, poses)) for i, finder in self._blobfinders]
        return {
            i: Detections(
                tuple(s for owner, s in sightings if owner == i),
                tuple(p for owner, p in pressed if owner == i),
                tuple(b for owner, b in blobs if owner == i),
            )
            for i, robot in enumerate(self._robots)
            if robot.finders or robot.bumpers or robot.blobfinders
        }

    def _find(self, poses: Floats) -> list[tuple[int, tuple[Sighting, ...]]]:
        if not self._finders:
            return []
        at = rays_of(poses, self._finders_at)
        places = np.array([target.place(poses) for target in self._targets], float).reshape(-1, 3)
        found = []
        for row, (i, finder) in enumerate(self._finders):
            here = Pose2(float(at.x[row]), float(at.y[row]), float(at.yaw[row]))
            found.append((i, self._sightings(i, here, finder, places)))
        return found

    def _sightings(self, i: int, here: Pose2, finder: Finder, places: Floats) -> tuple[Sighting, ...]:
        """Markers within range and sight: the ray towards the marked model's origin has to meet that model first.

        `places` are the targets' poses in `map`.
        """
        dx, dy = places[:, 0] - here.x, places[:, 1] - here.y
        far = np.hypot(dx, dy)
        bearing = np.remainder(np.arctan2(dy, dx) - here.yaw + math.pi, math.tau) - math.pi
        near = (self._target_sources != i) & (self._target_keys == finder.key)
        near &= (far >= finder.range_min) & (far <= finder.range_max) & (np.abs(bearing) <= finder.fov / 2 + 1e-12)
        chosen = np.flatnonzero(near)
        if not len(chosen):
            return ()
        count = len(chosen)
        rays = Rays(
            np.full(count, here.x), np.full(count, here.y), np.full(count, finder.z),
            here.yaw + bearing[chosen], np.full(count, i, np.int64),
        )  # fmt: skip
        ranges, hit = self._visible.cast(rays, _ahead(finder.range_max))
        seen = self._visible.source_of[hit[:, 0]] == self._target_sources[chosen]
        if finder.ignore_zloc:
            seen |= ranges[:, 0] >= far[chosen]
        return tuple(
            Sighting(
                self._targets[k].marker.id if far[k] <= finder.range_max_id else 0,
                float(far[k]),
                float(bearing[k]),
                normalize_angle(float(places[k, 2]) - here.yaw),
            )
            for k in chosen[seen].tolist()
        )

    def _press(self, poses: Floats) -> list[tuple[int, bool]]:
        if not self._bumpers or self._solid is None:
            return []
        ranges, _ = self._solid.cast(rays_of(poses, self._bumpers_at), _ahead(_BEHIND + _TOUCH))
        hit = ranges[:, 0] < _BEHIND + _TOUCH
        ends = np.cumsum([len(rays.owner) for rays in self._rays])
        return [(i, bool(part.any())) for (i, _), part in zip(self._bumpers, np.split(hit, ends[:-1]), strict=True)]

    def _look(self, i: int, finder: Blobfinder, poses: Floats) -> tuple[Blob, ...]:
        # A single pixel looks straight ahead.
        angle_min = -finder.fov / 2 if finder.samples > 1 else 0.0
        step = finder.fov / max(1, finder.samples - 1)
        angles = angle_min + step * np.arange(finder.samples)
        beams = Beams(np.cos(angles)[None, :], np.sin(angles)[None, :], angle_min, step, finder.range_max)
        ranges, hit = self._visible.cast(rays_of(poses, mount_devices([(i, finder)])), beams)
        surfaces = self._visible.surfaces
        colors = [s.color if s is not None else "" for s in (surfaces[h] for h in hit[0].tolist())]
        blobs, begin = [], 0
        for color, group in groupby(colors):
            end = begin + len(list(group))
            if color and (not finder.colors or color in finder.colors):
                middle = angle_min + step * 0.5 * (begin + end - 1)
                blobs.append(Blob(color, middle, step * (end - begin), float(ranges[0, begin:end].min())))
            begin = end
        return tuple(blobs)
