"""Draws office.png, the floor of office.world: run `python worlds/office.py` after a change and commit both files.

The picture is 1000 × 1000 pixels of 5 cm. Coordinates are metres from the lower left corner of the building, x to the
right and y up: those of the world's map. What a robot can bump into has a colour whose red is at most 127; floors and
doors are lighter and only for the eye.

    +------+-+---------------+-+------+
    |office| |    offices    | |office|    Corridors of 2.5 m between the outer rooms and the core; through the core
    |------| +---------------+ |------|    the main corridor (4 m) from west to east, and one (3 m) from south to
    |office| |open   |canteen| |office|    north.
    |lounge  main corridor      lounge|
    |office| |open   |meeting| |office|
    |------| +---------------+ |------|
    |office| |train|recep|pro| |office|
    +------+-+---------------+-+------+
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Color = tuple[int, int, int]

PIXELS_PER_METRE = 20
SIDE = 50.0
OUTER, INNER = 0.3, 0.15
"""Thickness of walls, metres."""

CARPET: Color = (233, 239, 246)
CORRIDOR: Color = (251, 250, 246)
TILES: Color = (229, 240, 233)
WOOD: Color = (247, 237, 220)
DOOR: Color = (200, 196, 190)

WALL: Color = (42, 42, 48)
GLASS: Color = (92, 146, 190)
DESK: Color = (126, 94, 62)
CHAIR: Color = (104, 108, 124)
CABINET: Color = (84, 88, 100)
SOFA: Color = (120, 72, 76)
PLANT: Color = (74, 126, 78)
MACHINE: Color = (62, 74, 88)


class Plan:
    """A picture that is drawn in metres."""

    def __init__(self) -> None:
        pixels = round(SIDE * PIXELS_PER_METRE)
        self.pixels: NDArray[np.uint8] = np.zeros((pixels, pixels, 3), np.uint8)
        """Row 0 at the bottom, until `image` turns it over."""

    def image(self) -> Image.Image:
        """The picture, its upper row first."""
        return Image.fromarray(self.pixels[::-1])

    def fill(self, x0: float, y0: float, x1: float, y1: float, color: Color) -> None:
        """A rectangle between two opposite corners."""
        left, right = sorted(round(x * PIXELS_PER_METRE) for x in (x0, x1))
        bottom, top = sorted(round(y * PIXELS_PER_METRE) for y in (y0, y1))
        self.pixels[bottom:top, left:right] = color

    def box(self, x: float, y: float, width: float, depth: float, color: Color) -> None:
        """A rectangle about a centre."""
        self.fill(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2, color)

    def disc(self, x: float, y: float, radius: float, color: Color) -> None:
        """A circle."""
        self.arc(x, y, (0.0, radius), 0, 0, color)

    def arc(self, x: float, y: float, radii: tuple[float, float], x_side: int, y_side: int, color: Color) -> None:
        """The part of a ring on the given sides (-1, 1; 0 both) of its centre: a quarter, a half or all of it."""
        left, right, bottom, top = (
            max(0, round(edge * PIXELS_PER_METRE)) for edge in (x - radii[1], x + radii[1], y - radii[1], y + radii[1])
        )
        dx = (np.arange(left, right) + 0.5)[None, :] / PIXELS_PER_METRE - x
        dy = (np.arange(bottom, top) + 0.5)[:, None] / PIXELS_PER_METRE - y  # of the pixels' centres
        distance = np.hypot(dx, dy)
        # The margin keeps rounding, which differs between machines, from deciding about a pixel.
        ring = (radii[0] - 1e-9 <= distance) & (distance <= radii[1] + 1e-9)
        inside = ring & (dx * x_side >= -1e-9) & (dy * y_side >= -1e-9)
        self.pixels[bottom:top, left:right][inside] = color

    def door_x(self, x: float, y: float, opens: int, width: float = 1.1) -> None:
        """A doorway in a wall along x whose lower face is at y; the leaf opens up (1) or down (-1)."""
        self.fill(x, y, x + width, y + INNER, CORRIDOR)
        hinge = y + INNER if opens > 0 else y
        self.arc(x, hinge, (width - 0.05, width), 1, opens, DOOR)
        self.fill(x, hinge, x + 0.05, hinge + opens * width, DOOR)

    def door_y(self, x: float, y: float, opens: int, width: float = 1.1) -> None:
        """A doorway in a wall along y whose left face is at x; the leaf opens right (1) or left (-1)."""
        self.fill(x, y, x + INNER, y + width, CORRIDOR)
        hinge = x + INNER if opens > 0 else x
        self.arc(hinge, y, (width - 0.05, width), opens, 1, DOOR)
        self.fill(hinge, y, hinge + opens * width, y + 0.05, DOOR)

    def room(self, x0: float, y0: float, x1: float, y1: float, floor: Color) -> None:
        """Four walls just inside a rectangle, and a floor."""
        self.fill(x0, y0, x1, y1, WALL)
        self.fill(x0 + INNER, y0 + INNER, x1 - INNER, y1 - INNER, floor)


def chair(plan: Plan, x: float, y: float) -> None:
    """A swivel chair."""
    plan.disc(x, y, 0.24, CHAIR)


def plant(plan: Plan, *places: tuple[float, float]) -> None:
    """Potted plants."""
    for x, y in places:
        plan.disc(x, y, 0.28, PLANT)


def table(plan: Plan, x: float, y: float, width: float, depth: float, chairs: int) -> None:
    """A meeting table with `chairs` along each long side."""
    plan.box(x, y, width, depth, DESK)
    for i in range(chairs):
        along = (i + 0.5) / chairs - 0.5
        for side in (-1, 1):
            if width >= depth:
                chair(plan, x + along * width, y + side * (depth / 2 + 0.35))
            else:
                chair(plan, x + side * (width / 2 + 0.35), y + along * depth)


def round_table(plan: Plan, x: float, y: float, radius: float = 0.6) -> None:
    """A round table with four chairs."""
    plan.disc(x, y, radius, DESK)
    for dx, dy in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        chair(plan, x + dx * (radius + 0.35), y + dy * (radius + 0.35))


def shell(plan: Plan) -> None:
    """Outer walls with windows, and the floor of the corridors."""
    plan.fill(0, 0, SIDE, SIDE, WALL)
    plan.fill(OUTER, OUTER, SIDE - OUTER, SIDE - OUTER, CORRIDOR)
    for start in np.arange(1.0, 48.0, 3.0):
        for face in (0.1, SIDE - 0.2):
            plan.fill(start, face, start + 2.0, face + 0.1, GLASS)
            plan.fill(face, start, face + 0.1, start + 2.0, GLASS)


def side_office(plan: Plan, y0: float, y1: float, east: bool, shared: bool) -> None:
    """An office on the west or east side: one or two desks at the windows, cabinets, a visitors' table."""

    def at(across: float) -> float:
        # Metres from the outer face of the building.
        return SIDE - across if east else across

    plan.fill(at(OUTER), y0, at(7.0), y1, WALL)
    plan.fill(at(OUTER), y0 + INNER, at(7.0 - INNER), y1, CARPET)
    plan.door_y(43.0 if east else 7.0 - INNER, y0 + 0.5, 1 if east else -1)
    for y in (y0 + 1.9, y1 - 1.5) if shared else ((y0 + y1) / 2,):
        plan.fill(at(1.6), y - 0.9, at(2.4), y + 0.9, DESK)
        chair(plan, at(1.2), y)
    plan.fill(at(3.4), y1 - 0.5, at(5.4), y1, CABINET)
    round_table(plan, at(4.7), y1 - 2.4, 0.4)
    plant(plan, (at(0.7), y1 - 0.4))


def side_rooms(plan: Plan) -> None:
    """The offices west and east, and between them the lounges at the ends of the main corridor."""
    for east in (False, True):
        for y0, y1, shared in (
            (OUTER, 7.0, True),
            (7.0, 13.0, False),
            (13.0, 19.0, True),
            (31.0, 37.0, True),
            (37.0, 43.0, False),
            (43.0, SIDE - OUTER, True),
        ):
            side_office(plan, y0, y1, east, shared)
        x = [SIDE - value if east else value for value in (0.3, 1.2, 1.9, 2.7, 7.0)]
        plan.fill(x[0], 19.0, x[4], 19.0 + INNER, WALL)
        for y in (22.0, 28.0):
            plan.fill(x[0], y - 1.1, x[1], y + 1.1, SOFA)
            plan.fill(x[2], y - 0.6, x[3], y + 0.6, DESK)
        plant(plan, (x[1], 19.7), (x[1], 25.0), (x[1], 30.4))
        plan.fill(x[3], 30.4, x[3] + (-2.0 if east else 2.0), 31.0, MACHINE)


def north_rooms(plan: Plan) -> None:
    """Offices and a boardroom along the north side."""
    for i in range(5):
        x0, x1 = 9.5 + 6.2 * i, 15.7 + 6.2 * i
        plan.room(x0, 43.0, x1, SIDE - OUTER + INNER, WOOD if i == 2 else CARPET)
        plan.door_x(x0 + 0.5, 43.0, 1)
        plant(plan, (x1 - 0.6, SIDE - OUTER - 0.4))
        if i == 2:
            table(plan, (x0 + x1) / 2, 46.6, 3.6, 1.3, 4)
            plan.fill(x1 - 0.65, 44.0, x1 - INNER, 46.4, CABINET)
            continue
        for x in (x0 + 1.7, x1 - 1.7):
            plan.fill(x - 0.9, 47.6, x + 0.9, 48.4, DESK)
            chair(plan, x, 48.8)
        plan.fill(x1 - 0.6, 43.6, x1 - INNER, 45.6, CABINET)
        round_table(plan, x0 + 3.4, 45.3, 0.4)
    plan.fill(9.5, SIDE - OUTER, 40.5, SIDE - OUTER + INNER, WALL)
    for start in np.arange(10.0, 40.0, 3.0):
        plan.fill(start, SIDE - 0.2, start + 2.0, SIDE - 0.1, GLASS)


def south_rooms(plan: Plan) -> None:
    """A training room, the reception, a project room."""
    plan.room(9.5, OUTER - INNER, 18.0, 7.0, CARPET)
    plan.door_x(16.2, 7.0 - INNER, -1)
    plan.fill(10.6, 1.0, 11.2, 5.0, MACHINE)
    for x in (12.7, 14.6, 16.5):
        plan.fill(x - 0.35, 0.9, x + 0.35, 4.9, DESK)
        for y in (1.6, 2.9, 4.2):
            chair(plan, x + 0.65, y)
    plan.room(32.0, OUTER - INNER, 40.5, 7.0, CARPET)
    plan.door_x(32.6, 7.0 - INNER, -1)
    table(plan, 36.4, 2.7, 3.2, 1.6, 4)
    plan.fill(39.75, 1.0, 40.35, 5.0, CABINET)
    plan.fill(34.4, 6.4, 39.0, 6.85, CABINET)
    plant(plan, (32.7, 0.9), (10.1, 6.3))
    reception(plan)


def reception(plan: Plan) -> None:
    """A hall open to the corridor: a curved counter, sofas, pillars, the glazed entrance."""
    plan.fill(18.0, OUTER, 32.0, 7.0, WOOD)
    plan.fill(22.0, 0.05, 28.0, 0.25, GLASS)
    plan.fill(23.5, OUTER, 26.5, 2.0, DOOR)
    plan.arc(30.0, 3.6, (1.7, 2.3), -1, 0, DESK)
    chair(plan, 29.3, 3.0)
    chair(plan, 29.3, 4.2)
    plan.fill(31.4, 2.4, 32.0, 4.8, CABINET)
    plan.fill(18.1, 1.2, 19.0, 3.6, SOFA)
    plan.fill(19.6, 0.4, 21.6, 1.3, SOFA)
    plan.disc(20.4, 2.6, 0.5, DESK)
    for x in (21.0, 29.0):
        plan.box(x, 6.8, 0.5, 0.5, WALL)
    plant(plan, (18.6, 0.8), (18.6, 6.3), (31.5, 6.3), (21.9, 0.7), (28.1, 0.7))


def open_plan_south(plan: Plan) -> None:
    """South-west quarter: islands of four desks, two telephone booths, pillars."""
    plan.room(9.5, 9.5, 23.5, 23.0, CARPET)
    plan.fill(15.5, 23.0 - INNER, 17.5, 23.0, CORRIDOR)
    plan.fill(9.5, 15.0, 9.5 + INNER, 16.8, CORRIDOR)
    plan.fill(23.5 - INNER, 13.2, 23.5, 15.0, CORRIDOR)
    for x in (12.9, 19.6):
        for y in (12.4, 16.2, 20.0):
            table(plan, x, y, 3.2, 1.6, 2)
            plan.fill(x - 1.6, y - 0.05, x + 1.6, y + 0.05, CABINET)
            plan.fill(x - 0.05, y - 0.8, x + 0.05, y + 0.8, CABINET)
    for y in (12.4, 20.0):
        plan.box(16.25, y, 0.4, 0.4, WALL)
    plan.fill(22.9, 16.2, 23.35, 19.4, CABINET)
    plan.fill(10.2, 9.65, 15.0, 10.1, CABINET)
    plant(plan, (10.1, 22.4), (22.9, 22.4), (22.9, 10.1))


def open_plan_north(plan: Plan) -> None:
    """North-west quarter: long benches, a printer's corner."""
    plan.room(9.5, 27.0, 23.5, 40.5, CARPET)
    plan.fill(13.6, 27.0, 15.6, 27.0 + INNER, CORRIDOR)
    plan.fill(9.5, 33.3, 9.5 + INNER, 35.1, CORRIDOR)
    plan.fill(23.5 - INNER, 33.3, 23.5, 35.1, CORRIDOR)
    for x in (12.2, 16.5, 20.8):
        for y in (30.9, 37.2):
            table(plan, x, y, 1.6, 4.4, 3)
            plan.fill(x - 0.05, y - 2.2, x + 0.05, y + 2.2, CABINET)
    for x in (14.35, 18.65):
        plan.box(x, 34.1, 0.4, 0.4, WALL)
    plan.fill(17.2, 27.15, 21.0, 27.6, CABINET)
    plan.fill(22.6, 39.5, 23.35, 40.35, MACHINE)
    plant(plan, (10.1, 27.7), (10.1, 39.8), (22.9, 27.7))


def meeting_rooms(plan: Plan) -> None:
    """South-east quarter: four meeting rooms, doors to the corridors on both sides."""
    for y0, y1 in ((9.5, 16.3), (16.3 - INNER, 23.0)):
        middle = (y0 + y1) / 2
        plan.room(26.5, y0, 33.5, y1, CARPET)
        plan.room(33.5 - INNER, y0, 40.5, y1, WOOD)
        plan.door_y(26.5, y0 + 0.6, 1)
        plan.door_y(40.5 - INNER, y0 + 0.6, -1)
        plan.fill(28.4, y1 - 0.6, 31.6, y1 - INNER, CABINET)
        plant(plan, (33.0, y0 + 0.6), (33.9, y0 + 0.6))
        if y0 < 10:
            table(plan, 30.2, middle, 3.6, 1.4, 4)
            table(plan, 36.9, middle, 1.4, 3.6, 4)
        else:
            round_table(plan, 30.2, middle, 0.9)
            plan.fill(33.5, middle - 1.2, 34.4, middle + 1.2, SOFA)
            plan.fill(35.6, y1 - 1.05, 38.2, y1 - INNER, SOFA)
            plan.disc(36.4, middle + 0.2, 0.55, DESK)


def canteen(plan: Plan) -> None:
    """North-east quarter: the canteen with its kitchen counter; behind it a server room, a store and a workshop."""
    plan.room(26.5, 27.0, 40.5, 36.2, TILES)
    for x in (29.0, 35.4):
        plan.fill(x, 27.0, x + 2.4, 27.0 + INNER, CORRIDOR)
    plan.fill(26.5, 31.2, 26.5 + INNER, 33.0, CORRIDOR)
    plan.fill(39.7, 28.2, 40.35, 35.2, MACHINE)
    plan.fill(37.6, 30.0, 38.3, 33.6, DESK)
    for x in (29.6, 32.4, 35.2):
        for y in (30.2, 33.6):
            round_table(plan, x, y)
    plant(plan, (27.1, 27.6), (27.1, 35.6), (33.4, 27.6))
    for x0, x1 in ((26.5, 31.4), (31.4 - INNER, 35.6), (35.6 - INNER, 40.5)):
        plan.room(x0, 36.2 - INNER, x1, 40.5, TILES)
        plan.door_x(x1 - 1.7, 40.5 - INNER, -1)
    for y in (37.3, 38.9):
        plan.fill(26.9, y - 0.3, 29.3, y + 0.3, MACHINE)
    plan.fill(31.4, 36.6, 31.9, 40.0, CABINET)
    plan.fill(32.4, 36.2, 35.4, 36.7, CABINET)
    plan.fill(36.4, 37.4, 38.6, 38.4, DESK)
    plan.fill(39.85, 36.4, 40.35, 38.4, CABINET)


def corridors(plan: Plan) -> None:
    """What stands in the corridors; more than 2 m stay free beside it."""
    plan.fill(23.5, 29.0, 24.0, 31.0, CABINET)
    plan.fill(26.0, 19.4, 26.5, 21.4, MACHINE)
    plant(plan, (7.4, 0.7), (42.6, 0.7), (7.4, 49.3), (42.6, 49.3), (23.2, 9.2), (26.8, 40.8))


def draw() -> Image.Image:
    """The whole floor, 1000 × 1000 pixels RGB."""
    plan = Plan()
    for part in (shell, side_rooms, north_rooms, south_rooms, open_plan_south, open_plan_north, meeting_rooms, canteen):
        part(plan)
    corridors(plan)
    return plan.image()


if __name__ == "__main__":
    draw().save(Path(__file__).with_suffix(".png"), optimize=True)
