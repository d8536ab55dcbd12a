"""The walk from one frame to another, edge by edge, with tf2's errors. It is slow, and right for every tree.

Callers hold the buffer's lock.
"""

from bisect import bisect_right
from collections.abc import Mapping

from zteam.tf.errors import (
    BackwardExtrapolationException,
    ConnectivityException,
    ForwardExtrapolationException,
    LookupException,
    NoDataForExtrapolationException,
    TransformException,
)
from zteam.tf.paths import Legs
from zteam.tf.rigid import IDENTITY, Floats, compose, interpolate, invert
from zteam.tf.time_cache import TimeCache


class Walk:
    """One look-up: `source` in `target` at `time` (None = by the newest parents)."""

    def __init__(self, edges: Mapping[str, TimeCache], cache: int, target: str, source: str, time: int | None) -> None:
        self._edges = edges
        self._cache = cache
        self._target = target
        self._source = source
        self._time = time

    def find_legs(self) -> Legs:
        """The edges between the two frames. Raises tf2's exceptions if the frames are not connected."""
        up = self._ancestors()
        depth = {name: i for i, (name, _) in enumerate(up)}
        down: list[TimeCache] = []
        frame = self._target
        failure: TransformException | None = None
        while frame not in depth:
            self._refuse_loop(len(down))
            edge = self._edges.get(frame)
            parent, problem = self._parent(edge)
            failure = problem or failure
            if edge is None or not parent:
                raise failure or self._first_failure() or self._unconnected()
            down.append(edge)
            frame = parent
        return Legs(tuple(edge for _, edge in up[: depth[frame]] if edge is not None), tuple(down))

    def _ancestors(self) -> list[tuple[str, TimeCache | None]]:
        """The source and its ancestors, each with the edge to its parent (None for the root)."""
        found: list[tuple[str, TimeCache | None]] = []
        frame = self._source
        while True:
            self._refuse_loop(len(found))
            edge = self._edges.get(frame)
            parent, _ = self._parent(edge)
            found.append((frame, edge if parent else None))
            if not parent:
                return found
            frame = parent

    def _refuse_loop(self, steps: int) -> None:
        # The newest parents never form a loop, but parents at different times can.
        if steps > len(self._edges) + 1:
            raise LookupException("The tf tree is invalid because it contains a loop.")

    def _first_failure(self) -> TransformException | None:
        """The exception that ended the walk up from the source; None if the walk reached a root."""
        frame = self._source
        while True:
            parent, problem = self._parent(self._edges.get(frame))
            if not parent:
                return problem
            frame = parent

    def _parent(self, edge: TimeCache | None) -> tuple[str, TransformException | None]:
        """The edge's parent at the time; without one, an empty name and the exception that says why."""
        if edge is None:
            return "", None
        if self._time is None or edge.static:
            return edge.parent, None
        try:
            return edge.parent_of(self._index(edge, self._time)), None
        except TransformException as error:
            return "", error

    def evaluate(self, legs: Legs, time: int) -> Floats:
        """The transform along the legs. Raises the three kinds of extrapolation."""
        source_side, target_side = IDENTITY, IDENTITY
        for edge in legs.source:
            source_side = compose(self._at(edge, time), source_side)
        for edge in legs.target:
            target_side = compose(self._at(edge, time), target_side)
        return compose(invert(target_side), source_side)

    def _at(self, edge: TimeCache, time: int) -> Floats:
        if edge.static:
            return edge.floats_of(0)
        at = self._index(edge, time)
        stamps = edge.history[0]
        older, stamp = edge.floats_of(at), stamps[at]
        if stamp == time or edge.parent_of(at) != edge.parent_of(at + 1):
            # Samples with different parents cannot be interpolated: the older one holds until the newer one.
            return older
        return interpolate(older, edge.floats_of(at + 1), (time - stamp) / (stamps[at + 1] - stamp))

    def _index(self, edge: TimeCache, time: int) -> int:
        """Index of the newest sample that is not newer than `time`. Raises the three kinds of extrapolation."""
        edge.prune(self._cache)
        stamps = edge.history[0]
        looking = f", when looking up transform from frame [{self._source}] to frame [{self._target}]"
        if not stamps:
            raise NoDataForExtrapolationException(f"Lookup would require data, but the buffer was cleared{looking}")
        first, last = stamps[0], stamps[-1]
        if first == last != time:
            raise NoDataForExtrapolationException(
                f"Lookup would require extrapolation at time {_seconds(time)}, but only time {_seconds(first)} "
                f"is in the buffer{looking}"
            )
        if time > last:
            raise ForwardExtrapolationException(
                f"Lookup would require extrapolation {_seconds(time - last)}s into the future.  "
                f"Requested time {_seconds(time)} but the latest data is at time {_seconds(last)}{looking}"
            )
        if time < first:
            raise BackwardExtrapolationException(
                f"Lookup would require extrapolation {_seconds(first - time)}s into the past.  "
                f"Requested time {_seconds(time)} but the earliest data is at time {_seconds(first)}{looking}"
            )
        return bisect_right(stamps, time) - 1

    def _unconnected(self) -> ConnectivityException:
        return ConnectivityException(
            f"Could not find a connection between '{self._target}' and '{self._source}' because they are not part of "
            "the same tree.Tf has two or more unconnected trees."
        )


def latest_common(legs: Legs) -> int:
    """The newest time that all moving edges have; edges stamped 0 count as static, as in tf2."""
    return min((edge.newest for edge in (*legs.source, *legs.target) if edge.newest), default=0)


def _seconds(nanoseconds: int) -> str:
    """Nanoseconds as seconds with nine decimals; a double does not have enough digits for that."""
    whole, rest = divmod(nanoseconds, 10**9)
    return f"{whole}.{rest:09d}"
