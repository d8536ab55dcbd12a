"""Bases: limits, wheels, odometry and its errors, with each kind of physics."""

import math
from typing import Literal

import msgspec
import numpy as np
import pytest

from support.small_worlds import drive, make_robot, make_world
from zteam.sim import Engine, Options
from zteam.simulator.world.model import Limits

FAR = 1e3

Physics = Literal["dynamic", "stage", "kinematic"]


def test_acceleration_limits_hold_for_commands_and_stops() -> None:
    """Speed rises by no more than the limit a tick, and falls by no more than the other when commands end."""
    limits = Limits(x=(-2.0, 0.5), y=(-1.0, 1.0), yaw=(-1.0, 1.0))
    engine = Engine(make_world(make_robot(acceleration=limits), wall_at=FAR))
    speeds = [engine.step({0: drive(1.0)}).robots[0].velocity[0] for _ in range(4)]
    assert speeds == pytest.approx([0.05, 0.1, 0.15, 0.2])
    for _ in range(20):
        engine.step({0: drive(1.0)})
    falling = [engine.step({}).robots[0].velocity[0] for _ in range(8)]
    assert falling[0] == pytest.approx(1.0)  # the watchdog still holds
    assert falling[1:7] == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.0, 0.0], abs=1e-9)
    turning = [engine.step({0: drive(0.0, 1.5)}).robots[0].velocity[2] for _ in range(3)]
    assert turning == pytest.approx([0.1, 0.2, 0.3])


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
def test_a_robot_that_is_held_brakes_at_its_limit(physics: Physics) -> None:
    """Whatever is commanded its speed falls as fast as its base allows, to zero and no further; the others drive on. A
    base without limits stops within a tick. Released, it obeys from rest."""
    limits = Limits(x=(-2.0, 0.5), y=(-1.0, 1.0), yaw=(-1.0, 1.0))
    robots = make_robot(acceleration=limits), make_robot(y=2.0), make_robot(y=4.0, acceleration=limits)
    engine = Engine(make_world(*robots, wall_at=FAR), options=Options(physics=physics))
    ahead = {i: drive(1.0) for i in range(3)}
    for _ in range(25):
        engine.step(ahead)

    def speeds(*held: int) -> list[float]:
        engine.move(ahead, held)
        return [engine.observe().robots[i].velocity[0] for i in range(3)]

    seen = [speeds(0, 1) for _ in range(6)]
    assert [each[0] for each in seen] == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.0, 0.0], abs=1e-9)
    assert [each[1] for each in seen] == pytest.approx([0.0] * 6, abs=1e-9)
    assert [each[2] for each in seen] == pytest.approx([1.0] * 6, abs=1e-9)
    assert speeds() == pytest.approx([0.05, 1.0, 1.0], abs=1e-9)


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
def test_a_robot_at_a_wall_backs_off_at_once(physics: Physics) -> None:
    """What it was told while the wall held it need not be braked away first."""
    robot = make_robot(acceleration=Limits(x=(-2.0, 0.5)))
    engine = Engine(make_world(robot, wall_at=1.0), options=Options(physics=physics))
    for _ in range(60):
        engine.step({0: drive(1.0)})
    start = engine.truth(0).x
    for _ in range(2):
        engine.step({0: drive(-1.0)})
    assert engine.truth(0).x < start - 0.02


def test_a_push_does_not_drive_a_robot() -> None:
    """One that is pushed while it is told to stand stands as soon as the push ends, whatever its limits."""
    pushed = make_robot(0.5, acceleration=Limits(x=(-0.1, 0.1)))
    engine = Engine(make_world(make_robot(mass=500.0), pushed, wall_at=FAR))
    for _ in range(20):
        engine.step({0: drive(0.5)})
    where = engine.truth(1).x
    assert where > 0.7
    engine.remove(0)
    engine.step({})
    ends = [engine.step({}).robots[1].truth.x for _ in range(5)]
    assert ends == pytest.approx([ends[0]] * 5, abs=1e-3)


def test_a_car_that_is_held_turns_no_more_sharply_than_it_is_steered() -> None:
    """While a wall takes its speed and after it comes free, yaw rate over speed stays that of its wheels."""
    limits = Limits(x=(-2.0, 0.5), yaw=(-0.5, 0.5))
    car = make_robot(yaw=0.3, drive="car", wheelbase=0.5, acceleration=limits)
    engine = Engine(make_world(car, make_robot(0.9), wall_at=FAR), options=Options(physics="kinematic"))
    for _ in range(30):
        engine.step({0: drive(1.0, 0.2)})
    engine.remove(1)
    for _ in range(10):
        x, _, yaw = engine.step({0: drive(1.0, 0.2)}).robots[0].velocity
        assert abs(yaw) <= math.tan(0.2) / 0.5 * abs(x) + 1e-9


def test_a_car_steers_by_an_angle() -> None:
    """The angular command is the steered wheels' angle: forward v cos, yaw rate v sin over the wheelbase (Stage)."""
    engine = Engine(make_world(make_robot(drive="car", wheelbase=0.8), wall_at=FAR))
    velocity = engine.step({0: drive(0.5, 0.3)}).robots[0].velocity
    assert velocity == pytest.approx((0.5 * math.cos(0.3), 0.0, 0.5 * math.sin(0.3) / 0.8))
    assert engine.step({0: drive(0.0, 0.3)}).robots[0].velocity == pytest.approx((0.0, 0.0, 0.0))


def test_wheels_turn_as_the_base_moves() -> None:
    """One metre straight ahead turns both wheels by 1 m over the radius; a turn on the spot turns them apart."""
    robot = make_robot(wheel_radius=0.1, wheel_separation=0.4)
    engine = Engine(make_world(robot, wall_at=FAR))
    for _ in range(20):
        joints = engine.step({0: drive(0.5)}).robots[0].joints
    assert joints.names == ("wheel_left_joint", "wheel_right_joint")
    assert joints.positions == pytest.approx((10.0, 10.0))
    assert joints.velocities == pytest.approx((5.0, 5.0))
    joints = engine.step({0: drive(0.0, 1.0)}).robots[0].joints
    assert joints.velocities == pytest.approx((-2.0, 2.0))


def test_omni_wheels_are_four() -> None:
    """Sideways, the wheels of each diagonal turn one way."""
    engine = Engine(make_world(make_robot(drive="omni", wheel_radius=0.1), wall_at=FAR))
    joints = engine.step({0: drive(0.0, 0.0, 0.5)}).robots[0].joints
    assert joints.velocities == pytest.approx((-5.0, 5.0, 5.0, -5.0))


def test_stages_bias_counts_every_motion_too_much() -> None:
    """Odometry runs ahead by the share that the world file gives, the truth does not; "gps" has no error."""
    robot = make_robot(odom_error=(0.05, 0.0, 0.1))
    engine = Engine(make_world(robot, msgspec.structs.replace(robot, localization="gps"), wall_at=FAR))
    for _ in range(20):
        seen = engine.step({0: drive(0.5), 1: drive(0.5)}).robots
    assert seen[0].odom.x == pytest.approx(1.05)
    assert seen[0].truth.x == pytest.approx(1.0)
    assert seen[1].odom.x == pytest.approx(1.0)
    for _ in range(10):
        seen = engine.step({0: drive(0.0, 0.5)}).robots
    assert seen[0].odom.yaw == pytest.approx(0.55)


def test_thruns_noise_spreads_with_the_way() -> None:
    """Over many robots the end of a straight drive scatters as the alphas say, about the truth."""
    count, ticks, way = 300, 25, 0.04
    robots = {i: make_robot(0.0, 2.0 * i) for i in range(count)}
    options = Options(physics="kinematic", odom_alphas=(0.0, 0.0, 0.04, 0.0))
    engine = Engine(make_world(wall_at=FAR), robots=robots, options=options)
    for _ in range(ticks):
        engine.move({i: drive(0.4) for i in robots})
    ends = np.array([seen.odom.x for seen in engine.observe().robots.values()])
    assert ends.mean() == pytest.approx(1.0, abs=0.01)
    # A standard deviation of 0.2 ways a tick, over 25 ticks.
    assert ends.std() == pytest.approx(0.2 * way * math.sqrt(ticks), rel=0.15)
    turned = Engine(
        make_world(wall_at=FAR), robots=robots, options=Options(physics="kinematic", odom_alphas=(0.0, 0.01, 0.0, 0.0))
    )
    for _ in range(ticks):
        turned.move({i: drive(0.4) for i in robots})
    yaws = np.array([seen.odom.yaw for seen in turned.observe().robots.values()])
    assert yaws.std() == pytest.approx(0.1 * way * math.sqrt(2 * ticks), rel=0.15)


def test_turning_on_the_spot_moves_noisy_odometry() -> None:
    """Thrun's fourth alpha: rotation alone makes the translation err, finitely, however small the way is."""
    for speed in (0.0, 1e-160):
        engine = Engine(make_world(make_robot(odom_alphas=(0.0, 0.0, 0.0, 0.1)), wall_at=FAR))
        for _ in range(20):
            engine.step({0: drive(speed, 1.0)})
        assert 1e-3 < math.hypot(*engine.observe().robots[0].odom[:2]) < 1.0
        assert engine.observe().robots[0].odom.yaw == pytest.approx(2.0)


def test_a_standing_robot_does_not_drift() -> None:
    """Without motion even noisy odometry stays where it is."""
    engine = Engine(make_world(make_robot(odom_alphas=(0.1, 0.1, 0.1, 0.1)), wall_at=FAR))
    for _ in range(20):
        engine.step({})
    assert engine.observe().robots[0].odom == (0.0, 0.0, 0.0)


def test_errors_of_zero_leave_stages_odometry_true() -> None:
    """Odometry that is integrated with a bias of next to nothing follows the truth in Stage's steps too."""
    robot = make_robot(localization="odom", odom_error=(1e-15, 0.0, 0.0))
    engine = Engine(make_world(robot, wall_at=50.0), options=Options(physics="stage"))
    for _ in range(50):
        seen = engine.step({0: drive(0.5, 1.0)}).robots[0]
    assert seen.odom == pytest.approx(seen.truth, abs=1e-9)
