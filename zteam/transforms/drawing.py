"""Transforms and trees for users: tf_echo's block, the tree as text, and drawings of it like those of view_frames.

A drawing is an SVG, PNG, PDF, or a Graphviz file. Everywhere `now` is the team's time in ns; 0 = unknown.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from zteam.canvas import Pixels, Svg
from zteam.errors import UsageError, printable
from zteam.geometry import Point2, rpy_from_quaternion
from zteam.messages import TransformStamped, ns_from_time
from zteam.transforms.tree import FrameInfo

PICTURES = (".svg", ".png", ".pdf", ".dot")
"""Endings of the files that `draw_tree` can write."""
STALE = 1.0
"""Seconds without a sample after which a moving edge is drawn as broken."""

_BOX_WIDTH, _BOX_HEIGHT, _GAP_X, _GAP_Y, _MARGIN = 190, 30, 16, 62, 14
_INK, _BROKEN, _FILL, _BLACK = "#445566", "#cc0000", "#eef3fb", "#000000"
_MAX_SIDE, _MAX_PIXELS = 32_000, 50_000_000
"""Bounds of a drawing as PNG or PDF, which have more pixels: of formats, and of memory."""


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
    suffix = path.suffix.lower()
    try:
        if suffix == ".dot":
            path.write_text(_as_dot(frames, now), encoding="utf-8")
        else:
            _draw(frames, now, Svg if suffix == ".svg" else Pixels).save(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot write the tree: {error.strerror or error}") from None


def _as_dot(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree as a Graphviz file, which `dot -Tpdf frames.dot -o frames.pdf` turns into a PDF."""
    lines = ["digraph frames {", "  node [shape=box, fontname=sans]; edge [fontname=sans, fontsize=10];"]
    for child, info in sorted(frames.items()):
        color = ', color=red, fontcolor=red, style="dashed"' if _is_broken(info, now) else ""
        label = f"{_quoted(info.authority)}\\n{_figures(info, now)}"
        lines.append(f'  "{_quoted(info.parent)}" -> "{_quoted(child)}" [label="{label}"{color}];')
    return "\n".join([*lines, "}", ""])


def _quoted(text: str) -> str:
    return printable(text).replace("\\", "\\\\").replace('"', '\\"')


def _draw(frames: Mapping[str, FrameInfo], now: int, kind: type[Svg | Pixels]) -> Svg | Pixels:
    """Boxes for frames with edges between them: parents are above their children, broken edges are red and dashed."""
    places = _lay_out(frames)
    width = max((x for x, _ in places.values()), default=_MARGIN) + _BOX_WIDTH + _MARGIN
    height = max((y for _, y in places.values()), default=_MARGIN) + _BOX_HEIGHT + _MARGIN
    if kind is Pixels and (max(width, height) > _MAX_SIDE or width * height > _MAX_PIXELS):
        raise UsageError(f"the tree has {len(places)} frames, too many for pixels: name a .svg or .dot file")
    canvas = kind(width, height)
    for child, info in sorted(frames.items()):
        (x0, y0), (x1, y1) = places[info.parent], places[child]
        x0, y0, x1 = x0 + _BOX_WIDTH / 2, y0 + _BOX_HEIGHT, x1 + _BOX_WIDTH / 2
        bend, is_broken = y0 + 14, _is_broken(info, now)
        color = _BROKEN if is_broken else _INK
        canvas.line([(x0, y0), (x0, bend), (x1, bend), (x1, y1)], color, dashed=is_broken)
        for row, text in enumerate((info.authority, _figures(info, now))):
            canvas.text((x1 + 5, bend + 14 + 13 * row), text, 10, color)
    for frame, (x, y) in sorted(places.items()):
        right, low = x + _BOX_WIDTH, y + _BOX_HEIGHT
        canvas.area([(x, y), (right, y), (right, low), (x, low)], _FILL, _INK)
        canvas.text((x + _BOX_WIDTH / 2, y + 20), frame, 13, _BLACK, centred=True)
    return canvas


def _lay_out(frames: Mapping[str, FrameInfo]) -> dict[str, Point2]:
    """Upper left corners of the boxes: leaves side by side, parents over the middle of their children."""
    children, depths = _children(frames), {frame: len(lead) // 4 for frame, lead in _walk(frames)}
    leaves = [frame for frame in depths if frame not in children]
    across = {leaf: _MARGIN + float(place) * (_BOX_WIDTH + _GAP_X) for place, leaf in enumerate(leaves)}
    for frame in reversed(depths):
        if below := children.get(frame):
            across[frame] = (across[below[0]] + across[below[-1]]) / 2
    return {frame: (across[frame], _MARGIN + depth * (_BOX_HEIGHT + _GAP_Y)) for frame, depth in depths.items()}
