"""Pictures of a world: floor plans, obstacles, robots, and what their lasers see, as SVG or PNG."""

import base64
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from zteam.errors import UsageError
from zteam.geometry import Point2
from zteam.simulator.world.colors import Rgb, find_color
from zteam.simulator.world.model import Floorplan, Obstacle, Robot, World
from zteam.simulator.world.placing import place_points, place_shape, plan_corners

Points = NDArray[np.float64]
"""(n, 2): x, y in `map`, metres."""

MAX_WIDTH = 8000
_MARGIN = 0.5
"""Metres around everything."""
_FOOTER = 24
"""Pixels below the map, for the scale bar."""
_GROUND, _INK, _UNKNOWN = (1.0, 1.0, 1.0), (0.13, 0.13, 0.13), (0.6, 0.6, 0.6)
_OVERSAMPLING = 2


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


def draw_world(world: World, path: Path, *, width: int = 1200, fans: Mapping[int, Sequence[Fan]] = {}) -> None:
    """Draw a world into an .svg or .png file, with its robots' fans by id. Raises UsageError."""
    kinds: dict[str, type[_Svg | _Png]] = {".svg": _Svg, ".png": _Png}
    kind = kinds.get(path.suffix.lower())
    if kind is None:
        raise UsageError(f"{path}: pictures are .svg or .png")
    if not 50 <= width <= MAX_WIDTH:
        raise UsageError(f"a picture is 50 to {MAX_WIDTH} pixels wide, not {width}")
    pen = kind(_make_view(world, width))
    _draw(pen, world, fans)
    try:
        pen.save(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot write this picture: {error.strerror or error}") from None


def _make_view(world: World, width: int) -> _View:
    corners = [plan_corners(plan) for plan in world.floorplans]
    things: list[Obstacle | Robot] = [*world.obstacles, *world.robots]
    corners += [place_shape(thing.pose, shape) for thing in things for shape in thing.shapes]
    corners.append(np.array([robot.pose[:2] for robot in world.robots] or [(0.0, 0.0)]))
    points = np.vstack(corners)
    (left, bottom), (right, top) = (points.min(axis=0) - _MARGIN).tolist(), (points.max(axis=0) + _MARGIN).tolist()
    scale = width / (right - left)
    return _View(left, top, scale, width, min(MAX_WIDTH, math.ceil((top - bottom) * scale) + _FOOTER))


def _draw(pen: "_Svg | _Png", world: World, fans: Mapping[int, Sequence[Fan]]) -> None:
    """Everything from the ground up: later things lie on top."""
    for plan in world.floorplans:
        pen.plan(plan)
    seen = [(fan, _rgb(world.robots[robot_id].color)) for robot_id, own in fans.items() for fan in own]
    for fan, color in seen:
        pen.area(np.array([fan.origin, *fan.ends]), color, 0.18, outline=False)
    for obstacle in world.obstacles:
        for shape in obstacle.shapes:
            pen.area(place_shape(obstacle.pose, shape), _rgb(shape.color), 0.9)
    labels = []
    for robot_id, robot in enumerate(world.robots):
        for shape in sorted(robot.shapes, key=lambda shape: shape.z_max):
            pen.area(place_shape(robot.pose, shape), _rgb(shape.color))
        size = max((math.hypot(*point) for shape in robot.shapes for point in shape.points), default=0.2)
        nose = size * np.array([(0.95, 0.0), (0.35, 0.3), (0.35, -0.3)])
        pen.area(place_points(robot.pose, nose), _GROUND)
        (above,) = pen.view.pixels(np.array([(robot.pose.x, robot.pose.y + 1.2 * size)]))
        labels.append((above, str(robot_id)))
    for fan, color in seen:
        pen.dots(np.array(fan.ends)[np.array(fan.hits, bool)], color)
    for (x, y), text in labels:
        pen.text(x, y, text, "middle")
    length = _round_length(pen.view.width / pen.view.scale / 6)
    k, bottom = pen.unit, pen.view.height - 12 * pen.unit
    end = 12 * k + length * pen.view.scale
    pen.line([(12 * k, bottom - 5 * k), (12 * k, bottom), (end, bottom), (end, bottom - 5 * k)])
    pen.text(14 * k, bottom - 7 * k, f"{length:g} m", "start")


def _round_length(most: float) -> float:
    """1, 2 or 5 times a power of ten: for a scale bar of `most` metres at most."""
    power = 10.0 ** math.floor(math.log10(most))
    return max(step * power for step in (1, 2, 5) if step * power <= most)


def _cells(plan: Floorplan) -> Image.Image:
    """Occupied cells in the plan's colour on a transparent ground, the uppermost row first."""
    pixels = np.zeros((*plan.occupied.shape, 4), np.uint8)
    pixels[plan.occupied[::-1]] = _bytes(_rgb(plan.color))
    return Image.fromarray(pixels, "RGBA")


class _Svg:
    unit = 1
    """Pixels of this view for one of the picture."""

    def __init__(self, view: _View) -> None:
        self.view = view
        size = f'width="{view.width}" height="{view.height}"'
        self._lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" {size}>',
            f'<rect {size} fill="{_css(_GROUND)}"/>',
        ]

    def plan(self, plan: Floorplan) -> None:
        """The cells themselves, as an image that is turned and stretched: exact, and small."""
        rows, columns = plan.occupied.shape
        data = io.BytesIO()
        _cells(plan).save(data, "PNG", optimize=True)
        ((x, y),) = self.view.pixels(place_points(plan.pose, np.array([(0.0, rows * plan.cell[1])])))
        cos, sin = math.cos(plan.pose.yaw) * self.view.scale, math.sin(plan.pose.yaw) * self.view.scale
        u, v = plan.cell
        self._lines.append(
            f'<image transform="matrix({u * cos:.6f} {-u * sin:.6f} {v * sin:.6f} {v * cos:.6f} {x:.3f} {y:.3f})" '
            f'width="{columns}" height="{rows}" image-rendering="pixelated" preserveAspectRatio="none" '
            f'href="data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"/>'
        )

    def area(self, points: Points, color: Rgb, opacity: float = 1.0, *, outline: bool = True) -> None:
        corners = " ".join(f"{x:.2f},{y:.2f}" for x, y in self.view.pixels(points))
        stroke = f' stroke="{_css(_INK)}" stroke-width="0.8"' if outline else ""
        see_through = f' fill-opacity="{opacity:g}"' if opacity < 1 else ""
        self._lines.append(f'<polygon points="{corners}" fill="{_css(color)}"{see_through}{stroke}/>')

    def dots(self, points: Points, color: Rgb) -> None:
        for x, y in self.view.pixels(points):
            self._lines.append(f'<circle cx="{x:.2f}" cy="{y:.2f}" r="1.2" fill="{_css(color)}"/>')

    def line(self, pixels: Sequence[Point2]) -> None:
        corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels)
        self._lines.append(f'<polyline points="{corners}" fill="none" stroke="{_css(_INK)}"/>')

    def text(self, x: float, y: float, text: str, anchor: str) -> None:
        place = f'x="{x:.1f}" y="{y:.1f}" font-size="13" text-anchor="{anchor}"'
        self._lines.append(f"<text {place}>{escape(text)}</text>")

    def save(self, path: Path) -> None:
        path.write_text("\n".join([*self._lines, "</svg>", ""]), encoding="utf-8")


class _Png:
    """Drawn larger, and made smaller at the end: so edges become smooth."""

    unit = _OVERSAMPLING

    def __init__(self, view: _View) -> None:
        self._small, k = (view.width, view.height), self.unit
        self.view = view._replace(scale=view.scale * k, width=view.width * k, height=view.height * k)
        self._picture = Image.new("RGBA", (self.view.width, self.view.height), _bytes(_GROUND))
        self._pen = ImageDraw.Draw(self._picture)
        self._font = ImageFont.load_default(13 * k)

    def plan(self, plan: Floorplan) -> None:
        """The cells, looked up for every pixel of the picture."""
        view, rows, (u, v) = self.view, plan.occupied.shape[0], plan.cell
        cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
        # column = (cos dx + sin dy) / u and rows - (cos dy - sin dx) / v, with dx, dy from the plan's corner in metres.
        dx, dy, step = view.left - plan.pose.x, view.top - plan.pose.y, 1.0 / view.scale
        column = cos * step / u, -sin * step / u, (cos * dx + sin * dy) / u
        row = sin * step / v, cos * step / v, rows - (cos * dy - sin * dx) / v
        cells = _cells(plan).transform(
            self._picture.size, Image.Transform.AFFINE, (*column, *row), Image.Resampling.NEAREST
        )
        self._picture.alpha_composite(cells)

    def area(self, points: Points, color: Rgb, opacity: float = 1.0, *, outline: bool = True) -> None:
        layer = Image.new("RGBA", self._picture.size) if opacity < 1 else self._picture
        pen = ImageDraw.Draw(layer)
        corners = [*map(tuple, self.view.pixels(points))]
        pen.polygon(corners, fill=_bytes(color, opacity))
        if outline:
            pen.line([*corners, corners[0]], fill=_bytes(_INK), width=self.unit)
        if layer is not self._picture:
            self._picture.alpha_composite(layer)

    def dots(self, points: Points, color: Rgb) -> None:
        for x, y in self.view.pixels(points):
            self._pen.circle((x, y), 1.2 * self.unit, fill=_bytes(color))

    def line(self, pixels: Sequence[Point2]) -> None:
        self._pen.line(pixels, fill=_bytes(_INK), width=self.unit)

    def text(self, x: float, y: float, text: str, anchor: str) -> None:
        self._pen.text((x, y), text, fill=_bytes(_INK), font=self._font, anchor=f"{anchor[0]}b".replace("s", "l"))

    def save(self, path: Path) -> None:
        self._picture.convert("RGB").resize(self._small, Image.Resampling.LANCZOS).save(path)


def _rgb(name: str) -> Rgb:
    return find_color(name) or _UNKNOWN


def _bytes(color: Rgb, opacity: float = 1.0) -> tuple[int, ...]:
    return tuple(round(255 * channel) for channel in (*color, opacity))


def _css(color: Rgb) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in _bytes(color)[:3])
