"""Fiducial finders, bumpers and blob finders: how they sense, by rays of their own.

What they are is in `zteam.simulator.world.devices`, their messages are in `zteam.simulator.core.to_messages`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from zteam import names
from zteam.geometry import Pose2, normalize_angle
from zteam.kernels.simulator import BeamTable, Fans, Floats, Rays
from zteam.messages import Blob, ColorRGBA, Fiducial
from zteam.simulator.core.casting import NO_MOVER, SensedWorld, mount_devices
from zteam.simulator.world.colors import find_color
from zteam.simulator.world.devices import KINDS, Blobfinder, BumperPiece, Finder

_TOUCH = 0.02
"""A bumper is pressed by what is this near: Stage's raster."""
_BEHIND = 0.02
"""Metres behind its line where a bumper's rays start, so that what has been pressed in still counts."""
_SPACING = 0.02
"""Metres between a bumper's rays."""


Sense = Callable[[Floats], Sequence[Any]]
"""What all devices of one kind detect with the movers at `poses`, one value each; `visible` is there already."""


Prepare = Callable[[SensedWorld, Sequence[tuple[int, Any]]], Sense]
"""For all devices of one kind, each with its robot's index."""
Detections = Mapping[str, tuple[Any, ...]]
"""What the devices of one robot detect: by topic, in file order."""


def _bumper_rays(owner: int, bumper: BumperPiece) -> Rays:
    count = max(2, math.ceil(bumper.length / _SPACING) + 1)
    along = np.linspace(-0.5 * bumper.length, 0.5 * bumper.length, count)
    cos, sin = math.cos(bumper.yaw), math.sin(bumper.yaw)
    x, y = bumper.x - sin * along - cos * _BEHIND, bumper.y + cos * along - sin * _BEHIND
    return Rays(np.stack((x, y, np.full(count, bumper.yaw))), np.full(count, bumper.z), np.full(count, owner, np.int64))


def prepare_fiducials(scene: SensedWorld, owned: Sequence[tuple[int, Finder]]) -> Sense:
    visible, own = scene.visible, Fans(mount_devices(owned), BeamTable.ahead(0.0))
    numbered = enumerate(scene.models)
    targets = [(marker, source, mover, model.pose) for source, (mover, model) in numbered for marker in model.markers]
    sources = np.array([source for _, source, _, _ in targets], np.int64)
    keys = np.array([marker.key for marker, *_ in targets], np.int64)

    def find(i: int, here: Pose2, finder: Finder, places: Floats) -> tuple[Fiducial, ...]:
        """Markers within range and sight: the ray towards the marked model's origin has to meet that model first.
        `places` are the targets' poses in `map`."""
        dx, dy = places[:, 0] - here.x, places[:, 1] - here.y
        far = np.hypot(dx, dy)
        bearing = np.remainder(np.arctan2(dy, dx) - here.yaw + math.pi, math.tau) - math.pi
        near = (sources != i) & (keys == finder.key)
        near &= (far >= finder.range_min) & (far <= finder.range_max) & (np.abs(bearing) <= finder.fov / 2 + 1e-12)
        chosen = np.flatnonzero(near)
        count = len(chosen)
        if not count:
            return ()
        towards = np.stack((np.full(count, here.x), np.full(count, here.y), here.yaw + bearing[chosen]))
        rays = Rays(towards, np.full(count, finder.z), np.full(count, i, np.int64))
        ranges, hit = visible.cast(Fans(rays, BeamTable.ahead(finder.range_max)))
        seen = visible.source_of[hit[:, 0]] == sources[chosen]
        if finder.ignore_zloc:
            seen |= ranges[:, 0] >= far[chosen]
        return tuple(
            Fiducial(
                targets[k][0].id if far[k] <= finder.range_max_id else 0,
                float(far[k]),
                float(bearing[k]),
                normalize_angle(float(places[k, 2]) - here.yaw),
            )
            for k in chosen[seen].tolist()
        )

    def sense(poses: Floats) -> list[tuple[Fiducial, ...]]:
        own.place(poses)
        here = own.at.T.tolist()
        models = [fixed if mover == NO_MOVER else Pose2(*poses[mover].tolist()) for _, _, mover, fixed in targets]
        markers = [Pose2(marker.x, marker.y, marker.yaw) for marker, *_ in targets]
        places = np.array([a.compose(b) for a, b in zip(models, markers, strict=True)], float).reshape(-1, 3)
        return [find(i, Pose2(*pose), finder, places) for (i, finder), pose in zip(owned, here, strict=True)]

    return sense


def prepare_bumpers(scene: SensedWorld, owned: Sequence[tuple[int, BumperPiece]]) -> Sense:
    rays = [_bumper_rays(i, bumper) for i, bumper in owned]
    mounts = Rays._make(np.concatenate(parts, axis=-1) for parts in zip(*rays, strict=True))
    fans = Fans(mounts, BeamTable.ahead(_BEHIND + _TOUCH))
    ends = np.cumsum([len(own.owner) for own in rays])
    solid = scene.caster(lambda surface: surface.obstacle)

    def sense(poses: Floats) -> list[bool]:
        solid.move(poses)
        fans.place(poses)
        ranges, _ = solid.cast(fans)
        return [bool(part.any()) for part in np.split(ranges[:, 0] < _BEHIND + _TOUCH, ends[:-1])]

    return sense


def prepare_blobfinders(scene: SensedWorld, owned: Sequence[tuple[int, Blobfinder]]) -> Sense:
    visible, fans = scene.visible, [_pixel_rays(i, finder) for i, finder in owned]

    def find(finder: Blobfinder, pixels: Fans, poses: Floats) -> tuple[Blob, ...]:
        pixels.place(poses)
        ranges, hit = visible.cast(pixels)
        colors = [s.color if s is not None else "" for s in (visible.surfaces[h] for h in hit[0].tolist())]
        blobs, begin, beams = [], 0, pixels.beams
        for color, group in groupby(colors):
            end = begin + len(list(group))
            if color and (not finder.colors or color in finder.colors):
                middle = beams.angle_min + beams.increment * 0.5 * (begin + end - 1)
                rgba, nearest = ColorRGBA(*(find_color(color) or (0.0, 0.0, 0.0))), float(ranges[0, begin:end].min())
                blobs.append(Blob(rgba, color, middle, beams.increment * (end - begin), nearest))
            begin = end
        return tuple(blobs)

    return lambda poses: [find(finder, own, poses) for (_, finder), own in zip(owned, fans, strict=True)]


def _pixel_rays(owner: int, finder: Blobfinder) -> Fans:
    """A ray for each pixel of a blob finder; a single one looks straight ahead."""
    angle_min = -finder.fov / 2 if finder.samples > 1 else 0.0
    step = finder.fov / max(1, finder.samples - 1)
    angles = angle_min + step * np.arange(finder.samples)
    beams = BeamTable(np.cos(angles)[None, :], np.sin(angles)[None, :], angle_min, step, finder.range_max)
    return Fans(mount_devices([(owner, finder)]), beams)


PREPARE: dict[str, Prepare] = {
    names.FIDUCIALS: prepare_fiducials,
    names.BUMPER: prepare_bumpers,
    names.BLOBS: prepare_blobfinders,
}
"""How devices sense, by topic."""


def prepare_devices(scene: SensedWorld) -> Callable[[Floats], dict[int, Detections]]:
    """What the devices of all robots detect, but for rangers, by the robot's index; `visible` is at the poses then."""
    senses: list[tuple[str, list[int], Sense]] = []
    for topic, prepare in PREPARE.items():
        owned = [(i, device) for i, robot in enumerate(scene.robots) for device in KINDS[topic].of(robot)]
        if owned:
            senses.append((topic, [i for i, _ in owned], prepare(scene, owned)))

    def sense(poses: Floats) -> dict[int, Detections]:
        found: dict[int, dict[str, tuple[Any, ...]]] = {}
        for topic, owners, detect in senses:
            for i, detected in zip(owners, detect(poses), strict=True):
                own = found.setdefault(i, {})
                own[topic] = (*own.get(topic, ()), detected)
        return dict(found)

    return sense
