"""All rangers of all robots at once: what they measure, their noise, and lasers that dazzle each other."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.config.simulation_options import Options
from zteam.counter_random import gaussians, mix64, stream, streams, uniforms
from zteam.geometry import Pose2
from zteam.kernels.simulator import BeamTable, Fans, Rays
from zteam.simulator.core.casting import Caster, mount_devices
from zteam.simulator.world.model import Ranger, Robot

Floats = NDArray[np.float64]

_RANGE_NOISE, _SHARE_NOISE, _UNIFORM_NOISE, _ANGLE_NOISE, _INTERFERENCE = range(5)
"""Streams of random numbers: no two kinds of noise draw the same numbers."""
_SAME_HEIGHT = 0.05
"""Metres: lasers further apart in height do not dazzle each other."""


class Reading(NamedTuple):
    """What one ranger measured: metres and intensities (0 = no hit), both float32 and read-only."""

    ranges: NDArray[np.float32]
    intensities: NDArray[np.float32]


class _Mount(NamedTuple):
    """A ranger and the robot that carries it."""

    robot: int
    """Index of the robot in the engine's order."""
    place: int
    """Index of the ranger in the robot's list."""
    ranger: Ranger
    states: tuple[int, ...]
    """States of its streams of randomness, by kind."""


class _Noise:
    """Of one batch, each (scans, 1).

    Stage's triple is a variance, a share of the range and a share of the increment, the latter two half widths.
    """

    def __init__(self, mounts: Sequence[_Mount], options: Options) -> None:
        triples = np.array([m.ranger.noise for m in mounts], float)
        self.sigma = np.sqrt(triples[:, :1] + options.gaussian_noise**2)
        """Metres."""
        self.proportional = np.full((len(mounts), 1), options.proportional_noise)
        """Standard deviation by range."""
        self.uniform, self.angular = triples[:, 1:2], 0.5 * triples[:, 2:3]
        """Half widths by range, and in increments."""
        self.states = np.array([m.states for m in mounts], np.uint64).T
        """(kinds, scans)"""
        self.is_none = not triples.any() and not (options.gaussian_noise or options.proportional_noise)


class _Batch:
    """Rangers of one kind: they share beams and range, so one kernel call serves them."""

    def __init__(self, mounts: list[_Mount], options: Options) -> None:
        self.mounts = mounts
        ranger, noise = mounts[0].ranger, _Noise(mounts, options)
        self.noise = None if noise.is_none else noise
        # A single ray looks straight ahead; several fill the field of view, its ends included.
        angle_min = -ranger.fov / 2 if ranger.samples > 1 else 0.0
        self.angles: Floats = angle_min + ranger.angle_increment * np.arange(ranger.samples, dtype=np.float64)
        jitter = float(noise.angular.max())
        # Beams that jitter are others in each scan.
        directions = np.tile(self.angles, (len(mounts) if jitter else 1, 1))
        self.beams = BeamTable(
            np.cos(directions), np.sin(directions), angle_min, ranger.angle_increment, ranger.range_max, jitter
        )
        self.range_min = np.array([[m.ranger.range_min] for m in mounts], np.float32)
        self.fans = Fans(mount_devices([(m.robot, m.ranger) for m in mounts]), self.beams)


class Scans(NamedTuple):
    """What all rangers measured at one instant."""

    arrays: list[Reading]
    """By batch: (scans, beams)."""
    rows: dict[tuple[int, int], tuple[int, int]]
    """(robot index, ranger index) -> (batch, row)"""

    def reading(self, robot: int, place: int) -> Reading:
        batch, row = self.rows[robot, place]
        ranges, intensities = self.arrays[batch]
        return Reading(ranges[row], intensities[row])


class Lasers:
    """Every ranger of the world. `ids` are the robots' ids, on which their noise depends."""

    def __init__(
        self, robots: Sequence[Robot], ids: Sequence[int], caster: Caster, options: Options, seed: int
    ) -> None:
        self._caster = caster
        self._options = options
        kinds: dict[tuple[int, float, float], list[_Mount]] = {}
        for i, (robot_id, robot) in enumerate(zip(ids, robots, strict=True)):
            for place, ranger in enumerate(robot.rangers):
                states = tuple(stream(seed, robot_id, place, kind) for kind in range(5))
                kind = ranger.samples, ranger.fov, ranger.range_max
                kinds.setdefault(kind, []).append(_Mount(i, place, ranger, states))
        self._batches = [_Batch(mounts, options) for _, mounts in sorted(kinds.items())]
        self._rows = {
            (mount.robot, mount.place): (number, row)
            for number, batch in enumerate(self._batches)
            for row, mount in enumerate(batch.mounts)
        }
        self._intensity = np.array([s.ranger_return if s else 0.0 for s in caster.surfaces], np.float32)

    def measure(self, poses: Floats, tick: int) -> Scans:
        """The readings with all movers at `poses` (rows x, y, yaw in `map`), where the caster is."""
        arrays = [self._measure(batch, poses, tick) for batch in self._batches]
        if self._options.dazzle != "off":
            self._dazzle(arrays, tick)
        for array in itertools.chain(*arrays):
            array.setflags(write=False)
        return Scans(arrays, self._rows)

    def _measure(self, batch: _Batch, poses: Floats, tick: int) -> Reading:
        batch.fans.place(poses)
        noise = batch.noise
        if noise is not None:
            _jitter(batch, noise, tick)
        exact, hit = self._caster.cast(batch.fans)
        if noise is not None:
            hits = hit != self._caster.nothing
            exact[hits] = np.clip(_disturbed(exact, noise, tick), 0.0, batch.beams.limit)[hits]
        reading = Reading(exact.astype(np.float32), self._intensity.take(hit))
        if self._options.below_min != "measured":
            below = reading.ranges < batch.range_min
            reading.ranges[below] = -np.inf if self._options.below_min == "-inf" else 0.0
        if self._options.no_hit == "inf":
            reading.ranges[hit == self._caster.nothing] = np.inf
        return reading

    def _dazzle(self, arrays: Sequence[Reading], tick: int) -> None:
        lasers = [
            _Laser(number, row, mount, Pose2(*batch.fans.at[:, row].tolist()))
            for number, batch in enumerate(self._batches)
            for row, mount in enumerate(batch.mounts)
            if mount.ranger.samples > 1
        ]
        options = self._options
        for victim, bearing, draw in _find_dazzled(lasers, self._caster, options, tick):
            batch, ranges = self._batches[victim.batch], arrays[victim.batch].ranges[victim.row]
            off = np.abs(np.remainder(batch.angles - bearing + math.pi, math.tau) - math.pi)
            struck = off <= options.dazzle_angle
            if options.dazzle == "scan" and struck.any():
                struck[:] = True
            if options.dazzle == "max":
                ranges[struck] = batch.beams.limit
            elif options.dazzle == "short":
                share = uniforms(np.array([draw], np.uint64), len(struck))[0].astype(np.float32)
                low = victim.mount.ranger.range_min
                true = np.minimum(ranges, np.float32(batch.beams.limit))
                ranges[struck] = (low + share * np.maximum(true - low, 0.0))[struck]
            else:
                ranges[struck] = np.nan


def _jitter(batch: _Batch, noise: _Noise, tick: int) -> None:
    """Turn each beam by its own share of an increment."""
    beams = batch.beams
    if beams.jitter:
        draws = uniforms(streams(noise.states[_ANGLE_NOISE], tick), len(batch.angles))
        angles = batch.angles + (2.0 * draws - 1.0) * noise.angular * beams.increment
        np.cos(angles, out=beams.cos)
        np.sin(angles, out=beams.sin)


def _disturbed(ranges: Floats, noise: _Noise, tick: int) -> Floats:
    """Ranges with their noise; terms that are zero everywhere draw nothing."""
    count = ranges.shape[1]
    wrong = ranges.copy()
    for kind, scale in ((_RANGE_NOISE, noise.sigma), (_SHARE_NOISE, noise.proportional * ranges)):
        if scale.any():
            wrong += scale * gaussians(streams(noise.states[kind], tick), count)
    if noise.uniform.any():
        draws = uniforms(streams(noise.states[_UNIFORM_NOISE], tick), count)
        wrong += (2.0 * draws - 1.0) * noise.uniform * ranges
    return wrong


class _Laser(NamedTuple):
    """A laser that may dazzle others and be dazzled; its pose is in `map`."""

    batch: int
    row: int
    mount: _Mount
    pose: Pose2


def _find_dazzled(
    lasers: Sequence[_Laser], caster: Caster, options: Options, tick: int
) -> Iterator[tuple[_Laser, float, int]]:
    """(disturbed laser, bearing of the other in its frame, a random number) for all that meet in this tick."""
    pairs = [
        (a, b)
        for a, b in itertools.combinations(lasers, 2)
        if a.mount.robot != b.mount.robot and _may_meet(a, b, options.dazzle_angle)
    ]
    if not pairs:
        return
    for (a, b), clear in zip(pairs, _are_in_sight(pairs, caster), strict=True):
        draw = stream(a.mount.states[_INTERFERENCE], b.mount.states[_INTERFERENCE], tick)
        if clear and (draw >> 11) * 2.0**-53 < options.dazzle_probability:
            yield a, _bearing(a, b), mix64(draw + 1)
            yield b, _bearing(b, a), mix64(draw + 2)


def _bearing(a: _Laser, b: _Laser) -> float:
    return math.remainder(math.atan2(b.pose.y - a.pose.y, b.pose.x - a.pose.x) - a.pose.yaw, math.tau)


def _may_meet(a: _Laser, b: _Laser, angle: float) -> bool:
    one, other = a.mount.ranger, b.mount.ranger
    distance = math.dist(a.pose[:2], b.pose[:2])
    near = 0.0 < distance < min(one.range_max, other.range_max) and abs(one.z - other.z) <= _SAME_HEIGHT
    return near and all(abs(_bearing(u, v)) <= u.mount.ranger.fov / 2 + angle for u, v in ((a, b), (b, a)))


def _are_in_sight(pairs: Sequence[tuple[_Laser, _Laser]], caster: Caster) -> list[bool]:
    """Whether nothing but the second laser's own robot stands on the way from the first."""
    start = np.array([(a.pose.x, a.pose.y, a.mount.ranger.z) for a, _ in pairs])
    end = np.array([b.pose[:2] for _, b in pairs])
    way = end - start[:, :2]
    distance = np.hypot(way[:, 0], way[:, 1])
    at = np.stack((start[:, 0], start[:, 1], np.arctan2(way[:, 1], way[:, 0])))
    rays = Rays(at, start[:, 2].copy(), np.array([a.mount.robot for a, _ in pairs], np.int64))
    ranges, hit = caster.cast(Fans(rays, BeamTable.ahead(float(distance.max()) + 1.0)))
    reached = ranges[:, 0] >= distance - 1e-9
    other = caster.source_of[hit[:, 0]] == np.array([b.mount.robot for _, b in pairs], np.int64)
    return [bool(r or o) for r, o in zip(reached, other, strict=True)]
