"""Room for a robot: which poses spawn and place refuse, and with which reason."""

import numpy as np
import pytest

from support.small_worlds import drive, make_box, make_maze, make_robot, make_world
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.sim import Engine, Options
from zteam.world.model import Floorplan, Obstacle, Robot, Shape, World

WALL = ((-4.0, -0.1), (4.0, -0.1), (4.0, 0.1), (-4.0, 0.1))


def hall(*robots: Robot) -> World:
    """A hall of 8 x 8 m between a northern and a southern wall, with a crate that can be pushed, and a bitmap."""
    walls = tuple(
        Obstacle(name, Pose2(0.0, y, 0.0), (Shape(WALL, 0.0, 1.0),)) for name, y in (("north", 4.0), ("south", -4.0))
    )
    pillar = Floorplan("pillar", np.ones((4, 4), bool), (0.1, 0.1), Pose2(-3.0, 0.0, 0.0), 0.0, 1.0)
    return World("hall", 100_000_000, (pillar,), (*walls, make_box("crate", 2.0, 0.0, mass=2.0)), robots)


REFUSED = [
    (Pose2(0.0, 3.8, 0.0), "it would stand in 'north'"),
    (Pose2(1.0, -3.71, 0.78), "it would stand in 'south'"),
    (Pose2(-2.8, 0.2, 0.0), "it would stand in a wall of 'pillar'"),
    (Pose2(2.3, 0.3, 0.0), "it would stand in 'crate'"),
    (Pose2(0.3, 0.0, 0.0), "it would stand in robot 1"),
    (Pose2(0.0, 4.2, 0.0), "outside of the world, which reaches from x -4, y -4.1 to x 4, y 4.1"),
    (Pose2(-60.0, 0.0, 0.0), "outside of the world"),
]


@pytest.mark.parametrize("physics", ["dynamic", "kinematic"])
@pytest.mark.parametrize(("pose", "why"), REFUSED)
def test_where_there_is_no_room_the_reason_is_told(physics: str, pose: Pose2, why: str) -> None:
    """In a wall, a thing, another robot or outside a robot is neither spawned nor placed, unless unchecked."""
    world = hall(make_robot(0.0, -2.0), make_robot())
    engine = Engine(world, options=Options(physics=physics))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=why):
        engine.spawn(5, make_robot(*pose), checked=True)
    with pytest.raises(UsageError, match=why):
        engine.place(0, pose, checked=True)
    assert sorted(engine.robots) == [0, 1]
    assert engine.truth(0) == Pose2(0.0, -2.0, 0.0)
    engine.spawn(5, make_robot(*pose))
    assert engine.truth(5) == pose


def test_where_there_is_room_nothing_is_refused() -> None:
    """Beside a wall, over its own old place, where another has gone, and under what hangs overhead there is room."""
    beam = Obstacle("beam", Pose2(0.0, 2.0, 0.0), (Shape(WALL, 0.5, 1.0),))
    world = hall(make_robot(), make_robot(0.0, -2.0))
    engine = Engine(World("hall", world.interval, world.floorplans, (*world.obstacles, beam), world.robots))
    engine.place(0, Pose2(0.1, 0.1, 0.5), checked=True)
    engine.spawn(2, make_robot(0.0, 3.7), checked=True)
    engine.spawn(3, make_robot(1.0, 2.0), checked=True)
    engine.remove(1)
    engine.spawn(1, make_robot(0.1, -2.0), checked=True)
    for _ in range(10):
        engine.move({1: drive(0.5)})
    with pytest.raises(UsageError, match="in robot 1"):
        engine.place(0, Pose2(0.7, -2.0, 0.0), checked=True)
    engine.place(0, Pose2(0.0, -2.0, 0.0), checked=True)


def test_a_world_that_is_open_has_no_outside() -> None:
    """Where a robot starts beyond all that stands, a place farther out is as good; in a maze it is refused."""
    Engine(make_world(make_robot())).place(0, Pose2(-30.0, 30.0, 0.0), checked=True)
    with pytest.raises(UsageError, match="outside of the world"):
        Engine(make_maze(make_robot())).place(0, Pose2(-4.3, 0.0, 0.0), checked=True)
