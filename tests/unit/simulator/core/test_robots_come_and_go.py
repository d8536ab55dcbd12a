"""Robots that come, go and are lifted, whether there is room for them, and things that are pushed."""

import math
from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace

from support.small_worlds import drive, make_box, make_maze, make_robot, make_world
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.sim import Engine, Options
from zteam.simulator.world.model import Floorplan, Limits, Obstacle, Robot, Shape, World


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
def test_a_robot_that_joins_is_seen_and_drives(physics: str) -> None:
    """A spawned robot stands where it says, blocks a laser, and obeys; those before it go on undisturbed."""
    engine = Engine(make_world(make_robot(0.0, -2.0), wall_at=9.0, physics=physics))
    for _ in range(5):
        engine.step({0: drive(0.5, 0.2)})
    before, odom = engine.truth(0), engine.observe().robots[0].odom
    engine.spawn(4, make_robot(before.x, before.y + 2.0))
    assert (engine.truth(0), engine.observe().robots[0].odom) == (before, odom)
    seen = engine.step({4: drive(0.5), 0: drive(0.5, 0.2)})
    assert list(seen.robots) == [0, 4]
    assert seen.robots[4].truth.x == pytest.approx(before.x + 0.05)
    assert seen.robots[0].readings[0].ranges.min() < 2.0
    with pytest.raises(UsageError, match="robot 4 is in this world already"):
        engine.spawn(4, make_robot())


def test_a_robot_that_left_is_gone() -> None:
    """No robot sees it, commands to it are errors, and its id is free again."""
    engine = Engine(make_world(make_robot(), make_robot(2.0)))
    engine.step({})
    engine.remove(1)
    seen = engine.step({})
    assert list(seen.robots) == [0]
    assert seen.robots[0].readings[0].ranges[45] == pytest.approx(3.0, abs=1e-6)
    with pytest.raises(UsageError, match=r"no robot 1 in this world: it has 0$"):
        engine.step({1: drive(0.1)})
    with pytest.raises(UsageError, match="no robot 1"):
        engine.remove(1)
    engine.spawn(1, make_robot(0.0, 2.0))
    assert engine.truth(1) == Pose2(0.0, 2.0, 0.0)


@pytest.mark.parametrize("physics", ["dynamic", "kinematic"])
def test_a_lifted_robot_keeps_its_odometry(physics: str) -> None:
    """After a lift, the odometry goes on as before, and its origin in map makes up for the difference."""
    engine = Engine(make_world(make_robot(0.5, 0.0, 0.3), wall_at=9.0, physics=physics))
    for _ in range(10):
        engine.step({0: drive(0.5, 0.3)})
    odom = engine.observe().robots[0].odom
    engine.place(0, Pose2(-3.0, 1.0, 2.0))
    assert engine.truth(0) == pytest.approx((-3.0, 1.0, 2.0))
    assert engine.observe().robots[0].odom == pytest.approx(odom)
    assert engine.odom_origin(0).compose(odom) == pytest.approx((-3.0, 1.0, 2.0))
    seen = engine.step({0: drive(0.5)}).robots[0]
    assert seen.truth[:2] == pytest.approx((-3.0 + 0.05 * math.cos(2.0), 1.0 + 0.05 * math.sin(2.0)))
    assert engine.odom_origin(0).compose(seen.odom) == pytest.approx(seen.truth)
    with pytest.raises(UsageError, match="not finite"):
        engine.place(0, Pose2(math.nan, 0.0, 0.0))


def test_the_order_of_joining_changes_nothing() -> None:
    """Engines agree in every bit from the first step on, in any order of joining and of commands."""
    robots = {i: make_robot(-1.5 + 0.55 * i, 0.2 * i, 0.7 * i) for i in range(5)}
    first = Engine(make_world(), robots=robots)
    second = Engine(make_world(), robots={})
    for i in (3, 0, 4, 2, 1):
        second.spawn(i, robots[i])
    for tick in range(150):
        commands = {i: drive(0.8, math.sin(tick + i)) for i in robots}
        a, b = first.step(commands), second.step(dict(reversed(commands.items())))
        for i in robots:
            assert a.robots[i].truth == b.robots[i].truth
            assert a.robots[i].readings[0].ranges.tobytes() == b.robots[i].readings[0].ranges.tobytes()


def test_light_things_are_pushed_and_heavy_ones_stall_a_robot() -> None:
    """A light box gives way and is seen where it went; it stops when it is not pushed. A heavy one does not budge."""
    light = Engine(make_world(make_robot(), others=(make_box("box", 0.8, 0.0, mass=3.0),)))
    for _ in range(40):
        seen = light.step({0: drive(0.4)})
    box, robot = seen.pushed["box"], seen.robots[0]
    assert box.x > 1.2
    assert box.x - robot.truth.x == pytest.approx(0.4, abs=0.02)
    assert not robot.stall
    for _ in range(5):
        seen = light.step({0: drive(-0.4)})
    assert seen.robots[0].readings[0].ranges[45] == pytest.approx(
        seen.pushed["box"].x - 0.2 - seen.robots[0].truth.x, abs=1e-3
    )
    rest = [light.step({}).pushed["box"] for _ in range(5)]
    assert rest[0] == rest[-1]
    heavy = Engine(make_world(make_robot(), others=(make_box("box", 0.8, 0.0, mass=2000.0),)))
    for _ in range(40):
        seen = heavy.step({0: drive(0.4)})
    assert seen.pushed["box"].x == pytest.approx(0.8, abs=0.01)
    assert seen.robots[0].stall


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_a_larger_box_turns_on_for_longer(size: float) -> None:
    """Friction slows the turn of a square by 2.3 g µ over its side: as much as its weight does that lies evenly."""
    box = make_box("box", 0.4 + 0.5 * size, 0.2 + 0.3 * size, size=size, mass=3.0)
    robot = make_robot(mass=100.0, velocity=Limits(x=(-5.0, 5.0)))
    # Ticks of one step of the solver.
    engine = Engine(replace(make_world(robot, wall_at=50.0, others=(box,)), interval=20_000_000))
    yaws = [engine.step({0: drive(2.0 if tick < 5 else -5.0)}).pushed["box"].yaw for tick in range(12)]
    slowing = -np.diff(np.diff(yaws)) / 0.02**2
    assert np.median(slowing[-5:]) == pytest.approx(2.296 * 0.5 * 9.81 / size, rel=0.05)


def test_where_moves_are_refused_nothing_is_pushed() -> None:
    """With Stage's collisions a pushable box is an obstacle like any other."""
    engine = Engine(make_world(make_robot(), others=(make_box("box", 0.8, 0.0, mass=3.0),), physics="stage"))
    for _ in range(30):
        seen = engine.step({0: drive(0.4)})
    assert seen.pushed["box"].x == 0.8
    assert seen.robots[0].stall
    assert seen.robots[0].truth.x < 0.41


def test_an_empty_world_goes_on() -> None:
    """Without robots ticks still count and nothing breaks, until one joins."""
    for physics in ("dynamic", "stage", "kinematic"):
        engine = Engine(make_world(physics=physics), robots={})
        engine.step({})
        engine.spawn(0, make_robot())
        assert engine.step({0: drive(0.5)}).robots[0].truth.x == pytest.approx(0.05)
        assert engine.tick == 2


def test_commands_that_are_not_finite_are_refused() -> None:
    """NaN and inf are errors that name the robot, and the robot has not moved."""
    engine = Engine(make_world(make_robot()))
    for value in (math.nan, math.inf):
        with pytest.raises(UsageError, match="robot 0 is not finite"):
            engine.step({0: drive(value)})
    assert engine.truth(0) == (0.0, 0.0, 0.0)


def test_an_observation_keeps_its_instant() -> None:
    """What is read from an observation later is still what was sensed then."""
    engine = Engine(make_world(make_robot()))
    early = engine.step({0: drive(0.5)})
    for _ in range(5):
        engine.step({0: drive(0.5)})
    assert early.robots[0].truth.x == pytest.approx(0.05)
    assert early.robots[0].joints.positions == pytest.approx((1.0, 1.0))
    assert early.robots[0].readings[0].ranges[45] == pytest.approx(2.95, abs=1e-6)
    assert np.isfinite(early.robots[0].readings[0].ranges).all()


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
    assert engine.observe_bases().robots[0].stall
    engine.spawn(1, make_robot(-3.0))
    assert engine.observe().robots[0].stall


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
@pytest.mark.parametrize("other", [0, 9])
def test_robots_drive_on_while_another_comes_and_goes(physics: Physics, other: int) -> None:
    """To the bit as without it: poses, odometry with its errors, velocities, wheels and how long a command counts."""
    slowly = Limits(x=(-1.0, 1.0), yaw=(-1.0, 1.0))
    runs = []
    for comes in (False, True):
        robots = {3: make_robot(acceleration=slowly), 5: make_robot(0.0, 5.0, 1.0, acceleration=slowly)}
        options = Options(physics=physics, odom_alphas=(0.1, 0.1, 0.1, 0.1))
        engine = Engine(make_world(wall_at=50.0), robots=robots, options=options)
        engine.place(5, Pose2(0.0, 7.0, 0.5))
        seen = [engine.step(dict.fromkeys(robots, drive(0.5, 0.3))) for _ in range(8)]
        if comes:
            engine.spawn(other, make_robot(-20.0))
        seen += [engine.observe(), engine.step({}), engine.step({})]
        if comes:
            engine.remove(other)
        seen += [engine.observe(), engine.step({})]
        told = [each.robots[i] for each in seen for i in robots]
        runs.append([(each.truth, each.odom, each.velocity, each.joints) for each in told])
        runs.append([engine.odom_origin(i) for i in robots])
    assert runs[:2] == runs[2:]


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
