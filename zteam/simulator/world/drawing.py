"""Pictures of a world: floor plans, obstacles, robots, what their lasers see, and their ways, as SVG or PNG."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.canvas import Pixels, Svg
from zteam.errors import UsageError
from zteam.geometry import Point2
from zteam.simulator.world.colors import find_color
from zteam.simulator.world.model import Floorplan, Obstacle, Robot, World
from zteam.simulator.world.placing import place_points, place_shape, plan_corners

Points = NDArray[np.float64]
"""(n, 2): x, y in `map`, metres."""

MAX_WIDTH = 8000
_MARGIN = 0.5
"""Metres around everything."""
_FOOTER = 24
"""Pixels below the map, for the scale bar."""
_GROUND, _INK, _UNKNOWN = "#ffffff", "#212121", (0.6, 0.6, 0.6)
_TEXT = 13
_WAYS = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d00", "#000000"
"""Colours of ways: those of Okabe and Ito, which differ for colour-blind eyes too."""


class Fan(NamedTuple):
    """What one laser sees: its place, and where its beams end, in `map`."""

    origin: Point2
    ends: Sequence[Point2]
    hits: Sequence[bool]
    """Whether each beam met something."""


class _View(NamedTuple):
    """The part of the map that is drawn."""

    left: float
    top: float
    scale: float
    """Pixels a metre."""
    width: int
    height: int

    def pixels(self, points: Points) -> list[list[float]]:
        found: list[list[float]] = ((points - (self.left, self.top)) * (self.scale, -self.scale)).tolist()
        return found


def draw_world(
    world: World,
    path: Path,
    *,
    width: int = 1200,
    fans: Mapping[int, Sequence[Fan]] = {},
    tracks: Mapping[int, Points] = {},
) -> None:
    """Draw a world into an .svg or .png file, with its robots' fans by id, and the ways that robots have driven.

    Raises UsageError."""
    suffix = path.suffix.lower()
    if suffix not in (".svg", ".png"):
        raise UsageError(f"{path}: pictures are .svg or .png")
    if not 50 <= width <= MAX_WIDTH:
        raise UsageError(f"a picture is 50 to {MAX_WIDTH} pixels wide, not {width}")
    view = _make_view(world, width, tracks)
    canvas = Svg(view.width, view.height) if suffix == ".svg" else Pixels(view.width, view.height, shrink=True)
    _draw(canvas, view, world, fans, tracks)
    try:
        canvas.save(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot write this picture: {error.strerror or error}") from None


def _make_view(world: World, width: int, tracks: Mapping[int, Points]) -> _View:
    things: list[Obstacle | Robot] = [*world.obstacles, *world.robots]
    corners = [*map(plan_corners, world.floorplans)]
    corners += [place_shape(thing.pose, shape) for thing in things for shape in thing.shapes]
    corners += [np.array([robot.pose[:2]]) for robot in world.robots] + [*tracks.values()]
    points = np.vstack(corners or [np.zeros((1, 2))])
    (left, bottom), (right, top) = (points.min(axis=0) - _MARGIN).tolist(), (points.max(axis=0) + _MARGIN).tolist()
    scale = width / (right - left)
    return _View(left, top, scale, width, min(MAX_WIDTH, math.ceil((top - bottom) * scale) + _FOOTER))


def _draw(
    canvas: Svg | Pixels,
    view: _View,
    world: World,
    fans: Mapping[int, Sequence[Fan]],
    tracks: Mapping[int, Points],
) -> None:
    """Everything from the ground up: later things lie on top."""
    for plan in world.floorplans:
        _draw_plan(canvas, view, plan)
    seen = [(fan, _css(world.robots[robot_id].color)) for robot_id, own in fans.items() for fan in own]
    for fan, color in seen:
        canvas.area(view.pixels(np.array([fan.origin, *fan.ends])), color, opacity=0.18)
    for obstacle in world.obstacles:
        for shape in obstacle.shapes:
            canvas.area(view.pixels(place_shape(obstacle.pose, shape)), _css(shape.color), _INK, 0.9)
    labels = []
    for i, (robot_id, track) in enumerate(tracks.items()):
        color, places = _WAYS[i % len(_WAYS)], view.pixels(track)
        canvas.line(places, color)
        canvas.dot(places[0], 3.0, color)
        labels.append(([places[-1][0], places[-1][1] - 5.0], str(robot_id)))
    for robot_id, robot in enumerate(world.robots):
        for shape in sorted(robot.shapes, key=lambda shape: shape.z_max):
            canvas.area(view.pixels(place_shape(robot.pose, shape)), _css(shape.color), _INK)
        size = max((math.hypot(*point) for shape in robot.shapes for point in shape.points), default=0.2)
        nose = size * np.array([(0.95, 0.0), (0.35, 0.3), (0.35, -0.3)])
        canvas.area(view.pixels(place_points(robot.pose, nose)), _GROUND, _INK)
        (above,) = view.pixels(np.array([(robot.pose.x, robot.pose.y + 1.2 * size)]))
        labels.append((above, str(robot_id)))
    for fan, color in seen:
        for place in view.pixels(np.array(fan.ends)[np.array(fan.hits, bool)]):
            canvas.dot(place, 1.2, color)
    for place, text in labels:
        canvas.text(place, text, _TEXT, _INK, centred=True)
    # A scale bar of 1, 2 or 5 times a power of ten, a sixth of the width at most.
    most = view.width / view.scale / 6
    power = 10.0 ** math.floor(math.log10(most))
    length = max(step * power for step in (1, 2, 5) if step * power <= most)
    bottom, end = view.height - 12, 12 + length * view.scale
    canvas.line([(12, bottom - 5), (12, bottom), (end, bottom), (end, bottom - 5)], _INK)
    canvas.text((14, bottom - 7), f"{length:g} m", _TEXT, _INK)


def _draw_plan(canvas: Svg | Pixels, view: _View, plan: Floorplan) -> None:
    """The occupied cells in the plan's colour: an image that is turned and stretched."""
    rows, (u, v) = plan.occupied.shape[0], plan.cell
    pixels = np.zeros((*plan.occupied.shape, 4), np.uint8)
    pixels[plan.occupied[::-1]] = *bytes.fromhex(_css(plan.color)[1:]), 255
    ((x, y),) = view.pixels(place_points(plan.pose, np.array([(0.0, rows * v)])))
    cos, sin = math.cos(plan.pose.yaw) * view.scale, math.sin(plan.pose.yaw) * view.scale
    canvas.image(pixels, np.array([(u * cos, v * sin, x), (-u * sin, v * cos, y)]))


def _css(name: str) -> str:
    """A colour of a world file as #rrggbb."""
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in find_color(name) or _UNKNOWN)
