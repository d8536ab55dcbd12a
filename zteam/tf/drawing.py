"""Drawings of the tree like those of view_frames: SVG, PNG, PDF, or a Graphviz file."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import escape

from zteam.errors import UsageError
from zteam.tf.tree import FrameInfo

if TYPE_CHECKING:
    from PIL.Image import Image

PICTURES = (".svg", ".png", ".pdf", ".dot")
"""Endings of the files that `draw_tree` can write."""
STALE = 1.0
"""Seconds without a sample after which a moving edge is drawn as broken."""

_BOX_WIDTH, _BOX_HEIGHT, _GAP_X, _GAP_Y, _MARGIN = 190, 30, 16, 62, 14
_INK, _BROKEN, _FILL = "#445566", "#cc0000", "#eef3fb"
_OVERSAMPLING = 2
"""Pixels of a PNG or PDF for each of the drawing, so that it can be enlarged."""
_MAX_SIDE, _MAX_PIXELS = 65_000, 200_000_000
"""Bounds of a PNG or PDF: of formats, and of memory."""

Place = tuple[float, float]


class _Edge(NamedTuple):
    """The line from a parent to a child, and the text beside it."""

    points: list[Place]
    text: list[str]
    is_broken: bool

    @property
    def text_place(self) -> Place:
        """Where the first line of text begins: beside the line, above the child."""
        return self.points[-1][0] + 5, self.points[1][1] + 14


class _Drawing(NamedTuple):
    """The tree in pixels; the place of a box is its upper left corner."""

    width: float
    height: float
    boxes: list[tuple[str, Place]]
    edges: list[_Edge]


def draw_tree(frames: Mapping[str, FrameInfo], now: int, path: Path) -> None:
    """Draw the tree at time `now` (ns; 0 = unknown) into a file of one of PICTURES. Raises UsageError."""
    kind = path.suffix.lower()
    try:
        if kind == ".dot":
            path.write_text(tree_as_dot(frames, now), encoding="utf-8")
        elif kind == ".svg":
            path.write_text(tree_as_svg(frames, now), encoding="utf-8")
        else:
            _as_image(_compose(frames, now)).save(path, resolution=72.0 * _OVERSAMPLING)
    except OSError as error:
        raise UsageError(f"{path}: cannot write the tree: {error.strerror or error}") from None


def is_broken(info: FrameInfo, now: int) -> bool:
    """Whether a moving edge has had no sample for longer than STALE at time `now` (ns; 0 = unknown)."""
    return not info.static and now > 0 and now - info.newest > STALE * 1e9


def describe_edge(info: FrameInfo, now: int) -> list[str]:
    """The text beside an edge: its authority, rate and age."""
    if info.static:
        return [info.authority, "static"]
    age = f"{max(0, now - info.newest) / 1e9:.2f} s old" if now else "age unknown"
    return [info.authority, f"{info.rate:.1f} Hz, {age}"]


def tree_as_dot(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree as a Graphviz file, which `dot -Tpdf frames.dot -o frames.pdf` turns into a PDF."""
    lines = ["digraph frames {", "  node [shape=box, fontname=sans]; edge [fontname=sans, fontsize=10];"]
    for child, info in sorted(frames.items()):
        color = ', color=red, fontcolor=red, style="dashed"' if is_broken(info, now) else ""
        label = "\\n".join(map(_quoted, describe_edge(info, now)))
        lines.append(f'  "{_quoted(info.parent)}" -> "{_quoted(child)}" [label="{label}"{color}];')
    return "\n".join([*lines, "}", ""])


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _compose(frames: Mapping[str, FrameInfo], now: int) -> _Drawing:
    """Boxes for frames with edges between them: parents are above their children."""
    places = {frame: (x + _MARGIN, y + _MARGIN) for frame, (x, y) in _lay_out(frames).items()}
    width = max((x for x, _ in places.values()), default=0) + _BOX_WIDTH + _MARGIN
    height = max((y for _, y in places.values()), default=0) + _BOX_HEIGHT + _MARGIN
    edges = []
    for child, info in sorted(frames.items()):
        (x0, y0), (x1, y1) = places[info.parent], places[child]
        x0, y0, x1 = x0 + _BOX_WIDTH / 2, y0 + _BOX_HEIGHT, x1 + _BOX_WIDTH / 2
        bend = y0 + 14
        points = [(x0, y0), (x0, bend), (x1, bend), (x1, y1)]
        edges.append(_Edge(points, describe_edge(info, now), is_broken(info, now)))
    return _Drawing(width, height, sorted(places.items()), edges)


def tree_as_svg(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree as SVG: parents are above their children, broken edges are red and dashed."""
    drawing = _compose(frames, now)
    size = f'width="{drawing.width:.0f}" height="{drawing.height:.0f}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for edge in drawing.edges:
        lines += _svg_edge(edge)
    for frame, (x, y) in drawing.boxes:
        lines.append(
            f'<rect x="{x:.0f}" y="{y:.0f}" width="{_BOX_WIDTH}" height="{_BOX_HEIGHT}" rx="6" '
            f'fill="{_FILL}" stroke="{_INK}"/>'
        )
        lines.append(
            f'<text x="{x + _BOX_WIDTH / 2:.0f}" y="{y + 20:.0f}" font-size="13" '
            f'text-anchor="middle">{escape(frame)}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


def _svg_edge(edge: _Edge) -> list[str]:
    color, dash = (_BROKEN, ' stroke-dasharray="5 4"') if edge.is_broken else (_INK, "")
    path = "M" + "L".join(f"{x:.0f} {y:.0f}" for x, y in edge.points)
    lines = [f'<path d="{path}" fill="none" stroke="{color}"{dash}/>']
    x, y = edge.text_place
    for row, text in enumerate(edge.text):
        at = f'x="{x:.0f}" y="{y + 13 * row:.0f}"'
        lines.append(f'<text {at} font-size="10" fill="{color}">{escape(text)}</text>')
    return lines


def _as_image(drawing: _Drawing) -> "Image":
    """The drawing in pixels. Raises UsageError if it would be too large."""
    from PIL import Image, ImageDraw, ImageFont

    scale = _OVERSAMPLING
    width, height = round(drawing.width * scale), round(drawing.height * scale)
    if max(width, height) > _MAX_SIDE or width * height > _MAX_PIXELS:
        raise UsageError(f"the tree has {len(drawing.boxes)} frames, too many for pixels: name a .svg or .dot file")
    image = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(image)
    small, large = (ImageFont.load_default(size * scale) for size in (10, 13))
    for edge in drawing.edges:
        color = _BROKEN if edge.is_broken else _INK
        pen.line([(x * scale, y * scale) for x, y in edge.points], fill=color, width=scale)
        x, y = edge.text_place
        for row, text in enumerate(edge.text):
            pen.text((x * scale, (y + 13 * row) * scale), text, fill=color, font=small, anchor="ls")
    for frame, (x, y) in drawing.boxes:
        corners = (x * scale, y * scale, (x + _BOX_WIDTH) * scale, (y + _BOX_HEIGHT) * scale)
        pen.rounded_rectangle(corners, 6 * scale, fill=_FILL, outline=_INK, width=scale)
        middle = ((x + _BOX_WIDTH / 2) * scale, (y + _BOX_HEIGHT / 2) * scale)
        pen.text(middle, frame, fill="black", font=large, anchor="mm")
    return image


def _lay_out(frames: Mapping[str, FrameInfo]) -> dict[str, tuple[float, float]]:
    """Upper left corners of the boxes: leaves side by side, parents over the middle of their children."""
    children: dict[str, list[str]] = {}
    for child, info in sorted(frames.items()):
        children.setdefault(info.parent, []).append(child)
    places: dict[str, tuple[float, float]] = {}
    next_x = 0.0
    # Depth first without recursion: a chain of frames may be deeper than Python's stack.
    todo = [(root, 0, False) for root in sorted(set(children) - set(frames), reverse=True)]
    while todo:
        frame, depth, seen = todo.pop()
        below = children.get(frame, [])
        if below and not seen:
            todo.append((frame, depth, True))
            todo.extend((child, depth + 1, False) for child in reversed(below))
            continue
        if below:
            x = (places[below[0]][0] + places[below[-1]][0]) / 2
        else:
            x, next_x = next_x, next_x + _BOX_WIDTH + _GAP_X
        places[frame] = (x, depth * (_BOX_HEIGHT + _GAP_Y))
    return places
