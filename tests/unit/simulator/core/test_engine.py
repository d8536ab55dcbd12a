"""The core: motion, watchdog, odometry, contacts."""

import math

import numpy as np
import pytest

from support.small_worlds import BODY, drive, make_robot, make_world
from zteam.geometry import Pose2
from zteam.sim import Engine
from zteam.simulator.world.model import Obstacle, Shape


def test_the_first_stamp_is_one_interval() -> None:
    """Time is 0 before the first tick and never 0 in an observation."""
    engine = Engine(make_world(make_robot()))
    assert engine.now == 0
    assert engine.step({}).stamp == 100_000_000


def test_velocities_are_limited_and_diff_drives_do_not_slide() -> None:
    """Stage's default bounds hold, and only an omni drive takes a sideways command."""
    engine = Engine(make_world(make_robot(0.0, 2.0), make_robot(0.0, -2.0, drive="omni"), wall_at=50.0))
    seen = engine.step({0: drive(9.0, 9.0, 0.5), 1: drive(0.0, 0.0, 0.5)}).robots
    assert seen[0].velocity == pytest.approx((1.0, 0.0, math.pi / 2))
    assert seen[1].velocity == pytest.approx((0.0, 0.5, 0.0))


def test_a_command_lasts_for_the_watchdogs_time() -> None:
    """A robot drives on for 0.2 s of simulated time without a command, and stands from then on."""
    engine = Engine(make_world(make_robot(), wall_at=50.0))
    speeds = [engine.step({0: drive(0.5)} if tick == 0 else {}).robots[0].velocity[0] for tick in range(4)]
    assert speeds == pytest.approx([0.5, 0.5, 0.0, 0.0])


def test_a_wall_stalls_a_robot_and_its_odometry() -> None:
    """Blocked robots say so and stand before the wall; the odometry tells what the base did; reversing frees them."""
    engine = Engine(make_world(make_robot()))
    for _ in range(60):
        seen = engine.step({0: drive(0.8)}).robots[0]
    assert seen.stall
    assert seen.truth.x == pytest.approx(2.8, abs=0.02)
    assert seen.odom.x == pytest.approx(seen.truth.x, abs=1e-9)
    assert abs(seen.velocity[0]) < 0.05
    for _ in range(5):
        seen = engine.step({0: drive(-0.5)}).robots[0]
    assert not seen.stall
    assert seen.truth.x < 2.7


def test_a_wall_does_not_turn_a_robot() -> None:
    """At an oblique wall a robot slides along it, with the heading that its wheels hold."""
    engine = Engine(make_world(make_robot(yaw=0.6)))
    for _ in range(80):
        seen = engine.step({0: drive(0.6)}).robots[0]
    assert seen.truth.yaw == pytest.approx(0.6)
    assert seen.truth.x < 3.0
    assert seen.truth.y > 1.9


def test_lasers_see_walls_and_other_robots() -> None:
    """Straight ahead stands the wall with its intensity; to the left the other robot; behind it nothing."""
    seen = Engine(make_world(make_robot(), make_robot(0.0, 2.0))).observe().robots[0].readings[0]
    assert seen.ranges[45] == pytest.approx(3.0, abs=1e-6)
    assert seen.intensities[45] == np.float32(0.7)
    assert seen.ranges[90] == pytest.approx(1.8, abs=1e-6)
    assert seen.intensities[90] == 1.0
    assert seen.ranges[0] == 8.0
    assert seen.intensities[0] == 0.0


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
def test_what_hangs_overhead_stops_nobody(physics: str) -> None:
    """A beam from 0.5 m on, and one that ends under the body, let a robot pass that a step at its height stops."""
    high, low, step = (
        Obstacle(name, Pose2(1.0, 0.0, 0.0), (Shape(BODY, *heights),))
        for name, heights in (("high", (0.5, 1.0)), ("low", (0.0, 0.05)), ("step", (0.2, 1.0)))
    )
    raised = make_robot(shapes=(Shape(BODY, 0.05, 0.3),))
    for obstacle, free in ((high, True), (low, True), (step, False)):
        engine = Engine(make_world(raised, wall_at=9.0, others=(obstacle,), physics=physics))
        for _ in range(50):
            engine.move({0: drive(0.5)})
        assert (engine.truth(0).x > 2.0) is free


def test_a_robot_drives_along_a_wall_under_a_beam() -> None:
    """Touching a wall, a robot still passes under what hangs above it: only walls at its height hold it back."""
    beam = Obstacle("beam", Pose2(2.8, 1.0, 0.0), (Shape(BODY, 0.5, 1.0),))
    engine = Engine(make_world(make_robot(2.5, yaw=math.pi / 2, drive="omni"), others=(beam,)))
    for _ in range(40):
        engine.move({0: drive(0.5, 0.0, -0.5)})
    assert engine.truth(0).y > 1.8
    assert engine.truth(0).x == pytest.approx(2.8, abs=0.01)
