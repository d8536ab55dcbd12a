"""Transforms and trees for users: tf_echo's block, the tree as text, and drawings of it like those of view_frames.

A drawing is an SVG, PNG, PDF, or a Graphviz file. Everywhere `now` is the team's time in ns; 0 = unknown.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import escape

from zteam.errors import UsageError, printable
from zteam.geometry import Point2, rpy_from_quaternion
from zteam.messages import TransformStamped, ns_from_time
from zteam.transforms.tree import FrameInfo

if TYPE_CHECKING:
    from PIL.Image import Image

PICTURES = (".svg", ".png", ".pdf", ".dot")
"""Endings of the files that `draw_tree` can write."""
STALE = 1.0
"""Seconds without a sample after which a moving edge is drawn as broken."""

_BOX_WIDTH, _BOX_HEIGHT, _GAP_X, _GAP_Y, _MARGIN = 190, 30, 16, 62, 14
_INK, _BROKEN, _FILL, _BLACK = "#445566", "#cc0000", "#eef3fb", "#000000"
_OVERSAMPLING = 2
"""Pixels of a PNG or PDF for each of the drawing, so that it can be enlarged."""
_MAX_SIDE, _MAX_PIXELS = 65_000, 200_000_000
"""Bounds of a PNG or PDF: of formats, and of memory."""


class _Text(NamedTuple):
    """A text in a drawing; its place is the left end of its base line, or the middle of it."""

    place: Point2
    text: str
    size: int
    color: str
    in_the_middle: bool = False


class _Drawing(NamedTuple):
    """The tree in pixels."""

    width: float
    height: float
    boxes: list[Point2]
    """Their upper left corners."""
    lines: list[tuple[list[Point2], str]]
    """From parents to children, with their colour; broken ones are dashed."""
    texts: list[_Text]


def format_transform(transform: TransformStamped) -> str:
    """tf_echo's block: time, translation, quaternion, roll, pitch and yaw in radians and degrees."""
    t, r = transform.transform.translation, transform.transform.rotation
    rpy = rpy_from_quaternion(r.x, r.y, r.z, r.w)
    return (
        f"At time {ns_from_time(transform.header.stamp) / 1e9:.3f}\n"
        f"- Translation: {_row(t.x, t.y, t.z)}\n"
        f"- Rotation: in Quaternion {_row(r.x, r.y, r.z, r.w)}\n"
        f"            in RPY (radian) {_row(*rpy)}\n"
        f"            in RPY (degree) {_row(*map(math.degrees, rpy))}"
    )


def _row(*values: float) -> str:
    # Adding 0.0 turns a rounded -0.000 into 0.000.
    return "[" + ", ".join(f"{round(v, 3) + 0.0:.3f}" for v in values) + "]"


def format_tree(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree with one frame on each line, with its rate, age and authority; several roots follow one another."""
    lines = []
    for frame, lead in _walk(frames):
        info = frames.get(frame)
        told = f"  ({_figures(info, now)}, by {printable(info.authority)})" if info is not None else ""
        lines.append(f"{lead}{printable(frame)}{told}")
    return "\n".join(lines)


def _walk(frames: Mapping[str, FrameInfo]) -> Iterator[tuple[str, str]]:
    """Each frame before its children, and the lines before it: four columns for each frame above it."""
    children = _children(frames)
    # Without recursion: a chain of frames may be deeper than Python's stack. The next frame is on top.
    todo = [(root, "", "") for root in sorted(set(children) - set(frames), reverse=True)]
    while todo:
        frame, own, lead = todo.pop()
        yield frame, own
        for place, child in enumerate(reversed(children.get(frame, []))):
            todo.append((child, lead + ("├── " if place else "└── "), lead + ("│   " if place else "    ")))


def _children(frames: Mapping[str, FrameInfo]) -> dict[str, list[str]]:
    """The children of each frame that has any, sorted by name."""
    children: dict[str, list[str]] = {}
    for child, info in sorted(frames.items()):
        children.setdefault(info.parent, []).append(child)
    return children


def _figures(info: FrameInfo, now: int) -> str:
    """The rate of a frame, and the age of its newest sample."""
    if info.static:
        return "static"
    age = f"{max(0, now - info.newest) / 1e9:.2f} s old" if now else "age unknown"
    return f"{info.rate:.1f} Hz, {age}"


def _is_broken(info: FrameInfo, now: int) -> bool:
    """Whether a moving edge has had no sample for longer than STALE."""
    return not info.static and now > 0 and now - info.newest > STALE * 1e9


def draw_tree(frames: Mapping[str, FrameInfo], now: int, path: Path) -> None:
    """Draw the tree into a file of one of PICTURES. Raises UsageError."""
    texts = {".dot": tree_as_dot, ".svg": tree_as_svg}
    try:
        if write := texts.get(path.suffix.lower()):
            path.write_text(write(frames, now), encoding="utf-8")
        else:
            _as_image(_compose(frames, now)).save(path, resolution=72.0 * _OVERSAMPLING)
    except OSError as error:
        raise UsageError(f"{path}: cannot write the tree: {error.strerror or error}") from None


def tree_as_dot(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree as a Graphviz file, which `dot -Tpdf frames.dot -o frames.pdf` turns into a PDF."""
    lines = ["digraph frames {", "  node [shape=box, fontname=sans]; edge [fontname=sans, fontsize=10];"]
    for child, info in sorted(frames.items()):
        color = ', color=red, fontcolor=red, style="dashed"' if _is_broken(info, now) else ""
        label = f"{_quoted(info.authority)}\\n{_figures(info, now)}"
        lines.append(f'  "{_quoted(info.parent)}" -> "{_quoted(child)}" [label="{label}"{color}];')
    return "\n".join([*lines, "}", ""])


def _quoted(text: str) -> str:
    return printable(text).replace("\\", "\\\\").replace('"', '\\"')


def _compose(frames: Mapping[str, FrameInfo], now: int) -> _Drawing:
    """Boxes for frames with edges between them: parents are above their children."""
    places = _lay_out(frames)
    width = max((x for x, _ in places.values()), default=_MARGIN) + _BOX_WIDTH + _MARGIN
    height = max((y for _, y in places.values()), default=_MARGIN) + _BOX_HEIGHT + _MARGIN
    drawing = _Drawing(width, height, [place for _, place in sorted(places.items())], [], [])
    for child, info in sorted(frames.items()):
        (x0, y0), (x1, y1) = places[info.parent], places[child]
        x0, y0, x1 = x0 + _BOX_WIDTH / 2, y0 + _BOX_HEIGHT, x1 + _BOX_WIDTH / 2
        bend = y0 + 14
        color = _BROKEN if _is_broken(info, now) else _INK
        drawing.lines.append(([(x0, y0), (x0, bend), (x1, bend), (x1, y1)], color))
        for row, text in enumerate((info.authority, _figures(info, now))):
            drawing.texts.append(_Text((x1 + 5, bend + 14 + 13 * row), text, 10, color))
    for frame, (x, y) in sorted(places.items()):
        drawing.texts.append(_Text((x + _BOX_WIDTH / 2, y + 20), frame, 13, _BLACK, in_the_middle=True))
    return drawing


def tree_as_svg(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree as SVG: parents are above their children, broken edges are red and dashed."""
    drawing = _compose(frames, now)
    extent = f'width="{drawing.width:.0f}" height="{drawing.height:.0f}"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {extent} font-family="sans-serif">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for points, color in drawing.lines:
        path = "M" + "L".join(f"{x:.0f} {y:.0f}" for x, y in points)
        dash = ' stroke-dasharray="5 4"' if color == _BROKEN else ""
        parts.append(f'<path d="{path}" fill="none" stroke="{color}"{dash}/>')
    box = f'width="{_BOX_WIDTH}" height="{_BOX_HEIGHT}" rx="6" fill="{_FILL}" stroke="{_INK}"'
    parts += [f'<rect x="{x:.0f}" y="{y:.0f}" {box}/>' for x, y in drawing.boxes]
    for (x, y), text, size, color, in_the_middle in drawing.texts:
        look = f'font-size="{size}" fill="{color}" text-anchor="{"middle" if in_the_middle else "start"}"'
        parts.append(f'<text x="{x:.0f}" y="{y:.0f}" {look}>{escape(printable(text))}</text>')
    return "\n".join([*parts, "</svg>", ""])


def _as_image(drawing: _Drawing) -> "Image":
    """The drawing in pixels. Raises UsageError if it would be too large."""
    from PIL import Image, ImageDraw, ImageFont

    scale = _OVERSAMPLING
    width, height = round(drawing.width * scale), round(drawing.height * scale)
    if max(width, height) > _MAX_SIDE or width * height > _MAX_PIXELS:
        raise UsageError(f"the tree has {len(drawing.boxes)} frames, too many for pixels: name a .svg or .dot file")
    image = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(image)
    fonts = {size: ImageFont.load_default(size * scale) for size in {text.size for text in drawing.texts}}
    for points, color in drawing.lines:
        pen.line([(x * scale, y * scale) for x, y in points], fill=color, width=scale)
    for x, y in drawing.boxes:
        corners = (x * scale, y * scale, (x + _BOX_WIDTH) * scale, (y + _BOX_HEIGHT) * scale)
        pen.rounded_rectangle(corners, 6 * scale, fill=_FILL, outline=_INK, width=scale)
    for (x, y), text, size, color, in_the_middle in drawing.texts:
        anchor = "ms" if in_the_middle else "ls"
        pen.text((x * scale, y * scale), printable(text), fill=color, font=fonts[size], anchor=anchor)
    return image


def _lay_out(frames: Mapping[str, FrameInfo]) -> dict[str, Point2]:
    """Upper left corners of the boxes: leaves side by side, parents over the middle of their children."""
    children, depths = _children(frames), {frame: len(lead) // 4 for frame, lead in _walk(frames)}
    leaves = [frame for frame in depths if frame not in children]
    across = {leaf: _MARGIN + float(place) * (_BOX_WIDTH + _GAP_X) for place, leaf in enumerate(leaves)}
    for frame in reversed(depths):
        if below := children.get(frame):
            across[frame] = (across[below[0]] + across[below[-1]]) / 2
    return {frame: (across[frame], _MARGIN + depth * (_BOX_HEIGHT + _GAP_Y)) for frame, depth in depths.items()}
