"""No body goes through a wall, with any command or push.

The search at large: `ZTEAM_WALL_SETUPS=2000 ZTEAM_WALL_ROOMS=100 pytest -n 2 --timeout 3600 THIS_FILE`.
"""

import math
import os

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
