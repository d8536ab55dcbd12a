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
from zteam.kernels.simulator import BeamTable, Fans, Floats, Rays
from zteam.simulator.core.casting import Caster, mount_devices
from zteam.simulator.world.model import Ranger, Robot

_RANGE_NOISE, _SHARE_NOISE, _UNIFORM_NOISE, _ANGLE_NOISE, _INTERFERENCE = range(5)
"""Streams of random numbers: no two kinds of noise draw the same numbers."""
_SAME_HEIGHT = 0.05
"""Metres: lasers further apart in height do not dazzle each other."""


class Reading(NamedTuple):
    """What one ranger measured: metres and intensities (0 = no hit), both float32 and read-only."""

    ranges: NDArray[np.float32]
    intensities: NDArray[np.float32]


_NOTHING = Reading(np.empty(0, np.float32), np.empty(0, np.float32))


class _Mount(NamedTuple):
    robot: int
    """Index of the robot in the engine's order."""
    place: int
    """Index of the ranger in the robot's list."""
    ranger: Ranger
    states: tuple[int, ...]
    """States of its streams of randomness, by kind."""


Readings = list[list[Reading]]
"""What all rangers measured at one instant: by robot, in the order of its rangers."""


class _Batch:
    """Rangers of one kind: they share beams and range, so one kernel call serves them. Stage's noise is a variance, a
    share of the range and a share of the increment, the latter two half widths."""

    def __init__(self, mounts: list[_Mount], options: Options) -> None:
        self.mounts = mounts
        ranger = mounts[0].ranger
        # A single ray looks straight ahead; several fill the field of view, its ends included.
        angle_min, step = -ranger.fov / 2 if ranger.samples > 1 else 0.0, ranger.angle_increment
        self.angles: Floats = angle_min + step * np.arange(ranger.samples, dtype=np.float64)
        variance, uniform, angular = np.array([m.ranger.noise for m in mounts], float).T[:, :, None]
        sigma = np.sqrt(variance + options.gaussian_noise**2)
        proportional = np.full((len(mounts), 1), options.proportional_noise)
        noises = (_RANGE_NOISE, sigma), (_SHARE_NOISE, proportional), (_UNIFORM_NOISE, uniform)
        self._noises = [(kind, scale) for kind, scale in noises if scale.any()]
        """Those that are not zero everywhere, (scans, 1): standard deviations in metres or by range, or half widths by
        range."""
        self._angular = 0.5 * angular
        """Half widths in increments."""
        self._states = np.array([m.states for m in mounts], np.uint64).T
        """(kinds, scans)"""
        jitter = float(self._angular.max())
        # Beams that jitter are others in each scan.
        directions = np.tile(self.angles, (len(mounts) if jitter else 1, 1))
        beams = BeamTable(np.cos(directions), np.sin(directions), angle_min, step, ranger.range_max, jitter)
        self._range_min = np.array([[m.ranger.range_min] for m in mounts], np.float32)
        self.fans = Fans(mount_devices([(m.robot, m.ranger) for m in mounts]), beams)

    def measure(self, caster: Caster, intensity: NDArray[np.float32], options: Options, tick: int) -> Reading:
        """The readings (scans, beams) where the fans are; `intensity` is that of the caster's surfaces."""
        beams = self.fans.beams
        if beams.jitter:
            # Each beam turns by its own share of an increment.
            draws = uniforms(streams(self._states[_ANGLE_NOISE], tick), len(self.angles))
            angles = self.angles + (2.0 * draws - 1.0) * self._angular * beams.increment
            np.cos(angles, out=beams.cos)
            np.sin(angles, out=beams.sin)
        exact, hit = caster.cast(self.fans)
        if self._noises:
            is_hit = hit != caster.nothing
            exact[is_hit] = np.clip(self._disturbed(exact, tick), 0.0, beams.limit)[is_hit]
        reading = Reading(exact.astype(np.float32), intensity.take(hit))
        if options.below_min != "measured":
            reading.ranges[reading.ranges < self._range_min] = -np.inf if options.below_min == "-inf" else 0.0
        if options.no_hit == "inf":
            reading.ranges[hit == caster.nothing] = np.inf
        return reading

    def _disturbed(self, ranges: Floats, tick: int) -> Floats:
        """Ranges with their noise; terms that are zero everywhere draw nothing."""
        count, wrong = ranges.shape[1], ranges
        for kind, scale in self._noises:
            draws = streams(self._states[kind], tick)
            if kind == _UNIFORM_NOISE:
                wrong = wrong + (2.0 * uniforms(draws, count) - 1.0) * scale * ranges
            else:
                wrong = wrong + scale * (ranges if kind == _SHARE_NOISE else 1.0) * gaussians(draws, count)
        return wrong


class Lasers:
    """Every ranger of the world. `ids` are the robots' ids, on which their noise depends."""

    def __init__(
        self, robots: Sequence[Robot], ids: Sequence[int], caster: Caster, options: Options, seed: int
    ) -> None:
        self._caster, self._options = caster, options
        self._counts = [len(robot.rangers) for robot in robots]
        kinds: dict[tuple[int, float, float], list[_Mount]] = {}
        for i, (robot_id, robot) in enumerate(zip(ids, robots, strict=True)):
            for place, ranger in enumerate(robot.rangers):
                states = tuple(stream(seed, robot_id, place, kind) for kind in range(5))
                kind = ranger.samples, ranger.fov, ranger.range_max
                kinds.setdefault(kind, []).append(_Mount(i, place, ranger, states))
        self._batches = [_Batch(mounts, options) for _, mounts in sorted(kinds.items())]
        self._intensity = np.array([s.ranger_return if s else 0.0 for s in caster.surfaces], np.float32)

    def measure(self, poses: Floats, tick: int) -> Readings:
        """The readings with all movers at `poses` (rows x, y, yaw in `map`), where the caster is."""
        measured = []
        for batch in self._batches:
            batch.fans.place(poses)
            measured.append((batch, batch.measure(self._caster, self._intensity, self._options, tick)))
        if self._options.dazzle != "off":
            self._dazzle(measured, tick)
        found = [[_NOTHING] * count for count in self._counts] if measured else []
        for batch, reading in measured:
            for array in reading:
                array.setflags(write=False)
            for mount, ranges, intensities in zip(batch.mounts, *reading, strict=True):
                found[mount.robot][mount.place] = Reading(ranges, intensities)
        return found

    def _dazzle(self, measured: Sequence[tuple[_Batch, Reading]], tick: int) -> None:
        lasers = [
            _Laser(mount, Pose2(*batch.fans.at[:, row].tolist()), batch.angles, reading.ranges[row])
            for batch, reading in measured
            for row, mount in enumerate(batch.mounts)
            if mount.ranger.is_laser
        ]
        options = self._options
        for (mount, _, angles, ranges), bearing, draw in _find_dazzled(lasers, self._caster, options, tick):
            ranger = mount.ranger
            struck = np.abs(np.remainder(angles - bearing + math.pi, math.tau) - math.pi) <= options.dazzle_angle
            if options.dazzle == "scan" and struck.any():
                struck[:] = True
            if options.dazzle == "max":
                ranges[struck] = ranger.range_max
            elif options.dazzle == "short":
                share = uniforms(np.array([draw], np.uint64), len(struck))[0].astype(np.float32)
                true = np.minimum(ranges, np.float32(ranger.range_max))
                ranges[struck] = (ranger.range_min + share * np.maximum(true - ranger.range_min, 0.0))[struck]
            else:
                ranges[struck] = np.nan


class _Laser(NamedTuple):
    """A laser that may dazzle others and be dazzled; its pose is in `map`."""

    mount: _Mount
    pose: Pose2
    angles: Floats
    """Of its beams."""
    ranges: NDArray[np.float32]
    """What they measured, which is changed."""


def _find_dazzled(
    lasers: Sequence[_Laser], caster: Caster, options: Options, tick: int
) -> Iterator[tuple[_Laser, float, int]]:
    """(disturbed laser, bearing of the other in its frame, a random number) for all that meet in this tick."""
    pairs = [(a, b) for a, b in itertools.combinations(lasers, 2) if _may_meet(a, b, options.dazzle_angle)]
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
    if a.mount.robot == b.mount.robot:
        return False
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
