"""Errors of lasers: noise, ranges below the minimum, no hit, and interference."""

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from support.small_worlds import LASER, make_box, make_robot, make_world
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import Engine, Options
from zteam.simulator.world.model import Floorplan, Obstacle, Robot, Shape, World


def laser_robot(x: float = 0.0, y: float = 0.0, yaw: float = 0.0, **changes: Any) -> Robot:
    """A robot with changes to the usual laser."""
    return make_robot(x, y, yaw, rangers=(msgspec.structs.replace(LASER, **changes),))


def scans(engine: Engine, count: int, robot_id: int = 0) -> np.ndarray:
    """The scans of `count` ticks at rest: (count, beams)."""
    return np.array([engine.step({}).robots[robot_id].readings[0].ranges for _ in range(count)])


@pytest.mark.parametrize("dazzle", ["off", "max"])
def test_a_scan_cannot_be_changed(dazzle: Any) -> None:
    """Messages share it: its ranges and intensities are read-only, and the next tick writes to others."""
    engine = Engine(make_world(make_robot(), make_robot(2.0)), options=Options(dazzle=dazzle))
    first = engine.step({}).robots[0].readings[0]
    with pytest.raises(ValueError, match="read-only"):
        first.ranges[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        first.intensities[0] = 1.0
    second = engine.step({0: Twist(Vector3(0.5))}).robots[0].readings[0]
    assert not np.shares_memory(first.ranges, second.ranges)


def test_gaussian_noise_has_its_deviation_and_spares_misses() -> None:
    """The scatter of a beam over many ticks is sigma, its mean the truth; a beam without a hit stays at range_max."""
    exact = scans(Engine(make_world(make_robot())), 1)[0]
    noisy = scans(Engine(make_world(make_robot()), options=Options(gaussian_noise=0.02)), 200)
    hits = exact < 7.8
    assert np.abs(noisy[:, hits].std(axis=0).mean() - 0.02) < 0.001
    assert np.abs((noisy[:, hits] - exact[hits]).mean()) < 0.001
    assert (noisy[:, exact == 8.0] == 8.0).all()


def test_proportional_noise_grows_with_the_range() -> None:
    """The scatter of each beam is its share of the range."""
    exact = scans(Engine(make_world(make_robot())), 1)[0]
    noisy = scans(Engine(make_world(make_robot()), options=Options(proportional_noise=0.01)), 200)
    hits = exact < 7.5
    assert noisy[:, hits].std(axis=0) == pytest.approx(0.01 * exact[hits], rel=0.2)


def test_stages_noise_is_a_variance_a_share_and_an_angle() -> None:
    """The triple's first is a variance, the second a uniform share; the third moves beams by half increments."""
    exact = scans(Engine(make_world(laser_robot())), 1)[0]
    front = 45
    variance = scans(Engine(make_world(laser_robot(noise=(0.0004, 0.0, 0.0)))), 400)
    assert abs(variance[:, front].std() - 0.02) < 0.002
    share = scans(Engine(make_world(laser_robot(noise=(0.0, 0.01, 0.0)))), 400)[:, front]
    assert np.abs(share - exact[front]).max() <= 0.01 * exact[front] + 1e-6
    assert abs(share.std() - 0.01 * exact[front] / math.sqrt(3)) < 0.002
    # A slanting beam on the wall at x = 3, turned by up to half an increment, stays between its neighbours' halves.
    beam = 60
    angular = scans(Engine(make_world(laser_robot(noise=(0.0, 0.0, 1.0)))), 200)[:, beam]
    angle, half = math.radians(-90 + 2 * beam), math.radians(1.0)
    assert angular.min() >= 3.0 / math.cos(angle - half) - 1e-5
    assert angular.max() <= 3.0 / math.cos(angle + half) + 1e-5
    assert angular.std() > 0.02


def test_noise_belongs_to_the_robot_and_the_tick() -> None:
    """The same robot draws the same noise with other robots present; another seed, tick or robot draws other noise."""
    options = Options(gaussian_noise=0.05)
    one, far = make_robot(), make_robot(0.0, -40.0)
    alone = Engine(make_world(one), options=options)
    pair = Engine(make_world(), robots={0: one, 1: far}, options=options)
    other = Engine(make_world(one), options=options, seed=2)
    renamed = Engine(make_world(), robots={5: one}, options=options)
    first, second = scans(alone, 2)
    assert (scans(pair, 1)[0] == first).all()
    assert (first != second).any()
    assert (scans(other, 1)[0] != first).any()
    assert (scans(renamed, 1, 5)[0] != first).any()


def test_what_no_beam_hits_reads_as_told() -> None:
    """range_max by default, inf on demand."""
    world = make_world(make_robot())
    assert scans(Engine(world), 1)[0, 0] == 8.0
    assert scans(Engine(world, options=Options(no_hit="inf")), 1)[0, 0] == np.inf


@pytest.mark.parametrize(("policy", "expected"), [("measured", 0.6), ("-inf", -np.inf), ("zero", 0.0)])
def test_below_the_least_range_reads_as_told(policy: Any, expected: float) -> None:
    """A wall nearer than range_min is measured all the same, or reads -inf, or 0."""
    world = make_world(laser_robot(range_min=1.0), wall_at=0.6)
    front = scans(Engine(world, options=Options(below_min=policy)), 1)[0, 45]
    assert front == pytest.approx(expected, abs=1e-6)


def test_a_laser_in_a_block_or_a_bitmaps_wall_reads_zero() -> None:
    """Interiors are solid in both kernels: each beam reads 0 and the intensity of what surrounds the laser."""
    block = Shape(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)), 0.0, 1.0, ranger_return=0.4)
    model = make_world(make_robot(), others=(Obstacle("block", Pose2(0.3, 0.2, 0.5), (block,)),))
    plan = Floorplan("solid", np.ones((20, 20), bool), (0.1, 0.1), Pose2(-1.0, -1.0, 0.0), 0.0, 1.0, ranger_return=0.4)
    bitmap = World("solid", 100_000_000, (plan,), (), (make_robot(),))
    for world in (model, bitmap):
        (reading,) = Engine(world).observe().robots[0].readings
        assert (reading.ranges == 0.0).all()
        assert reading.intensities == pytest.approx(0.4)


def test_a_laser_sees_through_its_own_body_but_not_through_anothers() -> None:
    """A robot's own body around its laser is never seen; another robot's is solid."""
    small = make_robot(0.05, 0.0, shapes=(Shape(((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)), 0.0, 0.05),))
    seen = Engine(make_world(make_robot(), small)).observe().robots
    assert seen[0].readings[0].ranges[45] == pytest.approx(3.0)
    assert (seen[1].readings[0].ranges == 0.0).all()


def facing(distance: float = 2.0, **changes: Any) -> dict[int, Robot]:
    """Two robots that look at each other."""
    return {0: laser_robot(**changes), 1: laser_robot(distance, 0.0, math.pi, **changes)}


@pytest.mark.parametrize("mode", ["drop", "max", "short", "scan"])
def test_lasers_in_mutual_sight_dazzle_each_other(mode: Any) -> None:
    """Only the beams towards the other laser are disturbed, in the chosen mode; `scan` disturbs them all."""
    world = make_world(wall_at=20.0)
    clean = Engine(world, robots=facing()).observe()
    dazzled = Engine(world, robots=facing(), options=Options(dazzle=mode, dazzle_angle=math.radians(2.5))).observe()
    for robot_id in (0, 1):
        exact, ranges = (o.robots[robot_id].readings[0].ranges for o in (clean, dazzled))
        struck = np.array([False] * 44 + [True] * 3 + [False] * 44)
        if mode == "scan":
            assert np.isnan(ranges).all()
            continue
        assert (ranges[~struck] == exact[~struck]).all()
        if mode == "drop":
            assert np.isnan(ranges[struck]).all()
        elif mode == "max":
            assert (ranges[struck] == 8.0).all()
        else:
            assert (ranges[struck] < exact[struck]).all()


def test_without_mutual_sight_nothing_is_dazzled() -> None:
    """A box between them, another height, or one that looks away leaves both scans clean."""
    options = Options(dazzle="drop")
    boxed = Engine(make_world(others=(make_box("b", 1.0, 0.0),), wall_at=20.0), robots=facing(), options=options)
    low = {0: laser_robot(), 1: laser_robot(2.0, 0.0, math.pi, z=0.25)}
    averted = {0: laser_robot(), 1: laser_robot(2.0)}
    for engine in (boxed, *(Engine(make_world(wall_at=20.0), robots=r, options=options) for r in (low, averted))):
        seen = engine.observe().robots
        assert not any(np.isnan(seen[i].readings[0].ranges).any() for i in (0, 1))


def test_dazzle_strikes_in_its_share_of_the_scans() -> None:
    """With probability 0.3 about three scans of ten are struck, for both robots in the same ticks."""
    options = Options(dazzle="drop", dazzle_probability=0.3)
    engine = Engine(make_world(wall_at=20.0), robots=facing(), options=options)
    struck = []
    for _ in range(300):
        seen = engine.step({}).robots
        both = [bool(np.isnan(seen[i].readings[0].ranges).any()) for i in (0, 1)]
        assert both[0] == both[1]
        struck.append(both[0])
    assert 0.2 < np.mean(struck) < 0.4


def test_options_refuse_what_makes_no_sense() -> None:
    """Negative noise and a probability above 1 are errors that name the option."""
    for changes, name in (({"gaussian_noise": -1.0}, "gaussian_noise"), ({"dazzle_probability": 2.0}, "probability")):
        with pytest.raises(ValueError, match=name):
            Options(**changes)


def test_two_lasers_of_a_robot_measure_from_their_own_places() -> None:
    """A second laser that looks back sees what is behind, from where it is mounted."""
    back = msgspec.structs.replace(LASER, x=-0.1, yaw=math.pi)
    seen = Engine(make_world(make_robot(rangers=(LASER, back)), others=(make_box("b", -2.0, 0.0),))).observe()
    ahead, behind = (reading.ranges[45] for reading in seen.robots[0].readings)
    assert ahead == pytest.approx(3.0, abs=1e-6)
    assert behind == pytest.approx(1.7, abs=1e-6)
