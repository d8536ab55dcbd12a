"""Pictures of a world: floor plans, obstacles, robots, and what their lasers see, as SVG or PNG."""

import base64
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import escape

import numpy as np

from zteam.errors import UsageError
from zteam.geometry import Point2, Pose2
from zteam.world.colors import find_color
from zteam.world.model import Floorplan, Robot, Shape, World

if TYPE_CHECKING:
    from PIL.Image import Image as Picture
    from PIL.ImageDraw import ImageDraw

MAX_WIDTH = 8000
_MARGIN = 0.5
"""Metres around everything."""
_FOOTER = 24
"""Pixels below the map, for the scale bar."""
_GROUND, _INK, _UNKNOWN = (1.0, 1.0, 1.0), (0.13, 0.13, 0.13), (0.6, 0.6, 0.6)
_OVERSAMPLING = 2

Rgb = tuple[float, float, float]


class Fan(NamedTuple):
    """What one laser sees: its place, and where its beams end, in `map`."""

    origin: Point2
    ends: Sequence[Point2]
    hits: Sequence[bool]
    """Whether each beam met something."""


class _Area(NamedTuple):
    """A filled polygon in `map`."""

    points: Sequence[Point2]
    color: Rgb
    opacity: float = 1.0
    outline: bool = True


class _View(NamedTuple):
    """The part of the map that is drawn."""

    left: float
    top: float
    scale: float
    """Pixels a metre."""
    width: int
    height: int

    def pixel(self, x: float, y: float) -> Point2:
        """Pixel coordinates of a point in `map`."""
        return (x - self.left) * self.scale, (self.top - y) * self.scale


class _Drawing(NamedTuple):
    view: _View
    plans: Sequence[Floorplan]
    areas: list[_Area]
    dots: list[tuple[Point2, Rgb]]
    labels: list[tuple[Point2, str]]


def draw_world(
    world: World, robots: Mapping[int, Robot], path: Path, *, width: int = 1200, fans: Mapping[int, Sequence[Fan]] = {}
) -> None:
    """Draw a world into an .svg or .png file, with these robots and their fans. Raises UsageError."""
    if path.suffix.lower() not in (".svg", ".png"):
        raise UsageError(f"{path}: pictures are .svg or .png")
    if not 50 <= width <= MAX_WIDTH:
        raise UsageError(f"a picture is 50 to {MAX_WIDTH} pixels wide, not {width}")
    drawing = _compose(world, robots, width, fans)
    try:
        if path.suffix.lower() == ".svg":
            path.write_text(_as_svg(drawing), encoding="utf-8")
        else:
            _as_png(drawing).save(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot write this picture: {error.strerror or error}") from None


def _compose(world: World, robots: Mapping[int, Robot], width: int, fans: Mapping[int, Sequence[Fan]]) -> _Drawing:
    """All polygons from the ground up: later ones lie on top."""
    drawing = _Drawing(_make_view(world, robots, width), world.floorplans, [], [], [])
    for robot_id, robot in robots.items():
        for fan in fans.get(robot_id, ()):
            color = _rgb(robot.color)
            drawing.areas.append(_Area([fan.origin, *fan.ends], color, 0.18, outline=False))
            drawing.dots.extend((end, color) for end, hit in zip(fan.ends, fan.hits, strict=True) if hit)
    for obstacle in world.obstacles:
        drawing.areas.extend(_Area(_placed(obstacle.pose, s), _rgb(s.color), 0.9) for s in obstacle.shapes)
    for robot_id, robot in robots.items():
        shapes = sorted(robot.shapes, key=lambda shape: shape.z_max)
        drawing.areas.extend(_Area(_placed(robot.pose, shape), _rgb(shape.color)) for shape in shapes)
        size = max((math.hypot(*p) for shape in shapes for p in shape.points), default=0.2)
        nose = [(0.95 * size, 0.0), (0.35 * size, 0.3 * size), (0.35 * size, -0.3 * size)]
        drawing.areas.append(_Area([_at(robot.pose, p) for p in nose], _GROUND))
        drawing.labels.append(((robot.pose.x, robot.pose.y + 1.2 * size), str(robot_id)))
    return drawing


def _make_view(world: World, robots: Mapping[int, Robot], width: int) -> _View:
    corners = [corner for plan in world.floorplans for corner in _corners(plan)]
    corners += [p for o in world.obstacles for shape in o.shapes for p in _placed(o.pose, shape)]
    corners += [p for r in robots.values() for shape in r.shapes for p in _placed(r.pose, shape)]
    corners += [robot.pose[:2] for robot in robots.values()] or [(0.0, 0.0)]
    low, high = np.min(corners, axis=0) - _MARGIN, np.max(corners, axis=0) + _MARGIN
    scale = width / float(high[0] - low[0])
    height = min(MAX_WIDTH, math.ceil((high[1] - low[1]) * scale) + _FOOTER)
    return _View(float(low[0]), float(high[1]), scale, width, height)


def _corners(plan: Floorplan) -> list[Point2]:
    rows, columns = plan.occupied.shape
    return [_at(plan.pose, (u * columns * plan.cell[0], v * rows * plan.cell[1])) for u, v in
            ((0, 0), (1, 0), (1, 1), (0, 1))]  # fmt: skip


def _at(pose: Pose2, point: Point2) -> Point2:
    return pose.compose(Pose2(*point, 0.0))[:2]


def _placed(pose: Pose2, shape: Shape) -> list[Point2]:
    return [_at(pose, point) for point in shape.points]


def _rgb(name: str) -> Rgb:
    return find_color(name) or _UNKNOWN


def _scale_bar(view: _View) -> tuple[float, str]:
    """A round length of about a sixth of the picture in metres, and its label."""
    goal = view.width / view.scale / 6
    power = 10.0 ** math.floor(math.log10(goal))
    length = max(step * power for step in (1, 2, 5) if step * power <= goal)
    return length, f"{length:g} m"


def _as_svg(drawing: _Drawing) -> str:
    view = drawing.view
    size = f'width="{view.width}" height="{view.height}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" {size}>',
        f'<rect {size} fill="{_css(_GROUND)}"/>',
    ]
    lines += [_svg_plan(plan, view) for plan in drawing.plans]
    for area in drawing.areas:
        points = " ".join(f"{x:.2f},{y:.2f}" for x, y in (view.pixel(*p) for p in area.points))
        stroke = f' stroke="{_css(_INK)}" stroke-width="0.8"' if area.outline else ""
        opacity = f' fill-opacity="{area.opacity:g}"' if area.opacity < 1 else ""
        lines.append(f'<polygon points="{points}" fill="{_css(area.color)}"{opacity}{stroke}/>')
    for point, color in drawing.dots:
        x, y = view.pixel(*point)
        lines.append(f'<circle cx="{x:.2f}" cy="{y:.2f}" r="1.2" fill="{_css(color)}"/>')
    for point, text in drawing.labels:
        x, y = view.pixel(*point)
        lines.append(f'<text x="{x:.1f}" y="{y:.1f}" font-size="13" text-anchor="middle">{escape(text)}</text>')
    length, text = _scale_bar(view)
    bottom = view.height - 12
    lines.append(f'<path d="M12 {bottom - 5}v5h{length * view.scale:.1f}v-5" fill="none" stroke="{_css(_INK)}"/>')
    lines.append(f'<text x="14" y="{bottom - 8}" font-size="12">{text}</text>')
    return "\n".join([*lines, "</svg>", ""])


def _svg_plan(plan: Floorplan, view: _View) -> str:
    """The cells themselves, as an image that is turned and stretched: exact, and small."""
    rows, columns = plan.occupied.shape
    data = io.BytesIO()
    _cells(plan).save(data, "PNG", optimize=True)
    x, y = view.pixel(*_at(plan.pose, (0.0, rows * plan.cell[1])))
    cos, sin = math.cos(plan.pose.yaw) * view.scale, math.sin(plan.pose.yaw) * view.scale
    u, v = plan.cell
    return (
        f'<image transform="matrix({u * cos:.6f} {-u * sin:.6f} {v * sin:.6f} {v * cos:.6f} {x:.3f} {y:.3f})" '
        f'width="{columns}" height="{rows}" image-rendering="pixelated" preserveAspectRatio="none" '
        f'href="data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"/>'
    )


def _cells(plan: Floorplan) -> "Picture":
    """Occupied cells in the plan's colour on a transparent ground, the uppermost row first."""
    from PIL import Image

    pixels = np.zeros((*plan.occupied.shape, 4), np.uint8)
    pixels[plan.occupied[::-1]] = (*_bytes(_rgb(plan.color)), 255)
    return Image.fromarray(pixels, "RGBA")


def _as_png(drawing: _Drawing) -> "Picture":
    from PIL import Image, ImageDraw

    small = drawing.view
    view = small._replace(
        scale=small.scale * _OVERSAMPLING, width=small.width * _OVERSAMPLING, height=small.height * _OVERSAMPLING
    )
    picture = Image.new("RGBA", (view.width, view.height), (*_bytes(_GROUND), 255))
    for plan in drawing.plans:
        picture.alpha_composite(_png_plan(plan, view))
    for area in drawing.areas:
        layer = Image.new("RGBA", picture.size, (0, 0, 0, 0)) if area.opacity < 1 else picture
        pen = ImageDraw.Draw(layer)
        points = [view.pixel(*p) for p in area.points]
        pen.polygon(points, fill=(*_bytes(area.color), round(255 * area.opacity)))
        if area.outline:
            pen.line([*points, points[0]], fill=(*_bytes(_INK), 255), width=_OVERSAMPLING)
        if layer is not picture:
            picture.alpha_composite(layer)
    pen = ImageDraw.Draw(picture)
    for point, color in drawing.dots:
        x, y = view.pixel(*point)
        r = 1.2 * _OVERSAMPLING
        pen.ellipse((x - r, y - r, x + r, y + r), fill=(*_bytes(color), 255))
    _png_texts(pen, drawing, view)
    return picture.convert("RGB").resize((small.width, small.height), Image.Resampling.LANCZOS)


def _png_plan(plan: Floorplan, view: _View) -> "Picture":
    """The cells, looked up for every pixel of the picture."""
    from PIL import Image

    rows, (u, v) = plan.occupied.shape[0], plan.cell
    cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    # column = (cos dx + sin dy) / u and rows - (cos dy - sin dx) / v, with dx, dy from the plan's corner in metres.
    dx, dy, step = view.left - plan.pose.x, view.top - plan.pose.y, 1.0 / view.scale
    column = cos * step / u, -sin * step / u, (cos * dx + sin * dy) / u
    row = sin * step / v, cos * step / v, rows - (cos * dy - sin * dx) / v
    return _cells(plan).transform(
        (view.width, view.height), Image.Transform.AFFINE, (*column, *row), Image.Resampling.NEAREST
    )


def _png_texts(pen: "ImageDraw", drawing: _Drawing, view: _View) -> None:
    from PIL import ImageFont

    font = ImageFont.load_default(13 * _OVERSAMPLING)
    for point, text in drawing.labels:
        pen.text(view.pixel(*point), text, fill=_bytes(_INK), font=font, anchor="mb")
    length, text = _scale_bar(view)
    k, bottom = _OVERSAMPLING, view.height - 12 * _OVERSAMPLING
    end = 12 * k + length * view.scale
    pen.line([(12 * k, bottom - 5 * k), (12 * k, bottom), (end, bottom), (end, bottom - 5 * k)], _bytes(_INK), k)
    pen.text((14 * k, bottom - 7 * k), text, fill=_bytes(_INK), font=font, anchor="lb")


def _bytes(color: Rgb) -> tuple[int, int, int]:
    red, green, blue = (round(255 * channel) for channel in color)
    return red, green, blue


def _css(color: Rgb) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in _bytes(color))
