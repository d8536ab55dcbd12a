"""Where a robot is: by particles (`amcl`), by the simulator's word (`fake`), or by other processes (`none`)."""

import math
from collections.abc import Sequence

import numpy as np

from zteam import names
from zteam.config.localisation import LOST_DEVIATION
from zteam.counter_random import gaussians, stream
from zteam.geometry import Pose2
from zteam.messages import PoseWithCovarianceStamped
from zteam.messages.planar import planar
from zteam.navigation.planning.amcl import INITIAL_DEVIATIONS, NO_FREE_CELLS, Amcl
from zteam.navigation.planning.grid import Floats, GridMap
from zteam.navigation.planning.parameters import FakeOptions, Parameters
from zteam.navigation.planning.scans import Scan, Teammate, seen_from
from zteam.navigation.process.inputs import OLD, Inputs

_TOLD = 0.2, 0.2, 0.1
"""Of a pose that the transforms tell: a robot is put to its start by hand."""


class Localiser:
    """`none`: the transforms say where the robot is, whichever process publishes them. The base of the others."""

    def __init__(self) -> None:
        self.pose: Pose2 | None = None
        """Of the base in `map`."""
        self.map_from_odom: Pose2 | None = None
        """None: another process says it, if any does."""
        self.covariance: Floats = np.zeros((3, 3))
        """(3, 3) of `pose`: x, y, yaw."""
        self.updated = False
        """Whether the newest step took in a scan."""
        self.problem = "its place is not known yet"
        """Why the pose is not known; empty if it is."""
        self.is_outdated = False
        """Whether that is because what tells it has stopped to come."""

    def step(self, now: int, inputs: Inputs, scan: Scan | None, teammates: Sequence[Teammate]) -> None:
        """Take in what has come until `now` (ns). `teammates` are in `map`."""
        place = inputs.find(names.MAP_FRAME, inputs.base_frame)
        self.pose, self.problem, self.is_outdated = None, "", False
        if place is None:
            self.problem = f"no transforms from map to {inputs.base_frame}: nothing localises the robot"
        elif (age := now - place[1]) > OLD:
            self.problem = f"the pose of {inputs.base_frame} in map is {age / 1e9:.1f} s old"
            self.is_outdated = True
        else:
            self.pose = place[0]

    def set_pose(self, _pose: Pose2, _deviations: tuple[float, float, float]) -> str:
        """The robot is about here; why that does not count, if it does not."""
        return "this localiser takes no initial pose"

    def why_not_localized_globally(self) -> str:
        """Why the robot cannot be looked for everywhere; empty if it can."""
        return "this localiser has no particles to spread: start zteam-nav with --localizer amcl"

    def localize_globally(self) -> None:
        """The robot may be anywhere."""

    def particles(self) -> Floats:
        """(n, 3): guesses of the pose."""
        return np.array([self.pose]) if self.pose is not None else np.empty((0, 3))


class FakeLocaliser(Localiser):
    """`fake`: the simulator's ground truth, with errors of one's choice."""

    def __init__(self, options: FakeOptions, seed: int) -> None:
        super().__init__()
        self._options, self._seed = options, seed
        self.covariance = np.diag(np.square([options.noise_xy, options.noise_xy, options.noise_yaw]))

    def step(self, now: int, inputs: Inputs, scan: Scan | None, teammates: Sequence[Teammate]) -> None:
        self.updated = False
        truth, stamp = inputs.newest.get(names.GROUND_TRUTH), inputs.stamp(names.GROUND_TRUTH)
        pose = None if truth is None else planar(truth.pose.pose)
        odom, self.is_outdated = inputs.odom_pose(stamp), truth is not None and now - stamp > OLD
        if pose is None or odom is None:
            self.problem = "no ground truth: 'fake' needs a simulator; use amcl"
            return
        if self.is_outdated:
            self.problem = f"the ground truth is {(now - stamp) / 1e9:.1f} s old"
            return
        options = self._options
        draws = gaussians(np.array([stream(self._seed, stamp)], np.uint64), 4).ravel()
        self.pose = Pose2(
            pose.x + options.delta_x + options.noise_xy * float(draws[0]),
            pose.y + options.delta_y + options.noise_xy * float(draws[1]),
            pose.yaw + options.delta_yaw + options.noise_yaw * float(draws[2]),
        )
        self.map_from_odom = self.pose.compose(odom[0].inverse())
        self.updated, self.problem = True, ""


class AmclLocaliser(Localiser):
    """`amcl`: adaptive Monte Carlo localisation."""

    def __init__(self, grid: GridMap, parameters: Parameters, seed: int, pose: Pose2 | None = None) -> None:
        """`pose`: where the robot is known to be, as by an earlier map."""
        super().__init__()
        self._amcl = Amcl(grid, parameters.amcl, seed=seed)
        self._initial = parameters.initial_pose
        self._placed = False
        if pose is not None:
            self.set_pose(pose, INITIAL_DEVIATIONS)

    def step(self, now: int, inputs: Inputs, scan: Scan | None, teammates: Sequence[Teammate]) -> None:
        self.updated = False
        if not self._placed and not self._find_initial_pose(inputs):
            key = names.robot_key(inputs.robot_id, names.INITIAL_POSE)
            self.problem = f"its place is not known: publish it on {key}"
            return
        stamp = inputs.stamp(names.BASE_SCAN)
        newest = inputs.odom_pose()
        if scan is None or newest is None:
            self.problem = "no odometry" if scan is not None else inputs.scan_problem or "no scan to localise by"
            return
        self.is_outdated = 0 < newest[1] < now - OLD
        if self.is_outdated:
            self.problem = f"no transforms from {inputs.odom_frame} to {inputs.base_frame} for {OLD / 1e9:g} s"
            return
        if now - stamp <= OLD:
            odom, _ = newest if newest[1] == stamp else inputs.odom_pose(stamp) or newest
            here = self._amcl.pose if self.map_from_odom is None else self.map_from_odom.compose(odom)
            self.updated = self._amcl.update(odom, scan, seen_from(here, teammates))
        self.map_from_odom = self._amcl.map_from_odom
        self.pose = self.map_from_odom.compose(newest[0])
        self.covariance = self._amcl.covariance
        wide = math.sqrt(max(0.0, self.covariance[0, 0], self.covariance[1, 1]))
        self.problem = f"it is lost: its place is known to ± {wide:.1f} m only" if wide > LOST_DEVIATION else ""
        if self._amcl.is_elsewhere:
            key = names.robot_key(inputs.robot_id, names.INITIAL_POSE)
            self.problem = f"it is lost: what its laser sees does not fit the map there; publish its pose on {key}"
            # For all that go by its own estimate.
            self.covariance = np.diag([4.0 * LOST_DEVIATION**2, 4.0 * LOST_DEVIATION**2, math.pi**2])

    def _find_initial_pose(self, inputs: Inputs) -> bool:
        initial = self._initial
        if initial.set_initial_pose:
            self.set_pose(Pose2(initial.x, initial.y, initial.yaw), INITIAL_DEVIATIONS)
        elif (pose := inputs.known_pose()) is not None:
            self.set_pose(pose, _TOLD)
        return self._placed

    def set_pose(self, pose: Pose2, deviations: tuple[float, float, float]) -> str:
        self._amcl.set_pose(pose, deviations)
        self._placed, self.map_from_odom = True, None
        return ""

    def why_not_localized_globally(self) -> str:
        return "" if self._amcl.has_free_cells else NO_FREE_CELLS

    def localize_globally(self) -> None:
        self._amcl.localize_globally()
        self._placed, self.map_from_odom = True, None

    def particles(self) -> Floats:
        return self._amcl.particles


def deviations_of(message: PoseWithCovarianceStamped) -> tuple[float, float, float]:
    """Standard deviations of x, y and yaw; amcl's own where the message has none."""
    variances = [float(message.pose.covariance[i]) for i in (0, 7, 35)]
    if not all(map(math.isfinite, variances)) or min(variances) < 0.0 or not any(variances):
        return INITIAL_DEVIATIONS
    x, y, yaw = map(math.sqrt, variances)
    return x, y, yaw


def make_localiser(grid: GridMap, parameters: Parameters, seed: int, pose: Pose2 | None) -> Localiser:
    if parameters.localizer == "fake":
        return FakeLocaliser(parameters.fake, seed)
    return Localiser() if parameters.localizer == "none" else AmclLocaliser(grid, parameters, seed, pose)
