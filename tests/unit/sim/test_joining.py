"""Robots that join and leave: the others do not change, and nothing of a removed one stays."""

from typing import Literal

import pytest

from support.small_worlds import drive, make_box, make_robot, make_world
from zteam.geometry import Pose2
from zteam.sim import Engine, Options

Physics = Literal["dynamic", "stage", "kinematic"]


def test_a_robot_that_takes_a_removed_ones_id_starts_anew() -> None:
    """Between two ticks a robot is removed and another of its id spawned: pose, odometry and command are its own."""
    engine = Engine(make_world(make_robot(), wall_at=50.0))
    for _ in range(5):
        before = engine.step({0: drive(0.5)})
    engine.remove(0)
    engine.spawn(0, make_robot(-3.0, 1.0, 0.5))
    seen = engine.step({}).robots[0]
    assert seen.truth == Pose2(-3.0, 1.0, 0.5)
    assert seen.odom == Pose2(0.0, 0.0, 0.0)
    assert engine.odom_origin(0) == Pose2(-3.0, 1.0, 0.5)
    assert before.robots[0].truth.x == pytest.approx(0.25)


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
def test_a_stalled_robot_stays_stalled_while_another_comes(physics: Physics) -> None:
    """A blocked robot is observed as stalled also right after another was spawned."""
    engine = Engine(make_world(make_robot()), options=Options(physics=physics))
    for _ in range(50):
        engine.move({0: drive(0.8)})
    assert engine.standing().stalled[0]
    engine.spawn(1, make_robot(-3.0))
    assert engine.observe().robots[0].stall


def test_what_slides_slides_on_while_a_robot_comes() -> None:
    """A pushed box goes as far (but for contacts found anew) with a spawn in between as without."""
    ends = []
    for spawns in (False, True):
        world = make_world(make_robot(), wall_at=50.0, others=(make_box("box", 0.5, 0.0, mass=5.0),))
        engine = Engine(world)
        for _ in range(10):
            engine.move({0: drive(1.0)})
        engine.place(0, Pose2(0.0, 3.0, 0.0))
        start = engine.observe().pushed["box"].x
        if spawns:
            engine.spawn(1, make_robot(-20.0))
        for _ in range(10):
            engine.move({})
        ends.append(engine.observe().pushed["box"].x)
        assert ends[-1] > start + 0.02
    assert ends[1] == pytest.approx(ends[0], abs=0.005)


def test_a_large_command_is_limited_not_refused() -> None:
    """Finite numbers with a sum that is not finite are a valid command."""
    seen = Engine(make_world(make_robot(), wall_at=50.0)).step({0: drive(1e308, 1e308)}).robots[0]
    assert seen.velocity[0] == pytest.approx(1.0)
