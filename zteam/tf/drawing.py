"""Drawings of the tree like those of view_frames, as SVG or as a Graphviz file."""

from collections.abc import Mapping
from xml.sax.saxutils import escape

from zteam.tf.time_cache import FrameInfo

STALE = 1.0
"""Seconds without a sample after which a moving edge is drawn as broken."""

_BOX_WIDTH, _BOX_HEIGHT, _GAP_X, _GAP_Y, _MARGIN = 190, 30, 16, 62, 14


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


def tree_as_svg(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree as SVG: parents are above their children, broken edges are red and dashed."""
    places = _lay_out(frames)
    width = max((x for x, _ in places.values()), default=0) + _BOX_WIDTH + 2 * _MARGIN
    height = max((y for _, y in places.values()), default=0) + _BOX_HEIGHT + 2 * _MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" font-family="sans-serif">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for child, info in sorted(frames.items()):
        lines += _svg_edge(places[info.parent], places[child], info, now)
    for frame, (x, y) in sorted(places.items()):
        lines.append(
            f'<rect x="{x + _MARGIN:.0f}" y="{y + _MARGIN:.0f}" width="{_BOX_WIDTH}" height="{_BOX_HEIGHT}" rx="6" '
            'fill="#eef3fb" stroke="#456"/>'
        )
        lines.append(
            f'<text x="{x + _MARGIN + _BOX_WIDTH / 2:.0f}" y="{y + _MARGIN + 20:.0f}" font-size="13" '
            f'text-anchor="middle">{escape(frame)}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


def _svg_edge(parent: tuple[float, float], child: tuple[float, float], info: FrameInfo, now: int) -> list[str]:
    x0, y0 = parent[0] + _MARGIN + _BOX_WIDTH / 2, parent[1] + _MARGIN + _BOX_HEIGHT
    x1, y1 = child[0] + _MARGIN + _BOX_WIDTH / 2, child[1] + _MARGIN
    broken = is_broken(info, now)
    color, dash = ("#c00", ' stroke-dasharray="5 4"') if broken else ("#456", "")
    middle = y0 + 14
    lines = [f'<path d="M{x0:.0f} {y0:.0f}V{middle:.0f}H{x1:.0f}V{y1:.0f}" fill="none" stroke="{color}"{dash}/>']
    for row, text in enumerate(describe_edge(info, now)):
        at = f'x="{x1 + 5:.0f}" y="{middle + 14 + 13 * row:.0f}"'
        lines.append(f'<text {at} font-size="10" fill="{color}">{escape(text)}</text>')
    return lines


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
