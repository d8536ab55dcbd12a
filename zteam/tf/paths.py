"""The way from one frame to another, and the transform along it.

A path is kept until the tree changes its shape. Its static legs are multiplied out once; what is left is one step for
each moving edge. Where everything turns about z only, as on a floor, the steps are products of complex numbers.
"""

from bisect import bisect_right
from collections.abc import Mapping
from math import atan2, cos, sin
from typing import NamedTuple

from zteam.tf.edges import Edge, Planar, as_floats
from zteam.tf.errors import (
    BackwardExtrapolationException,
    ConnectivityException,
    ForwardExtrapolationException,
    LookupException,
    NoDataForExtrapolationException,
    TransformException,
)
from zteam.tf.rigid import IDENTITY, Floats, compose, interpolate, invert

Names = tuple[str, str]
"""(source, target), for error texts."""


class Step(NamedTuple):
    """A moving edge, and the product of the static legs behind it."""

    edge: Edge
    inverse: bool
    """Whether the path goes down this edge, from parent to child."""
    fixed: tuple[float, float, float, float, float, float, float] | None
    """x, y, z, qz, qw, cos and sin of the yaw; None if there are no static legs."""


class Path(NamedTuple):
    """Edges from two frames up to their common ancestor."""

    source: tuple[Edge, ...]
    target: tuple[Edge, ...]
    first: Planar
    """The product of the static legs before the first step."""
    steps: tuple[Step, ...]
    is_quick: bool
    """Whether every leg is planar, and no edge of the path has more than one parent in its history."""


_START: Planar = (0.0, 0.0, 0.0, 0.0, 1.0)


def make_path(source: tuple[Edge, ...], target: tuple[Edge, ...]) -> Path:
    """The path whose edges these are, from either end upward."""
    legs = [(edge, False) for edge in source] + [(edge, True) for edge in reversed(target)]
    if any(edge.parents is not None or edge.spatial for edge, _ in legs):
        return Path(source, target, _START, (), False)
    products: list[Planar | None] = [None]
    moving: list[tuple[Edge, bool]] = []
    for edge, inverse in legs:
        if not edge.static:
            moving.append((edge, inverse))
            products.append(None)
        else:
            value = edge.values[0]
            assert len(value) == 5
            products[-1] = _follow(products[-1] or _START, value, inverse)
    steps = tuple(
        Step(edge, inverse, fixed and _with_cos_sin(fixed))
        for (edge, inverse), fixed in zip(moving, products[1:], strict=True)
    )
    return Path(source, target, products[0] or _START, steps, True)


def _with_cos_sin(value: Planar) -> tuple[float, float, float, float, float, float, float]:
    x, y, z, k, w = value
    return x, y, z, k, w, w * w - k * k, 2.0 * w * k


def _follow(passed: Planar, value: Planar, inverse: bool) -> Planar:
    """One leg more."""
    (x, y, z, k, w), (px, py, pz, qk, qw) = passed, value
    cos = qw * qw - qk * qk
    if inverse:
        sin = -2.0 * qw * qk
        dx, dy = x - px, y - py
        return cos * dx - sin * dy, sin * dx + cos * dy, z - pz, qw * k - qk * w, qw * w + qk * k
    sin = 2.0 * qw * qk
    return px + cos * x - sin * y, py + sin * x + cos * y, z + pz, qw * k + qk * w, qw * w - qk * k


def evaluate_quickly(path: Path, time: int) -> tuple[Planar, int] | None:
    """The transform along a quick path at `time`, 0 = latest, and its stamp; None where it takes the long way.

    The long way says what is missing, and serves what is not planar. All arithmetic is written out here (`_follow` and
    the long way's `interpolate` say the same in calls): this is the hot path, and a call costs as much as ten products.
    """
    steps = path.steps
    if time == 0 and steps:
        time = steps[0][0].stamps[-1]
        for edge, _, _ in steps:
            newest = edge.stamps[-1]
            if newest < time:
                time = newest
        if time == 0:
            return None
    x, y, z, k, w = path.first
    for edge, inverse, fixed in steps:
        stamps = edge.stamps
        newest = stamps[-1]
        if newest == time:
            px, py, pz, qk, qw = edge.values[-1]  # type: ignore[misc]
        elif stamps[0] <= time < newest:
            at, before = -2, stamps[-2]
            if time < before:
                # Where it would be if samples came evenly, which they mostly do; bisection touches far more memory.
                first = stamps[0]
                at = (time - first) * (len(stamps) - 1) // (newest - first)
                if not stamps[at] <= time < stamps[at + 1]:
                    at = bisect_right(stamps, time) - 1
                before = stamps[at]
            px, py, pz, qk, qw = edge.values[at]  # type: ignore[misc]
            if before != time:
                at += 1
                share = (time - before) / (stamps[at] - before)
                nx, ny, nz, nk, nw = edge.values[at]  # type: ignore[misc]
                px += share * (nx - px)
                py += share * (ny - py)
                pz += share * (nz - pz)
                cross, dot = nk * qw - nw * qk, nw * qw + nk * qk
                if cross:
                    # The short way round, for a quaternion and its negative are one rotation.
                    angle = share * (atan2(cross, dot) if dot >= 0.0 else atan2(-cross, -dot))
                    c, s = cos(angle), sin(angle)
                    qk, qw = qk * c + qw * s, qw * c - qk * s
        else:
            return None
        c, s = qw * qw - qk * qk, (qw + qw) * qk
        if inverse:
            x, y, z = x - px, y - py, z - pz
            x, y = c * x + s * y, c * y - s * x
            k, w = qw * k - qk * w, qw * w + qk * k
        else:
            x, y, z = px + c * x - s * y, py + s * x + c * y, z + pz
            k, w = qw * k + qk * w, qw * w - qk * k
        if fixed is not None:
            px, py, pz, qk, qw, c, s = fixed
            x, y, z = px + c * x - s * y, py + s * x + c * y, z + pz
            k, w = qw * k + qk * w, qw * w - qk * k
    return (x, y, z, k, w), time


def evaluate(path: Path, time: int, what: Names) -> Floats:
    """target_from_source at `time`, leg by leg. Raises the three kinds of extrapolation."""
    source_side, target_side = IDENTITY, IDENTITY
    for edge in path.source:
        source_side = compose(_at(edge, time, what), source_side)
    for edge in path.target:
        target_side = compose(_at(edge, time, what), target_side)
    return compose(invert(target_side), source_side) if path.target else source_side


def latest(edges: tuple[Edge, ...]) -> int:
    """The newest time that all moving edges have; edges stamped 0 count as static, as in tf2."""
    return min((e.stamps[-1] for e in edges if not e.static and e.stamps and e.stamps[-1]), default=0)


def walk(edges: Mapping[str, Edge], target: str, source: str, time: int | None) -> Path:
    """The path by the parents at `time` (None = newest). Raises LookupException or whatever is missing."""
    what = source, target
    up = _ancestors(edges, source, time)
    down: list[Edge] = []
    frame = target
    depth = {name: i for i, (name, _) in enumerate(up)}
    failure: TransformException | None = None
    while frame not in depth:
        if len(down) > len(edges):
            raise LookupException("The tf tree is invalid because it contains a loop.")
        edge = edges.get(frame)
        parent, problem = _parent(edge, time, what)
        failure = problem or failure
        if edge is None or not parent:
            raise failure or _first_failure(edges, source, time, what) or _unconnected(target, source)
        down.append(edge)
        frame = parent
    return make_path(tuple(e for _, e in up[: depth[frame]] if e is not None), tuple(down))


def _ancestors(edges: Mapping[str, Edge], frame: str, time: int | None) -> list[tuple[str, Edge | None]]:
    """`frame` and everything above it, each with the edge that leads further up (None at the top)."""
    found: list[tuple[str, Edge | None]] = []
    while True:
        if len(found) > len(edges) + 1:
            raise LookupException("The tf tree is invalid because it contains a loop.")
        edge = edges.get(frame)
        parent, _ = _parent(edge, time, ("", ""))
        found.append((frame, edge if parent else None))
        if not parent:
            return found
        frame = parent


def _first_failure(edges: Mapping[str, Edge], frame: str, time: int | None, what: Names) -> TransformException | None:
    """The extrapolation that ended the walk up from `frame`, if one did."""
    while True:
        parent, problem = _parent(edges.get(frame), time, what)
        if not parent:
            return problem
        frame = parent


def _parent(edge: Edge | None, time: int | None, what: Names) -> tuple[str, TransformException | None]:
    """The edge's parent at `time` (None = newest), or empty with the reason."""
    if edge is None or (time is None and not edge.stamps):
        return "", None
    if time is None or edge.static:
        return edge.parent, None
    try:
        return edge.parent_at(_index(edge, time, what)), None
    except TransformException as error:
        return "", error


def _unconnected(target: str, source: str) -> ConnectivityException:
    return ConnectivityException(
        f"Could not find a connection between '{target}' and '{source}' because they are not part of the same tree."
        "Tf has two or more unconnected trees."
    )


def _index(edge: Edge, time: int, what: Names) -> int:
    """Index of the newest sample that is not newer than `time`. Raises the three kinds of extrapolation."""
    stamps = edge.stamps
    looking = f", when looking up transform from frame [{what[0]}] to frame [{what[1]}]"
    if not stamps:
        raise NoDataForExtrapolationException(f"Lookup would require data, but the buffer was cleared{looking}")
    newest = len(stamps) - 1
    if time == stamps[newest]:
        return newest
    if newest == 0:
        raise NoDataForExtrapolationException(
            f"Lookup would require extrapolation at time {_seconds(time)}, but only time {_seconds(stamps[0])} "
            f"is in the buffer{looking}"
        )
    if time > stamps[newest]:
        raise ForwardExtrapolationException(
            f"Lookup would require extrapolation {_seconds(time - stamps[newest])}s into the future.  "
            f"Requested time {_seconds(time)} but the latest data is at time {_seconds(stamps[newest])}{looking}"
        )
    if time < stamps[0]:
        raise BackwardExtrapolationException(
            f"Lookup would require extrapolation {_seconds(stamps[0] - time)}s into the past.  "
            f"Requested time {_seconds(time)} but the earliest data is at time {_seconds(stamps[0])}{looking}"
        )
    return bisect_right(stamps, time) - 1


def _seconds(nanoseconds: int) -> str:
    """To the nanosecond: a double's digits do not reach that far."""
    whole, rest = divmod(nanoseconds, 10**9)
    return f"{whole}.{rest:09d}"


def _at(edge: Edge, time: int, what: Names) -> Floats:
    if edge.static:
        return as_floats(edge.values[0])
    at = _index(edge, time, what)
    older, stamp = as_floats(edge.values[at]), edge.stamps[at]
    # Nothing lies between two parents: the older sample holds until the change.
    if stamp == time or edge.parent_at(at + 1) != edge.parent_at(at):
        return older
    return interpolate(older, as_floats(edge.values[at + 1]), (time - stamp) / (edge.stamps[at + 1] - stamp))
