"""Edges of the tree of frames, paths over them, and tf2's reasons to refuse. Callers hold the buffer's lock."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from zteam.kernels.transforms import ROUNDING, Edge, Floats, FramePath, compose, invert
from zteam.transforms import errors
from zteam.transforms.rigid import IDENTITY

UNIT_TOLERANCE = 0.01
"""tf2 refuses a quaternion whose squared length is this far from 1."""


class Rejection(NamedTuple):
    """Why a transform was not stored: tf2's code, and a text."""

    code: str
    text: str


class FrameInfo(msgspec.Struct, frozen=True):
    """The figures of one child frame; times in ns, rate in Hz."""

    parent: str
    authority: str
    static: bool
    rate: float
    oldest: int
    newest: int
    samples: int


def make_path(up: Sequence[Edge], down: Sequence[Edge]) -> FramePath:
    """The path over the edges from the source and from the target to their common ancestor, static ones composed."""
    first, steps = IDENTITY, list[tuple[Edge, bool, Floats]]()
    for edge, is_down in [(edge, False) for edge in up] + [(edge, True) for edge in reversed(down)]:
        if not edge.static:
            steps.append((edge, is_down, IDENTITY))
            continue
        floats = invert(edge[0].pose) if is_down else edge[0].pose
        if steps:
            steps[-1] = (*steps[-1][:2], compose(floats, steps[-1][2]))
        else:
            first = compose(floats, first)
    return FramePath(first, steps)


def info_of(edge: Edge) -> FrameInfo:
    """The figures of an edge that has a sample."""
    oldest, newest, count = edge[0].stamp, edge.newest, len(edge)
    rate = 0.0 if newest == oldest else (count - 1) * 1e9 / (newest - oldest)
    return FrameInfo(edge.parent, edge.authority, edge.static, rate, oldest, newest, count)


def extrapolation(edge: Edge, time: int, leg: str) -> errors.ExtrapolationException | None:
    """tf2's exception for a time for which a moving edge has no data; `leg` is between which frames."""
    if not len(edge):
        return errors.NoDataForExtrapolationException(f"there is no data {leg}: time jumped back, or it was cleared")
    first, last = edge[0].stamp, edge.newest
    if first <= time <= last:
        return None
    kind: type[errors.ExtrapolationException] = errors.NoDataForExtrapolationException
    if first < last:
        kind = errors.ForwardExtrapolationException if time > last else errors.BackwardExtrapolationException
    return kind(f"there is no data {leg} at {_seconds(time)} s, but from {_seconds(first)} s to {_seconds(last)} s")


def _seconds(nanoseconds: int) -> str:
    """Nanoseconds as seconds with nine decimals; a double does not have enough digits for that."""
    whole, rest = divmod(nanoseconds, 10**9)
    return f"{whole}.{rest:09d}"


def check_sample(parent: str, child: str, floats: Floats, authority: str) -> Rejection | None:
    """Check the names, that all numbers are finite, and that the quaternion is nearly a unit one."""
    if not child:
        return Rejection("TF_NO_CHILD_FRAME_ID", f"a transform from {authority} has no child_frame_id")
    if not parent:
        code, problem = "TF_NO_FRAME_ID", "has no frame_id"
    elif parent == child:
        code, problem = "TF_SELF_TRANSFORM", "is its own parent"
    elif not all(map(math.isfinite, floats)):
        code, problem = "TF_NAN_INPUT", "holds a number that is not finite"
    elif abs(sum(q * q for q in floats[3:]) - 1.0) >= UNIT_TOLERANCE:
        code, problem = "TF_DENORMALIZED_QUATERNION", "has a rotation that is no unit quaternion"
    else:
        return None
    return Rejection(code, f"{child} from {authority} {problem}")


def normalise(floats: Floats) -> Floats:
    """The same transform with its quaternion scaled to length 1."""
    x, y, z, i, j, k, w = floats
    square = i * i + j * j + k * k + w * w
    if abs(square - 1.0) < ROUNDING:
        return floats
    scale = square**-0.5
    return (x, y, z, i * scale, j * scale, k * scale, w * scale)
