"""AMCL."""

import math

import numpy as np
import pytest

from zteam.errors import UsageError
from zteam.geometry import Pose2, normalize_angle
from zteam.kernels.navigation import find_cluster
from zteam.navigation.planning.amcl import BIN_SIZE, Amcl, AmclOptions, choose_beams, kld_limits, move_differential
from zteam.navigation.planning.grid import GridMap, make_map
from zteam.navigation.planning.parameters import read_options
from zteam.navigation.planning.scans import Scan, Teammate

RESOLUTION = 0.05
LASER = Pose2(0.1, 0.0, 0.0)
ANGLES = np.linspace(-2.3, 2.3, 93)


def make_hall() -> GridMap:
    """8 x 6 m with walls that look different from everywhere."""
    cells = np.zeros((120, 160), np.int8)
    cells[[0, 1, -1, -2]] = 100
    cells[:, [0, 1, -1, -2]] = 100
    cells[40:44, :70], cells[80:, 110:114], cells[60:70, 90:100] = 100, 100, 100
    return make_map(cells, RESOLUTION, Pose2(-1.0, -2.0, 0.0))


def look(grid: GridMap, base: Pose2) -> Scan:
    """What a laser sees there, by small steps along each beam."""
    laser = base.compose(LASER)
    steps = np.arange(0.0, 9.0, 0.01)
    turns = ANGLES + laser.yaw
    points = np.stack(
        (laser.x + np.outer(np.cos(turns), steps).ravel(), laser.y + np.outer(np.sin(turns), steps).ravel()), axis=1
    )
    places = np.floor(grid.frame.points_to_cells(points)).astype(int)
    columns, rows = np.clip(places[:, 0], 0, 159), np.clip(places[:, 1], 0, 119)
    hit = (grid.cells[rows, columns] == 100).reshape(len(turns), -1)
    ranges = steps[hit.argmax(axis=1)].astype(np.float32)
    return Scan(ranges, float(ANGLES[0]), float(ANGLES[1] - ANGLES[0]), 0.0, 30.0, LASER)


def error_of(localiser: Amcl, truth: Pose2) -> float:
    """Metres."""
    return math.hypot(localiser.pose.x - truth.x, localiser.pose.y - truth.y)


def test_it_follows_a_robot_whose_odometry_drifts() -> None:
    """Odometry turns too far by a fifth; the pose stays within a few centimetres and degrees."""
    grid, truth, odom = make_hall(), Pose2(0.5, -1.2, 0.0), Pose2(0.0, 0.0, 0.0)
    localiser = Amcl(grid, seed=3)
    localiser.set_pose(truth, (0.1, 0.1, 0.1))
    errors = []
    for _ in range(40):
        truth = truth.compose(Pose2(0.12, 0.0, 0.1 if truth.x > 4.0 else 0.0))
        odom = odom.compose(Pose2(0.12, 0.0, 0.12 if truth.x > 4.0 else 0.01))
        if localiser.update(odom, look(grid, truth)):
            errors.append(error_of(localiser, truth))
            now = localiser.map_from_odom.compose(odom)
            assert tuple(now) == pytest.approx(tuple(localiser.pose), abs=1e-9)
            assert abs(normalize_angle(localiser.pose.yaw - truth.yaw)) < 0.2
    assert len(errors) > 10
    assert np.median(errors) < 0.08
    assert 500 <= len(localiser.particles) <= 2000


def test_it_waits_until_the_robot_has_moved() -> None:
    """update_min_d and update_min_a; the first scan always counts."""
    grid = make_hall()
    localiser, scan = Amcl(grid), look(grid, Pose2(0.5, -1.2, 0.0))
    localiser.set_pose(Pose2(0.5, -1.2, 0.0))
    odom = Pose2(0.0, 0.0, 0.0)
    moves = [0.0, 0.1, 0.2, 0.26]
    assert [localiser.update(odom._replace(x=x), scan) for x in moves] == [True, False, False, True]
    assert localiser.update(Pose2(0.26, 0.0, 0.21), scan)


@pytest.mark.parametrize(("aside", "goes"), [(0.5, True), (1.3, False)])
def test_no_particle_is_put_far_off_where_the_scan_fits(aside: float, goes: bool) -> None:
    """Where the scan fits 1.3 m from the expected pose no particle is put there; half a metre off some are."""
    grid, truth = make_hall(), Pose2(5.0, 1.0, 0.3)
    localiser = Amcl(grid, seed=5)
    localiser.set_pose(truth._replace(x=truth.x - aside), (0.02, 0.02, 0.02))
    localiser.update(Pose2(0.0, 0.0, 0.0), look(grid, truth))
    apart = np.hypot(localiser.particles[:, 0] - truth.x, localiser.particles[:, 1] - truth.y)
    assert bool(apart.min() < 0.05) is goes


def test_a_robot_that_was_carried_away_notices_it() -> None:
    """Its scans fit the map much worse than they did; where it is put back, they fit again, though it stands."""
    grid, odom = make_hall(), Pose2(0.0, 0.0, 0.0)
    localiser = Amcl(grid, seed=3)
    localiser.set_pose(Pose2(0.5, -1.2, 0.0), (0.1, 0.1, 0.1))

    def drive(truth: Pose2, steps: int) -> tuple[list[bool], Pose2]:
        nonlocal odom
        seen = []
        for _ in range(steps):
            truth, odom = (pose.compose(Pose2(0.25, 0.0, 0.0)) for pose in (truth, odom))
            localiser.update(odom, look(grid, truth))
            seen.append(localiser.is_elsewhere)
        return seen, truth

    first, there = drive(Pose2(0.5, -1.2, 0.0), 10)
    assert not any(first)
    assert drive(Pose2(5.8, 3.0, -1.6), 10)[0][-1]
    there = localiser.map_from_odom.compose(odom)
    assert localiser.is_elsewhere
    for _ in range(9):
        localiser.update(odom, look(grid, there))
    assert not localiser.is_elsewhere


@pytest.mark.ci
def test_it_finds_a_robot_on_the_whole_map() -> None:
    """From nothing, while the robot moves a little."""
    grid, truth, odom = make_hall(), Pose2(5.0, 2.5, 2.0), Pose2(0.0, 0.0, 0.0)
    localiser = Amcl(grid, AmclOptions(global_particles=4000), seed=2)
    localiser.localize_globally()
    assert localiser.is_lost
    for _ in range(25):
        localiser.update(odom, look(grid, truth))
        truth, odom = truth.compose(Pose2(0.03, 0.0, 0.05)), odom.compose(Pose2(0.03, 0.0, 0.05))
        if not localiser.is_lost:
            break
    assert not localiser.is_lost
    assert error_of(localiser, truth) < 0.3


@pytest.mark.parametrize(
    ("deviation", "mate", "is_left_out"),
    [
        (0.2, Teammate(0.8, 0.0, 0.2), True),
        # One that seems to stand 0.5 m beside its place is no wall if the robot itself may be 0.5 m off.
        (0.2, Teammate(0.9, 0.45, 0.1), False),
        (0.5, Teammate(0.9, 0.45, 0.1), True),
    ],
)
def test_beams_on_a_teammate_say_nothing(deviation: float, mate: Teammate, is_left_out: bool) -> None:
    """A teammate right ahead changes no particle's weight, once it is known to be there."""
    grid, base = make_hall(), Pose2(0.5, -1.2, 0.0)
    clear, ahead = look(grid, base), np.abs(ANGLES) < 0.2
    found = []
    for distance, mates in ((0.7, [mate]), (np.nan, [])):
        localiser = Amcl(grid, seed=5)
        localiser.set_pose(base, (deviation, deviation, 0.1))
        scan = clear._replace(ranges=np.where(ahead, distance, clear.ranges).astype(np.float32))
        localiser.update(Pose2(0.0, 0.0, 0.0), scan, mates)
        found.append(localiser.particles.tobytes())
    assert (found[0] == found[1]) is is_left_out


@pytest.mark.parametrize(("far", "used"), [(100.0, 60), (0.0, 60), (-1.0, 60), (0.5, 0)])
def test_a_largest_range_of_0_or_less_is_the_scans_own(far: float, used: int) -> None:
    """As in amcl: all beams count that met something, also of a laser without a range_max."""
    scan = look(make_hall(), Pose2(3.0, 2.0, 0.0))._replace(range_max=math.inf)
    options = AmclOptions(laser_max_range=far)
    assert len(choose_beams(scan, (), options, None)) == used
    nothing = scan._replace(ranges=np.full_like(scan.ranges, np.inf))
    assert len(choose_beams(nothing, (), options, None)) == 0


def test_without_errors_particles_move_as_odometry_does() -> None:
    """Forwards, backwards, in a bend and on the spot."""
    none = (0.0, 0.0, 0.0, 0.0)
    for step in (Pose2(0.5, 0.0, 0.3), Pose2(-0.5, 0.1, 0.0), Pose2(0.0, 0.0, 1.0), Pose2(0.3, 0.2, -0.5)):
        before, particle = Pose2(1.0, 2.0, 0.7), Pose2(-3.0, 4.0, 2.5)
        poses = np.array([particle])
        move_differential(poses, before, before.compose(step), none, np.ones((1, 3)))
        expected = particle.compose(step)
        assert poses[0, :2] == pytest.approx(expected[:2], abs=1e-9)
        assert normalize_angle(poses[0, 2] - expected.yaw) == pytest.approx(0.0, abs=1e-9)


def test_kld_limits_are_amcls() -> None:
    """pf_resample_limit: few bins need the fewest particles, one bin is not trusted."""
    limits = kld_limits(500, 2000, 0.05, 0.99)
    assert (limits[0], limits[1], limits[2]) == (2000, 2000, 500)
    k = 100 - 1
    cube = (1 - 2 / (9 * k) + math.sqrt(2 / (9 * k)) * 0.99) ** 3
    assert limits[100] == math.ceil(k / 0.1 * cube)
    assert limits[-1] == 2000
    assert (np.diff(limits[2:]) >= 0).all()


def test_clusters_touch() -> None:
    """Particles in bins side by side, also across the end of a full turn, are one cluster."""
    poses = np.array([[0.1, 0.1, 0.05], [0.6, 0.6, -0.05], [3.0, 0.1, 0.05], [0.1, 0.1, 3.1]])
    assert find_cluster(poses, np.ones(4), BIN_SIZE, 36)[0].tolist() == [0, 0, 1, 2]


def test_what_cannot_work_is_refused() -> None:
    """Fewer particles than the least, no beams, a base of another kind, a pose that is not finite, a map without
    room."""
    for wrong in (
        {"min_particles": 300, "max_particles": 200},
        {"min_particles": 0, "max_particles": 0},
        {"max_beams": 0},
        {"sigma_hit": 0.0},
        {"robot_model_type": "car"},
    ):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            AmclOptions(**wrong)  # type: ignore[arg-type]
    assert AmclOptions(sigma_hit=np.float64(0.3)).sigma_hit == 0.3
    with pytest.raises(UsageError, match=r"max_beams.*\nsigma_hit.*\nrobot_model_type"):
        read_options(AmclOptions, {"max_beams": 0, "sigma_hit": 0.0, "robot_model_type": "car"})
    with pytest.raises(ValueError, match="finite"):
        Amcl(make_hall()).set_pose(Pose2(math.nan, 0.0, 0.0))
    with pytest.raises(ValueError, match="no free cells"):
        Amcl(make_map(np.full((3, 3), 100, np.int8), 0.1)).localize_globally()
