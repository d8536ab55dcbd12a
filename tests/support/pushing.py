"""Random worlds in which robots push boxes at walls, and how deep bodies have got into walls and into each other."""

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from support.small_worlds import drive
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.sim import Engine
from zteam.simulator.world.model import Floorplan, Limits, Obstacle, Robot, Shape, World

HALF = 2.0
"""Half of a room's width in metres."""
FAST = Limits(x=(-5.0, 5.0), y=(-5.0, 5.0), yaw=(-6.0, 6.0))

Points = tuple[tuple[float, float], ...]


class Scene(NamedTuple):
    """A world with free room in |x| and |y| below `half` metres, and the speeds of its robots."""

    world: World
    half: tuple[float, float]
    speeds: list[float]


def rectangle(length: float, width: float) -> Points:
    """Corners, counter-clockwise about the origin."""
    x, y = 0.5 * length, 0.5 * width
    return (-x, -y), (x, -y), (x, y), (-x, y)


def make_setup(seed: int) -> Scene:
    """One to four robots in a row behind one to four boxes, which stand before a wall: 0.5 to 5 m/s."""
    random = np.random.default_rng(seed)
    robots, obstacles, speeds = [], [], []
    lane = 1.6
    count = int(random.integers(1, 5))
    for i in range(count):
        y = (i - 0.5 * (count - 1)) * lane
        x = 2.0 - random.uniform(0.0, 0.3)
        for k in range(int(random.integers(1, 3))):
            size = rectangle(*random.uniform(0.1, 0.5, 2))
            reach = math.hypot(*size[2])
            pose = Pose2(x - reach - 0.01, y + random.uniform(-0.2, 0.2), random.choice([0.0, random.uniform(-3, 3)]))
            obstacles.append(_box(f"box_{i}_{k}", pose, size, float(10 ** random.uniform(-1, 2))))
            x -= 2.0 * reach + 0.02
        body = rectangle(*random.uniform(0.1, 0.6, 2))
        x -= math.hypot(*body[2]) + 0.01 + random.uniform(0.0, 0.3)
        robots.append(_robot(f"robot_{i}", Pose2(x, y, random.uniform(-0.3, 0.3)), body, 10 ** random.uniform(-0.5, 2)))
        speeds.append(float(random.uniform(0.5, 5.0)))
    return _close_in(random, robots, obstacles, speeds, (2.0, 4.0), float(random.uniform(0.02, 0.3)))


def make_room(seed: int, robots: int = 6, boxes: int = 20) -> Scene:
    """A closed room of 4 x 4 m, with robots and boxes that do not touch at first."""
    random = np.random.default_rng(seed)
    corners = random.permutation([(x, y) for x in np.arange(-1.6, 1.7, 0.64) for y in np.arange(-1.6, 1.7, 0.64)])
    places = [Pose2(float(x), float(y), float(random.uniform(-3, 3))) for x, y in corners]
    team = [
        _robot(f"robot_{i}", place, rectangle(*random.uniform(0.15, 0.4, 2)), 10 ** random.uniform(0, 2))
        for i, place in enumerate(places[:robots])
    ]
    pushed = [
        _box(f"box_{i}", place, rectangle(*random.uniform(0.1, 0.4, 2)), float(10 ** random.uniform(-1, 2)))
        for i, place in enumerate(places[robots : robots + boxes])
    ]
    speeds = [float(speed) for speed in random.uniform(0.5, 5.0, robots)]
    return _close_in(random, team, pushed, speeds, (HALF, HALF), float(random.uniform(0.02, 0.2)))


def _robot(name: str, pose: Pose2, body: Points, mass: float) -> Robot:
    return Robot(name, "square", pose, (Shape(body, 0.0, 0.3),), (), velocity=FAST, mass=float(mass))


def _box(name: str, pose: Pose2, body: Points, mass: float) -> Obstacle:
    return Obstacle(name, pose, (Shape(body, 0.0, 0.5),), mass)


def _close_in(
    random: np.random.Generator,
    robots: list[Robot],
    boxes: list[Obstacle],
    speeds: list[float],
    half: tuple[float, float],
    thickness: float,
) -> Scene:
    """Walls as four blocks, or as the border of a bitmap."""
    x, y = half
    if random.random() < 0.3:
        columns, rows = (math.ceil(2.0 * h / thickness) for h in half)
        occupied = np.zeros((rows + 2, columns + 2), bool)
        occupied[[0, -1], :] = occupied[:, [0, -1]] = True
        cell = 2.0 * x / columns, 2.0 * y / rows
        plan = Floorplan("walls", occupied, cell, Pose2(-x - cell[0], -y - cell[1], 0.0), 0.0, 1.0)
        return Scene(World("pushing", 100_000_000, (plan,), tuple(boxes), tuple(robots)), half, speeds)
    across = rectangle(thickness, 2.0 * y + 2.0 * thickness)
    along = rectangle(2.0 * x + 2.0 * thickness, thickness)
    walls = [
        Obstacle(name, Pose2(u, v, 0.0), (Shape(body, 0.0, 1.0),))
        for name, u, v, body in (
            ("east", x + 0.5 * thickness, 0.0, across),
            ("west", -x - 0.5 * thickness, 0.0, across),
            ("north", 0.0, y + 0.5 * thickness, along),
            ("south", 0.0, -y - 0.5 * thickness, along),
        )
    ]
    return Scene(World("pushing", 100_000_000, (), (*walls, *boxes), tuple(robots)), half, speeds)


def run(scene: Scene, seed: int, ticks: int, wild: bool) -> Iterator[dict[str, Pose2]]:
    """Drive for `ticks`; after each, where all bodies are.

    Robots drive straight ahead, or, if `wild`, take another turn and sense of driving twice a second.
    """
    random = np.random.default_rng((seed, 1))
    engine = Engine(scene.world)
    commands: dict[int, Twist] = {}
    for tick in range(ticks):
        if tick % 5 == 0:
            for i, speed in enumerate(scene.speeds):
                turn = float(random.uniform(-6, 6)) if wild else float(random.uniform(-0.2, 0.2))
                sense = float(random.choice([1.0, 1.0, -1.0])) if wild else 1.0
                commands[i] = drive(sense * speed, turn)
        engine.move(commands if tick % 2 == 0 else {})
        poses = {robot.name: engine.truth(i) for i, robot in enumerate(scene.world.robots)}
        yield poses | dict(engine.observe().pushed)


def deepest(scene: Scene, poses: dict[str, Pose2]) -> float:
    """Metres by which the farthest corner of any body has left the free room; not a number counts as far out."""
    corners = np.concatenate(list(_corners(scene, poses).values()))
    depth = float((np.abs(corners) - scene.half).max())
    return depth if math.isfinite(depth) else math.inf


def entangled(scene: Scene, poses: dict[str, Pose2]) -> float:
    """Metres by which two bodies lie in each other at most."""
    pairs = itertools.combinations(_corners(scene, poses).values(), 2)
    return max((_overlap(one, other) for one, other in pairs), default=0.0)


def _corners(scene: Scene, poses: dict[str, Pose2]) -> dict[str, np.ndarray]:
    shapes = {one.name: one.shapes[0].points for one in (*scene.world.robots, *scene.world.obstacles)}
    found = {}
    for name, (x, y, yaw) in poses.items():
        turn = np.array(((math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))))
        found[name] = np.array(shapes[name]) @ turn + (x, y)
    return found


def _overlap(one: np.ndarray, other: np.ndarray) -> float:
    """Of two convex polygons, corners (n, 2) counter-clockwise: by the edge that comes nearest to parting them."""
    least = math.inf
    for a, b in ((one, other), (other, one)):
        edges = np.roll(a, -1, axis=0) - a
        outward = np.stack((edges[:, 1], -edges[:, 0]), axis=1) / np.hypot(*edges.T)[:, None]
        least = min(least, float(((outward * a).sum(axis=1) - (b @ outward.T).min(axis=0)).min()))
    return max(0.0, least)
