"""With any commands, numbers stay finite, and no robot ends inside a wall."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from support.small_worlds import drive, is_occupied, make_maze, make_robot
from zteam.sim import Engine, Options
from zteam.simulator.world.model import Limits

FAST = Limits(x=(-30.0, 30.0), y=(-30.0, 30.0), yaw=(-20.0, 20.0))
SPEEDS = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([30.0, -30.0, 1e300]))


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
@given(
    seed=st.integers(0, 50),
    commands=st.lists(st.tuples(SPEEDS, SPEEDS, SPEEDS, st.integers(1, 12)), min_size=1, max_size=12),
)
@examples(25)
def test_no_command_sequence_breaks_a_robot_or_a_wall(
    physics: Any, seed: int, commands: list[tuple[float, float, float, int]]
) -> None:
    """In a maze, three robots under any commands stay finite, outside of walls, and within their reach."""
    robots = (
        make_robot(0.0, 0.0),
        make_robot(-0.5, -0.5, 0.7, drive="omni", velocity=FAST),
        make_robot(0.5, 0.5, 2.0, velocity=FAST),
    )
    world = make_maze(*robots, seed=seed)
    (plan,) = world.floorplans
    engine = Engine(world, options=Options(physics=physics, odom_alphas=(0.1, 0.1, 0.1, 0.1), gaussian_noise=0.01))
    for v, vy, w, ticks in commands:
        for tick in range(ticks):
            engine.move({i: drive(v, w if i != 1 else -w, vy) for i in range(3)} if tick % 3 == 0 else {})
        seen = engine.observe()
        for one in seen.robots.values():
            assert all(map(math.isfinite, (*one.truth, *one.odom, *one.velocity, *one.joints.positions)))
            assert not is_occupied(plan, one.truth.x, one.truth.y)
            assert max(abs(one.truth.x), abs(one.truth.y)) < 4.0
            ranges = one.readings[0].ranges
            assert np.isfinite(ranges).all()
            assert ((ranges >= 0.0) & (ranges <= 8.0)).all()


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
@given(
    seed=st.integers(0, 50),
    commands=st.lists(
        st.tuples(st.floats(-1.0, 1.0), st.floats(-1.5, 1.5), st.integers(1, 30)), min_size=1, max_size=8
    ),
)
@examples(25)
def test_speed_grows_no_faster_than_its_bound(
    physics: Any, seed: int, commands: list[tuple[float, float, int]]
) -> None:
    """In a maze, whatever a robot hits and slides along: from tick to tick its real speed grows by 0.5 m/s² at most."""
    robot = make_robot(acceleration=Limits(x=(-0.5, 0.5)))
    engine = Engine(make_maze(robot, seed=seed), options=Options(physics=physics))
    last = 0.0
    for v, w, ticks in commands:
        for _ in range(ticks):
            engine.move({0: drive(v, w)})
            x, _, turn = engine.observe().robots[0].velocity
            speed = abs(x)
            # A wall pushes out what sank into it, and a corner that turns into it, 0.28 m from the base.
            assert speed <= last + 0.05 + (0.02 + 0.3 * abs(turn) if physics == "dynamic" else 1e-9)
            last = speed


@given(
    seed=st.integers(0, 50),
    commands=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.5, 1.5)), min_size=5, max_size=60),
)
@examples(25)
def test_refused_moves_leave_no_overlap(seed: int, commands: list[tuple[float, float]]) -> None:
    """Where moves are refused, no corner or edge of a body is ever in a wall or in another body."""
    robots = tuple(make_robot(0.5 * x, 0.5 * y, 0.1) for x in (-1, 1) for y in (-1, 1))
    world = make_maze(*robots, seed=seed)
    (plan,) = world.floorplans
    engine = Engine(world, options=Options(physics="kinematic"))
    rim = [(u, v) for u in np.linspace(-0.1999, 0.1999, 9) for v in (-0.1999, 0.1999)]
    rim += [(v, u) for u, v in rim]
    for v, w in commands:
        engine.move({i: drive(v * (-1) ** i, w) for i in range(4)})
        poses = [engine.truth(i) for i in range(4)]
        for i, (x, y, yaw) in enumerate(poses):
            cos, sin = math.cos(yaw), math.sin(yaw)
            for u, n in rim:
                px, py = x + cos * u - sin * n, y + sin * u + cos * n
                assert not is_occupied(plan, px, py)
                for j, (ox, oy, turn) in enumerate(poses):
                    dx, dy = px - ox, py - oy
                    local = math.cos(turn) * dx + math.sin(turn) * dy, math.cos(turn) * dy - math.sin(turn) * dx
                    assert i == j or max(map(abs, local)) > 0.1999
