"""All rangers of all robots at once: where they are mounted, what they measure, and their noise."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.counter_random import gaussians, stream, streams, uniforms
from zteam.geometry import Pose2
from zteam.kernels.binding import Beams, Fans, Rays
from zteam.sim.casting import Caster
from zteam.sim.interference import Emitter, Interference, find_interference
from zteam.sim.mounts import Mounts, make_rays, mount_devices, place_rays
from zteam.simulation_options import Options
from zteam.world.model import Ranger, Robot

Floats = NDArray[np.float64]

_RANGE_NOISE, _SHARE_NOISE, _UNIFORM_NOISE, _ANGLE_NOISE, _INTERFERENCE = range(5)
"""Streams of random numbers: no two kinds of noise draw the same numbers."""


class Reading(NamedTuple):
    """What one ranger measured: metres and intensities (0 = no hit), both float32 and read-only."""

    ranges: NDArray[np.float32]
    intensities: NDArray[np.float32]


class Mount(NamedTuple):
    """A ranger and the robot that carries it."""

    robot: int
    """Index of the robot in the engine's order."""
    place: int
    """Index of the ranger in the robot's list."""
    ranger: Ranger
    states: tuple[int, ...]
    """States of its streams of randomness, by kind."""


class _Noise(NamedTuple):
    """Of one batch, each (scans, 1)."""

    sigma: Floats
    """Metres."""
    proportional: Floats
    """Standard deviation by range."""
    uniform: Floats
    """Half width by range (Stage)."""
    angular: Floats
    """Half width in increments (Stage)."""
    states: NDArray[np.uint64]
    """(kinds, scans)"""


class Batch(NamedTuple):
    """Rangers of one kind: they share beams and range, so one kernel call serves them."""

    mounts: list[Mount]
    at: Mounts
    beams: Beams
    angles: Floats
    range_min: NDArray[np.float32]
    """(scans, 1)"""
    noise: _Noise | None
    rays: Rays
    """Where the sensors are at present."""
    fans: Fans


class Scans(NamedTuple):
    """What all rangers measured at one instant."""

    arrays: list[Reading]
    """By batch: (scans, beams)."""
    rows: dict[tuple[int, int], tuple[int, int]]
    """(robot index, ranger index) -> (batch, row)"""
    made: dict[tuple[int, int], Reading]
    """What was asked for: where nothing moves, robots get the same arrays again."""

    def reading(self, robot: int, place: int) -> Reading:
        """Of one ranger."""
        found = self.made.get((robot, place))
        if found is None:
            batch, row = self.rows[robot, place]
            arrays = self.arrays[batch]
            found = self.made[robot, place] = Reading(arrays.ranges[row], arrays.intensities[row])
        return found


NO_SCANS = Scans([], {}, {})
"""Before anything was measured."""


class Lasers:
    """Every ranger of the world. `ids` are the robots' ids, on which their noise depends."""

    def __init__(
        self, robots: Sequence[Robot], ids: Sequence[int], caster: Caster, options: Options, seed: int
    ) -> None:
        self._caster = caster
        self._options = options
        self._batches = _make_batches(robots, ids, options, seed)
        self._rows = {
            (mount.robot, mount.place): (number, row)
            for number, batch in enumerate(self._batches)
            for row, mount in enumerate(batch.mounts)
        }
        self._intensity = np.array([s.ranger_return if s else 0.0 for s in caster.surfaces], np.float32)
        self._interference = Interference(options.dazzle_angle, options.dazzle_probability)
        self._is_exact = options.dazzle == "off" and all(batch.noise is None for batch in self._batches)
        """Whether the poses alone decide what is measured."""
        self._poses = b""
        """Of the movers at the last measurement."""
        self._scans: Scans | None = None
        """What it gave; None while one is under way."""

    def begin(self, poses: Floats) -> None:
        """Begin to measure with all movers at `poses` (rows x, y, yaw in `map`), where the caster is till `measure`."""
        at = poses.tobytes()
        if self._is_exact and at == self._poses:
            return
        self._poses, self._scans = at, None
        for batch in self._batches:
            place_rays(poses, batch.at, batch.rays)

    def measure(self, tick: int) -> Scans:
        """The readings that `begin` began. Where nothing has moved and nothing is random, they are the last ones."""
        if self._scans is None:
            arrays = [self._measure(batch, tick) for batch in self._batches]
            if self._options.dazzle != "off":
                self._interfere(arrays, tick)
            self._scans = Scans([Reading(*map(_read_only, reading)) for reading in arrays], self._rows, {})
        return self._scans

    def _measure(self, batch: Batch, tick: int) -> Reading:
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

    def _interfere(self, arrays: Sequence[Reading], tick: int) -> None:
        emitters = [
            Emitter(
                number,
                row,
                mount.states[_INTERFERENCE],
                mount.robot,
                Pose2(float(batch.rays.x[row]), float(batch.rays.y[row]), float(batch.rays.yaw[row])),
                mount.ranger,
            )
            for number, batch in enumerate(self._batches)
            for row, mount in enumerate(batch.mounts)
            if mount.ranger.samples > 1
        ]
        for victim, bearing, draw in find_interference(emitters, self._caster, self._interference, tick):
            batch, ranges = self._batches[victim.batch], arrays[victim.batch].ranges[victim.row]
            off = np.abs(np.remainder(batch.angles - bearing + math.pi, math.tau) - math.pi)
            struck = off <= self._options.dazzle_angle
            if self._options.dazzle == "scan" and struck.any():
                struck[:] = True
            if self._options.dazzle == "max":
                ranges[struck] = batch.beams.limit
            elif self._options.dazzle == "short":
                share = uniforms(np.array([draw], np.uint64), len(struck))[0].astype(np.float32)
                low = victim.ranger.range_min
                true = np.minimum(ranges, np.float32(batch.beams.limit))
                ranges[struck] = (low + share * np.maximum(true - low, 0.0))[struck]
            else:
                ranges[struck] = np.nan


def _read_only(array: NDArray[np.float32]) -> NDArray[np.float32]:
    array.flags.writeable = False
    return array


def _jitter(batch: Batch, noise: _Noise, tick: int) -> None:
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


def _make_batches(robots: Sequence[Robot], ids: Sequence[int], options: Options, seed: int) -> list[Batch]:
    kinds: dict[tuple[int, float, float], list[Mount]] = {}
    for i, (robot_id, robot) in enumerate(zip(ids, robots, strict=True)):
        for place, ranger in enumerate(robot.rangers):
            states = tuple(stream(seed, robot_id, place, kind) for kind in range(5))
            kind = ranger.samples, ranger.fov, ranger.range_max
            kinds.setdefault(kind, []).append(Mount(i, place, ranger, states))
    return [_make_batch(mounts, options) for _, mounts in sorted(kinds.items())]


def _make_batch(mounts: list[Mount], options: Options) -> Batch:
    ranger = mounts[0].ranger
    # A single ray looks straight ahead; several fill the field of view, its ends included.
    angle_min = -ranger.fov / 2 if ranger.samples > 1 else 0.0
    angles: Floats = angle_min + ranger.angle_increment * np.arange(ranger.samples, dtype=np.float64)
    noise = _make_noise(mounts, options)
    jitter = 0.0 if noise is None else float(noise.angular.max())
    # Beams that jitter are others in each scan.
    directions = np.tile(angles, (len(mounts) if jitter else 1, 1))
    beams = Beams(np.cos(directions), np.sin(directions), angle_min, ranger.angle_increment, ranger.range_max, jitter)
    at = mount_devices([(m.robot, m.ranger) for m in mounts])
    range_min = np.array([[m.ranger.range_min] for m in mounts], np.float32)
    rays = make_rays(at)
    return Batch(mounts, at, beams, angles, range_min, noise, rays, Fans(rays, beams))


def _make_noise(mounts: Sequence[Mount], options: Options) -> _Noise | None:
    """Stage's triple is a variance, a share of the range and a share of the increment, the latter two half widths."""
    triples = np.array([m.ranger.noise for m in mounts], float)
    common = options.gaussian_noise, options.proportional_noise
    if not triples.any() and not any(common):
        return None
    return _Noise(
        sigma=np.sqrt(triples[:, :1] + common[0] ** 2),
        proportional=np.full((len(mounts), 1), common[1]),
        uniform=triples[:, 1:2],
        angular=0.5 * triples[:, 2:3],
        states=np.array([m.states for m in mounts], np.uint64).T,
    )
