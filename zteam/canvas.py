"""Drawings of areas, lines and texts: the same calls make an SVG or pixels. Places are in pixels from the upper left
corner, colours are `#rrggbb`."""

import base64
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from zteam.errors import printable

Place = Sequence[float]
OVERSAMPLING = 2
"""Pixels that are drawn for each of the drawing."""


class Svg:
    """A drawing on a white ground."""

    def __init__(self, width: float, height: float) -> None:
        extent = f'width="{width:.0f}" height="{height:.0f}"'
        self._lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" {extent}>',
            f'<rect {extent} fill="white"/>',
        ]

    def area(self, corners: Iterable[Place], fill: str, outline: str = "", opacity: float = 1.0) -> None:
        """A polygon; without `outline` it has none."""
        look = f' stroke="{outline}" stroke-width="0.8"' if outline else ""
        look += f' fill-opacity="{opacity:g}"' if opacity < 1.0 else ""
        self._lines.append(f'<polygon points="{_svg_points(corners)}" fill="{fill}"{look}/>')

    def line(self, points: Iterable[Place], color: str, *, dashed: bool = False) -> None:
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        self._lines.append(f'<polyline points="{_svg_points(points)}" fill="none" stroke="{color}"{dash}/>')

    def dot(self, place: Place, radius: float, color: str) -> None:
        self._lines.append(f'<circle cx="{place[0]:.2f}" cy="{place[1]:.2f}" r="{radius:g}" fill="{color}"/>')

    def text(self, place: Place, text: str, size: int, color: str, *, centred: bool = False) -> None:
        """A text whose base line begins at `place`, or has its middle there."""
        look = f'font-size="{size}" fill="{color}" text-anchor="{"middle" if centred else "start"}"'
        self._lines.append(f'<text x="{place[0]:.1f}" y="{place[1]:.1f}" {look}>{escape(printable(text))}</text>')

    def image(self, pixels: NDArray[np.uint8], matrix: NDArray[np.float64]) -> None:
        """Pixels (rows, columns, 4), whose (column, row, 1) is at `matrix` (2, 3) times it."""
        from PIL import Image

        data = io.BytesIO()
        Image.fromarray(pixels, "RGBA").save(data, "PNG", optimize=True)
        self._lines.append(
            f'<image transform="matrix({" ".join(f"{number:.6f}" for number in matrix.T.ravel())})" '
            f'width="{pixels.shape[1]}" height="{pixels.shape[0]}" image-rendering="pixelated" '
            f'preserveAspectRatio="none" href="data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"/>'
        )

    def save(self, path: Path) -> None:
        path.write_text("\n".join([*self._lines, "</svg>", ""]), encoding="utf-8")


def _svg_points(points: Iterable[Place]) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points)


class Pixels:
    """The same for a PNG or PDF, without dashes. With `shrink` it is made smaller at the end: edges become smooth."""

    def __init__(self, width: float, height: float, *, shrink: bool = False) -> None:
        from PIL import Image, ImageDraw, ImageFont

        self._small = (round(width), round(height)) if shrink else None
        self._picture = Image.new("RGB", (round(width * OVERSAMPLING), round(height * OVERSAMPLING)), "white")
        # Colours with an opacity are blended.
        self._pen = ImageDraw.Draw(self._picture, "RGBA")
        self._font = ImageFont.load_default

    def area(self, corners: Iterable[Place], fill: str, outline: str = "", opacity: float = 1.0) -> None:
        points = _scaled(corners)
        self._pen.polygon(points, fill=f"{fill}{round(255 * opacity):02x}")
        if outline:
            self._pen.line([*points, points[0]], fill=outline, width=OVERSAMPLING)

    def line(self, points: Iterable[Place], color: str, *, dashed: bool = False) -> None:
        self._pen.line(_scaled(points), fill=color, width=OVERSAMPLING)

    def dot(self, place: Place, radius: float, color: str) -> None:
        self._pen.circle(_scaled([place])[0], radius * OVERSAMPLING, fill=color)

    def text(self, place: Place, text: str, size: int, color: str, *, centred: bool = False) -> None:
        font = self._font(size * OVERSAMPLING)
        anchor = "ms" if centred else "ls"
        self._pen.text(_scaled([place])[0], printable(text), fill=color, font=font, anchor=anchor)

    def image(self, pixels: NDArray[np.uint8], matrix: NDArray[np.float64]) -> None:
        from PIL import Image

        place_of_pixel = np.linalg.inv(np.vstack((OVERSAMPLING * matrix, (0.0, 0.0, 1.0))))[:2].ravel().tolist()
        picture = Image.fromarray(pixels, "RGBA")
        moved = picture.transform(self._picture.size, Image.Transform.AFFINE, place_of_pixel, Image.Resampling.NEAREST)
        self._picture.paste(moved, mask=moved)

    def save(self, path: Path) -> None:
        from PIL import Image

        picture: Any = self._picture
        if self._small is not None:
            picture = picture.resize(self._small, Image.Resampling.LANCZOS)
        picture.save(path, resolution=72.0 * OVERSAMPLING)


def _scaled(points: Iterable[Place]) -> list[tuple[float, float]]:
    return [(x * OVERSAMPLING, y * OVERSAMPLING) for x, y in points]
