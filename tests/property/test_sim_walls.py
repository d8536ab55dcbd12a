"""No body goes through a wall, with any command or push.

The search at large: `ZTEAM_WALL_SETUPS=2000 ZTEAM_WALL_ROOMS=100 pytest -n 2 --timeout 3600 THIS_FILE`.
"""

import math
import os

import msgspec

from support.examples import SHARE
from support.pushing import Scene, deepest, entangled, make_room, make_setup, run

SETUPS = int(os.environ.get("ZTEAM_WALL_SETUPS", math.ceil(25 * SHARE)))
ROOMS = int(os.environ.get("ZTEAM_WALL_ROOMS", "1"))
DEEP = 0.015
"""Metres that a corner may get into a wall: less than the thinnest wall."""
PRESSED = 0.03
"""Metres that two bodies may be pressed into each other."""


def _check(scene: Scene, seed: int, ticks: int, wild: bool) -> None:
    for tick, poses in enumerate(run(scene, seed, ticks, wild)):
        assert deepest(scene, poses) < DEEP, (seed, tick)
        if tick % 20 == 9:
            assert entangled(scene, poses) < PRESSED, (seed, tick)


def test_nothing_is_pushed_through_a_wall() -> None:
    """Boxes from 0.1 m, walls from 0.02 m, 0.5 to 5 m/s, all masses: no corner of box or robot comes out behind."""
    for seed in range(SETUPS):
        _check(make_setup(seed), seed, 30, wild=False)


def test_nothing_leaves_a_closed_room() -> None:
    """Six robots drive at random among twenty boxes: all stay in the room, and no body is pressed into another."""
    for seed in range(ROOMS):
        _check(make_room(seed), seed, 120, wild=True)


def test_robots_alone_stay_in_their_room() -> None:
    """With nothing to push the solver has more of its way, but no robot's middle leaves the room."""
    for seed in range(SETUPS):
        scene = make_setup(seed)
        walls = tuple(obstacle for obstacle in scene.world.obstacles if obstacle.mass is None)
        scene = scene._replace(world=msgspec.structs.replace(scene.world, obstacles=walls))
        for tick, poses in enumerate(run(scene, seed, 40, wild=False)):
            out = max(max(abs(x) - scene.half[0], abs(y) - scene.half[1]) for x, y, _ in poses.values())
            assert out < 0.0, (seed, tick)


def test_pushing_repeats() -> None:
    """The same scene twice gives the same poses to the last bit."""
    first, again = ([*run(make_setup(7), 7, 25, wild=True)] for _ in range(2))
    assert first == again
