"""Adaptive Monte Carlo localisation: where a robot is on a map, from its odometry and scans.

The likelihood field model, KLD sampling and recovery by random poses are those of ROS's amcl, with its names and
defaults. Every random number comes from counters, so the same seed and the same input give the same particles.
"""

import math
from collections.abc import Iterable
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.config.map_files import FREE
from zteam.config.numbers import Count, NotNegative, Positive, Share, Signed
from zteam.config.problems import CheckedOptions
from zteam.counter_random import gaussian_pairs, gaussians, stream, uniforms
from zteam.geometry import FAR, Pose2, normalize_angle
from zteam.kernels.binding import Floats
from zteam.kernels.navigation import BeamEnds, find_cluster, find_hits, move_poses, resample
from zteam.navigation.planning import likelihood
from zteam.navigation.planning.grid import NOWHERE, GridMap
from zteam.navigation.planning.likelihood import GlobalSearch, LikelihoodField
from zteam.navigation.planning.scans import Scan, Teammate

INITIAL_DEVIATIONS = 0.5, 0.5, math.pi / 12.0
"""amcl's initial_cov as standard deviations: metres, metres, radians."""
BIN_SIZE = 0.5, 0.5, math.radians(10.0)
"""Of the histogram that says how spread out the particles are (amcl's pf_kdtree): metres, metres, radians."""
_BINS_OF_TURN = 36
_MOVE, _DRAW, _SPREAD, _STRANGERS, _MATCHED, _MIX = range(6)
"""Streams of random numbers."""
NO_FREE_CELLS = "the map has no free cells: a robot can be nowhere on it"
_FOUND = 0.2, 0.2, 0.1
"""Metres, metres, radians: deviations of the particles about the place that was found on the whole map."""
_FIRST_STEPS = 0.1, 0.05
"""Metres and radians of the first steps of the search for the place where a scan fits best."""
_MATCHED_DEVIATIONS = 0.03, 0.03, 0.02
"""Metres, metres, radians: how the particles scatter that are put where the scan fits best."""
_MATCHED_WITHIN = 1.0, 0.7
"""Metres and radians from the expected pose up to which they are: beyond, a scan fits as one corner fits another."""
_MOST_DEVIATION = 0.5
"""Metres that a teammate may seem to be off, at most: with more, too few beams would be left."""

_LOST_UPDATES, _USUAL_UPDATES, _LOST_FIT = 8, 50, 0.75
"""The robot is lost when each of the last updates fits the map worse than this share of the usual fit, an average over
so many updates. A robot moved by 5 m or more in the shipped office has a median share of 0.6; one that knows its place
has at least 0.97."""


class AmclOptions(CheckedOptions, frozen=True):
    """Parameters, with amcl's names and Nav2's defaults. Raises ValueError for those that cannot work."""

    alpha1: NotNegative = 0.2
    alpha2: NotNegative = 0.2
    alpha3: NotNegative = 0.2
    alpha4: NotNegative = 0.2
    alpha5: NotNegative = 0.2
    max_beams: Count = 60
    min_particles: Count = 500
    max_particles: Count = 2000
    update_min_d: NotNegative = 0.25
    update_min_a: NotNegative = 0.2
    z_hit: Annotated[float, msgspec.Meta(ge=0.01, le=1.0)] = 0.5
    z_rand: Share = 0.5
    sigma_hit: Positive = 0.2
    laser_likelihood_max_dist: Positive = 2.0
    laser_max_range: Signed = 100.0
    """Metres; a longer beam, or one of the laser's range_max, says nothing. 0 or less: range_max alone counts."""
    pf_err: Annotated[float, msgspec.Meta(ge=1e-3, le=1.0)] = 0.05
    pf_z: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)] = 0.99
    recovery_alpha_slow: Share = 0.0
    recovery_alpha_fast: Share = 0.0
    resample_interval: Count = 1
    robot_model_type: Literal[
        "nav2_amcl::DifferentialMotionModel", "nav2_amcl::OmniMotionModel", "differential", "omnidirectional"
    ] = "nav2_amcl::DifferentialMotionModel"
    """The short names are those of Nav2 until Galactic."""
    matched_share: Share = 0.15
    """Share of the particles that are put where the scan fits best, near the heaviest one; 0 is plain amcl, which takes
    many updates to follow a turn that odometry did not see."""
    global_particles: Count = 25_000
    """Poses that are tried with each scan while the robot may be anywhere."""
    teammate_margin: NotNegative = 0.1
    """Metres around a teammate in which a beam that ends there counts as on the teammate, and is left out."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.min_particles > self.max_particles:
            raise ValueError(f"min_particles {self.min_particles} is above max_particles {self.max_particles}")

    @property
    def farthest(self) -> float:
        """Metres up to which a beam counts that met something."""
        return self.laser_max_range if self.laser_max_range > 0.0 else FAR


def _normals(state: NDArray[np.uint64], count: int) -> Floats:
    """Standard normal numbers, three for each of so many particles: (count, 3)."""
    return gaussian_pairs(state, (3 * count + 1) // 2)[0, : 3 * count].reshape(-1, 3).astype(np.float64)


def _scatter(poses: Floats, fitting: Floats, expected: Pose2, share: float, state: NDArray[np.uint64]) -> None:
    """Put a share of the particles, which were drawn in no order, about a pose that is near the expected one."""
    x, y, yaw = fitting.tolist()
    off = math.hypot(x - expected.x, y - expected.y), abs(normalize_angle(yaw - expected.yaw))
    if off[0] < _MATCHED_WITHIN[0] and off[1] < _MATCHED_WITHIN[1]:
        count = int(share * len(poses))
        poses[:count] = fitting + _normals(state, count) * _MATCHED_DEVIATIONS


def choose_beams(scan: Scan, teammates: Iterable[Teammate], options: AmclOptions, covariance: Floats | None) -> Floats:
    """Ends of up to `max_beams` beams, spread evenly, in the base frame: (n, 2). Those on teammates are left out.

    The `covariance` (3, 3) of the own place is also that of the teammates as seen from there; None: it may be anywhere.
    """
    deviation = 0.0 if covariance is None else math.sqrt(max(covariance[0, 0], covariance[1, 1]))
    margin = options.teammate_margin + min(_MOST_DEVIATION, deviation)
    return find_hits(scan, NOWHERE, options.farthest, options.max_beams, teammates, margin)


class Amcl:
    """The localiser of one robot. `update` with odometry and scan; then read `pose` and `map_from_odom`."""

    def __init__(self, grid: GridMap, options: AmclOptions | None = None, *, seed: int = 1) -> None:
        """Starts at the map's origin: call `set_pose`, or `localize_globally`."""
        options = self.options = options or AmclOptions()
        self._grid = grid
        self._field: tuple[float, LikelihoodField] | None = None
        self._free = np.flatnonzero(grid.cells.ravel() == FREE)
        self._seed, self._count, self._spreads = seed, 0, 0
        self._odom: Pose2 | None = None
        self._pose_of_odom = Pose2(0.0, 0.0, 0.0)
        self._search: GlobalSearch | None = None
        self._enough = kld_limits(options.min_particles, options.max_particles, options.pf_err, options.pf_z)
        self.set_pose(Pose2(0.0, 0.0, 0.0))

    def set_pose(self, pose: Pose2, deviations: tuple[float, float, float] = INITIAL_DEVIATIONS) -> None:
        """The robot is about at `pose` (base in `map`). Raises ValueError for what is not finite."""
        if not all(map(math.isfinite, (*pose, *deviations))):
            raise ValueError(f"a pose must be finite: {tuple(pose)} ± {tuple(deviations)}")
        draws = gaussians(self._state(_SPREAD, self._spreads), 3 * self.options.max_particles).reshape(-1, 3)
        self._search = None
        self._begin(np.array(pose) + draws * np.array(deviations))
        self.pose, self.covariance = pose, np.diag(np.square(deviations))

    def localize_globally(self) -> None:
        """The robot may be anywhere on the map. Raises ValueError for a map without free cells.

        Until it is found, each scan is an update, and the particles are the places where it may be (GlobalSearch).
        """
        self._begin(self._anywhere(self.options.max_particles, _SPREAD, self._spreads))
        self._search = GlobalSearch(self._grid, self.options.farthest)
        self.pose, self.covariance = estimate_pose(self._poses, self._weights)

    @property
    def has_free_cells(self) -> bool:
        """Whether there is a place on the map where a robot can be."""
        return bool(len(self._free))

    @property
    def is_lost(self) -> bool:
        """Whether it looks for the robot on the whole map."""
        return self._search is not None

    def _begin(self, poses: Floats) -> None:
        self._spreads += 1
        self._poses, self._weights = np.ascontiguousarray(poses), np.full(len(poses), 1.0 / len(poses))
        self._slow = self._fast = 0.0
        self._fits: list[float] = []
        self._usual, self._fit_count = 0.0, 0
        # From where the next odometry is.
        self._odom, self._forced = None, True

    @property
    def is_elsewhere(self) -> bool:
        """Whether the last scans fit the map much worse around `pose` than they did before: the robot was carried away,
        or much stands there that the map does not show."""
        return self._fit_count > _LOST_UPDATES and max(self._fits) < _LOST_FIT * self._usual

    def _match(self, field: LikelihoodField, beams: BeamEnds, pose: Floats) -> Floats:
        """The pose near this one (1, 3) where the beams fit best; how well they do is remembered."""
        fitting, fits = likelihood.match(field, pose, beams, *_FIRST_STEPS)
        if beams.shape[1]:
            fit = float(fits[0]) / (likelihood.UNITS * field.unit)
            self._fits = [*self._fits[1 - _LOST_UPDATES :], fit]
            if fit >= _LOST_FIT * self._usual:
                self._fit_count += 1
                self._usual += (fit - self._usual) / min(self._fit_count, _USUAL_UPDATES)
        found: Floats = fitting[0]
        return found

    @property
    def particles(self) -> Floats:
        """(n, 3): x, y, yaw in `map`; a copy."""
        return self._poses.copy()

    @property
    def map_from_odom(self) -> Pose2:
        """The transform that makes the newest odometry agree with `pose`."""
        return self.pose if self._odom is None else self._pose_of_odom

    def update(self, odom: Pose2, scan: Scan, teammates: Iterable[Teammate] = ()) -> bool:
        """Take in a scan and the base's pose in `odom` at its time; return whether the robot had moved enough for it.

        `teammates` are in the robot's base frame: beams that end on them are left out.
        """
        if self._odom is None:
            self._odom, self._pose_of_odom = odom, self.pose.compose(odom.inverse())
        before = self._odom
        way, turn = math.hypot(odom.x - before.x, odom.y - before.y), abs(normalize_angle(odom.yaw - before.yaw))
        is_due = self._forced or way >= self.options.update_min_d or turn >= self.options.update_min_a
        # A robot that is elsewhere stands, and may be carried back.
        if not is_due and not self.is_elsewhere:
            return False
        ends = choose_beams(scan, teammates, self.options, None if self.is_lost else self.covariance)
        field = self._likelihoods(scan.range_max)
        beams = likelihood.beams_of(field, ends)
        if not is_due:
            self._match(field, beams, np.array([self._pose_of_odom.compose(odom)]))
            return False
        self._forced = False
        self._count += 1
        self._odom = odom
        if self._search is not None:
            self._look_everywhere(self._search, before, odom, ends)
            return True
        self._move(before, odom)
        self._weigh(field, beams)
        if self._count % self.options.resample_interval == 0:
            most = int(self._weights.argmax())
            heaviest = self._poses[most : most + 1]
            self._resample()
            fitting, share = self._match(field, beams, heaviest), self.options.matched_share
            _scatter(self._poses, fitting, self._pose_of_odom.compose(odom), share, self._state(_MATCHED, self._count))
        self.pose, self.covariance = estimate_pose(self._poses, self._weights)
        self._pose_of_odom = self.pose.compose(odom.inverse())
        return True

    def _look_everywhere(self, search: GlobalSearch, before: Pose2, odom: Pose2, ends: Floats) -> None:
        self._forced = True
        search.move(before, odom)
        found = search.try_poses(self._anywhere(self.options.global_particles, _STRANGERS, self._count), ends)
        if not len(search.poses):
            return
        self.pose = Pose2(*search.poses[0].tolist())
        if found:
            self.set_pose(self.pose, _FOUND)
            self._odom = odom
        else:
            weights = search.fits + 1e-9
            self._poses, self._weights = search.poses.copy(), weights / weights.sum()
        self._pose_of_odom = self.pose.compose(odom.inverse())

    def _move(self, before: Pose2, after: Pose2) -> None:
        draws = _normals(self._state(_MOVE, self._count), len(self._poses))
        move = move_omnidirectional if "omni" in self.options.robot_model_type.lower() else move_differential
        options = self.options
        alphas = options.alpha1, options.alpha2, options.alpha3, options.alpha4, options.alpha5
        move(self._poses, before, after, alphas, draws)

    def _weigh(self, field: LikelihoodField, beams: BeamEnds) -> None:
        likelihood.weigh_poses(field, self._poses, beams, self._weights)
        total = float(self._weights.sum())
        self._weights /= total
        options = self.options
        self._slow += (options.recovery_alpha_slow if self._slow else 1.0) * (total - self._slow)
        self._fast += (options.recovery_alpha_fast if self._fast else 1.0) * (total - self._fast)

    def _likelihoods(self, range_max: float) -> LikelihoodField:
        if self._field is None or self._field[0] != range_max:
            options = self.options
            field = likelihood.make_likelihood_field(
                self._grid,
                z_hit=options.z_hit,
                z_rand=options.z_rand,
                sigma_hit=options.sigma_hit,
                max_dist=options.laser_likelihood_max_dist,
                range_max=min(range_max, options.farthest),
            )
            self._field = range_max, field
        return self._field[1]

    def _resample(self) -> None:
        most = self.options.max_particles
        share = max(0.0, 1.0 - self._fast / self._slow) if self._slow else 0.0
        draws = uniforms(self._state(_DRAW, self._count), most)[0]
        strange = uniforms(self._state(_MIX, self._count), most)[0] < share if share else np.zeros(most, bool)
        sums = np.cumsum(self._weights)
        sums /= sums[-1]
        poses = self._poses
        if share:
            poses = np.concatenate((poses, self._anywhere(most, _STRANGERS, self._count)))
        self._poses = resample(poses, sums, draws, strange, self._enough, BIN_SIZE)
        self._weights = np.full(len(self._poses), 1.0 / len(self._poses))
        if share:
            self._slow = self._fast = 0.0

    def _anywhere(self, count: int, purpose: int, counter: int) -> Floats:
        """Poses all over the free cells: (count, 3). Raises ValueError for a map without any."""
        if not len(self._free):
            raise ValueError(NO_FREE_CELLS)
        frame = self._grid.frame
        draws = uniforms(self._state(purpose, counter), 4 * count).reshape(-1, 4)
        row, column = np.divmod(self._free[(draws[:, 0] * len(self._free)).astype(np.int64)], frame.columns)
        places = frame.points_from_cells(np.stack((column + draws[:, 1], row + draws[:, 2]), axis=1))
        return np.column_stack((places, 2.0 * math.pi * draws[:, 3] - math.pi))

    def _state(self, purpose: int, counter: int) -> NDArray[np.uint64]:
        return np.array([stream(self._seed, purpose, counter)], np.uint64)


def move_differential(poses: Floats, before: Pose2, after: Pose2, alphas: tuple[float, ...], draws: Floats) -> None:
    """Move particles (n, 3) as odometry says that a differential base went, with its errors.

    amcl's DifferentialMotionModel (Thrun, Burgard, Fox 2005, table 5.6); `draws` (n, 3) are standard normal.
    """
    dx, dy = after.x - before.x, after.y - before.y
    way, turn = math.hypot(dx, dy), normalize_angle(after.yaw - before.yaw)
    # A turn on the spot has no direction of its own.
    first = normalize_angle(math.atan2(dy, dx) - before.yaw) if way >= 0.01 else 0.0
    second = normalize_angle(turn - first)
    # A robot that backs up turns by nearly half a turn before and after: that is no turn.
    small_first, small_second = (min(abs(a), abs(normalize_angle(a - math.pi))) for a in (first, second))
    a1, a2, a3, a4 = alphas[:4]
    squares = a1 * small_first**2 + a2 * way**2, a1 * small_second**2 + a2 * way**2
    ahead = math.sqrt(a3 * way**2 + a4 * (small_first**2 + small_second**2))
    move_poses(poses, (first, way, second, math.sqrt(squares[0]), ahead, math.sqrt(squares[1])), draws)


def move_omnidirectional(poses: Floats, before: Pose2, after: Pose2, alphas: tuple[float, ...], draws: Floats) -> None:
    """As `move_differential`, for a base that drives sideways too: amcl's OmniMotionModel."""
    dx, dy = after.x - before.x, after.y - before.y
    way, turn = math.hypot(dx, dy), normalize_angle(after.yaw - before.yaw)
    a1, a2, a3, a4, a5 = alphas
    along = math.sqrt(a3 * way**2 + a1 * turn**2)
    around = math.sqrt(a4 * turn**2 + a2 * way**2)
    aside = math.sqrt(a1 * turn**2 + a5 * way**2)
    bearing = (math.atan2(dy, dx) - before.yaw if way > 0.0 else 0.0) + poses[:, 2]
    cos, sin = np.cos(bearing), np.sin(bearing)
    forward, left = way + along * draws[:, 0], aside * draws[:, 1]
    poses[:, 0] += forward * cos + left * sin
    poses[:, 1] += forward * sin - left * cos
    poses[:, 2] += turn + around * draws[:, 2]


def kld_limits(least: int, most: int, error: float, quantile: float) -> NDArray[np.int64]:
    """Particles that are enough for a histogram with k bins, for k from 0 to `most` (Fox 2003; amcl's formula).

    With them the error of the distribution is below `error` in the share of cases of which `quantile` is the upper
    standard normal quantile.
    """
    k = np.maximum(np.arange(most + 1), 2) - 1.0
    b = 2.0 / (9.0 * k)
    cube = (1.0 - b + np.sqrt(b) * quantile) ** 3
    enough = np.clip(np.ceil(k / (2.0 * error) * cube), least, most).astype(np.int64)
    enough[:2] = most
    return enough


def estimate_pose(poses: Floats, weights: Floats) -> tuple[Pose2, Floats]:
    """The mean and covariance (3, 3) of the heaviest cluster of particles (n, 3)."""
    _, (x, y, yaw), covariance = find_cluster(poses, weights, BIN_SIZE, _BINS_OF_TURN)
    return Pose2(x, y, normalize_angle(yaw)), covariance
