"""Transforms as text: tf_echo's block, and the tree."""

import math
from collections.abc import Mapping

from zteam.geometry import rpy_from_quaternion
from zteam.messages import TransformStamped, ns_from_time
from zteam.tf.tree import FrameInfo


def format_transform(transform: TransformStamped) -> str:
    """tf_echo's block: time, translation, quaternion, roll, pitch and yaw in radians and degrees."""
    t, r = transform.transform.translation, transform.transform.rotation
    rpy = rpy_from_quaternion(r.x, r.y, r.z, r.w)
    indent = " " * 12
    return "\n".join(
        [
            f"At time {ns_from_time(transform.header.stamp) / 1e9:.3f}",
            f"- Translation: {_row(t.x, t.y, t.z)}",
            f"- Rotation: in Quaternion {_row(r.x, r.y, r.z, r.w)}",
            f"{indent}in RPY (radian) {_row(*rpy)}",
            f"{indent}in RPY (degree) {_row(*map(math.degrees, rpy))}",
        ]
    )


def _row(*values: float) -> str:
    # Adding 0.0 turns a rounded -0.000 into 0.000.
    return "[" + ", ".join(f"{round(v, 3) + 0.0:.3f}" for v in values) + "]"


def format_tree(frames: Mapping[str, FrameInfo], now: int) -> str:
    """The tree with one frame on each line, with its rate, age and authority; several roots follow one another."""
    children: dict[str, list[str]] = {}
    for child, info in sorted(frames.items()):
        children.setdefault(info.parent, []).append(child)
    lines: list[str] = []
    # A stack of (frame, indent of its own line, indent of its children's lines); the next frame is on top.
    todo = [(root, "", "") for root in sorted(set(children) - set(frames), reverse=True)]
    while todo:
        frame, own, lead = todo.pop()
        lines.append(own + frame + (_describe(frames[frame], now) if frame in frames else ""))
        below = children.get(frame, [])
        for child in reversed(below):
            last = child == below[-1]
            todo.append((child, lead + ("└── " if last else "├── "), lead + ("    " if last else "│   ")))
    return "\n".join(lines)


def _describe(info: FrameInfo, now: int) -> str:
    if info.static:
        return f"  (static, by {info.authority})"
    age = max(0, now - info.newest) / 1e9 if now else 0.0
    return f"  ({info.rate:.1f} Hz, {age:.2f} s old, by {info.authority})"
