"""What the simulator tells views of the world besides its map."""

from collections.abc import Iterator

import pytest

from support.small_worlds import make_box, make_robot, make_world
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.nodes.simulator.queries import serve_shapes
from zteam.services.simulator import ObstaclesReply, ShapesReply
from zteam.sim import Engine


@pytest.fixture
def bus() -> Iterator[Bus]:
    """A bus in memory."""
    bus = MemoryHub().bus()
    yield bus
    bus.close()


def test_robots_have_their_outlines_and_models_their_names(bus: Bus) -> None:
    """`erratic` is known in every world; a robot that leaves is told no more."""
    world = make_world(make_robot())
    engine = Engine(world)
    serve_shapes(bus, world, engine)
    reply = bus.ask("sim/shapes", ShapesReply, NoRequest())
    assert (sorted(reply.robots), reply.models) == ([0], ["erratic"])
    assert all(len(polygon) >= 3 for polygon in reply.robots[0].outline)
    engine.remove(0)
    assert bus.ask("sim/shapes", ShapesReply, NoRequest()).robots == {}


def test_an_obstacle_that_is_pushed_is_told_where_it_is(bus: Bus) -> None:
    """A robot drives into a light box: its pose changes, that of the heavy one does not."""
    light, heavy = make_box("light", 0.6, 0.0, mass=0.5), make_box("heavy", 2.0, 2.0)
    world = make_world(make_robot(), others=(light, heavy))
    engine = Engine(world)
    serve_shapes(bus, world, engine)
    before = {each.name: each for each in bus.ask("sim/obstacles", ObstaclesReply, NoRequest()).obstacles}
    assert (before["light"].movable, before["heavy"].movable) == (True, False)
    for _ in range(20):
        engine.step({0: Twist(Vector3(0.5))})
    after = {each.name: each for each in bus.ask("sim/obstacles", ObstaclesReply, NoRequest()).obstacles}
    assert after["light"].x > before["light"].x + 0.1
    assert Pose2(after["heavy"].x, after["heavy"].y, 0.0) == Pose2(2.0, 2.0, 0.0)
