"""The tree of frames: it checks and stores samples, and finds the transform between two frames."""

from collections.abc import Mapping

from zteam.tf.errors import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
)
from zteam.tf.paths import Answer, Path, prepare_path
from zteam.tf.rigid import IDENTITY, Floats
from zteam.tf.time_cache import TimeCache, is_planar
from zteam.tf.validation import Rejection
from zteam.tf.walk import Walk, latest_common

DUPLICATE = Rejection("DUPLICATE", "")
"""The edge already has exactly this sample."""


class Tree:
    """All edges. Callers hold the buffer's lock."""

    def __init__(self, cache: int) -> None:
        self.cache = cache
        self.edges: dict[str, TimeCache] = {}
        self.paths: dict[tuple[str, str], Path] = {}
        """Prepared paths by target and source; cleared if a frame, parent, static transform or edge's form changes."""
        self._frames: set[str] = set()
        """Every frame that was ever a child or a parent."""

    def put(
        self, child: str, parent: str, stamp: int, floats: Floats, authority: str, static: bool
    ) -> Rejection | None:
        """Store a sample whose names and numbers were checked; None, or why it was refused."""
        edge = self.edges.get(child)
        refused = self._check(edge, child, parent, stamp, floats, authority, static)
        if refused is not None:
            return refused
        if static:
            if edge is None or not edge.static or edge.parent != parent or edge.history[1][0] != floats:
                edge = TimeCache(static=True, planar=False)
                edge.fix(floats, parent)
                self._replace(child, edge)
        else:
            edge = self._ready(edge, child, parent, floats)
            edge.insert(stamp, floats, parent, self.cache)
        edge.authority = authority
        self._frames.update((child, parent))
        return None

    def _ready(self, edge: TimeCache | None, child: str, parent: str, floats: Floats) -> TimeCache:
        """Prepare the edge for a moving sample with this parent and form, and return it."""
        if edge is None or edge.static or not edge.parent:
            edge = TimeCache(False, is_planar(floats), floats[2])
            self._replace(child, edge)
            return edge
        mixed = edge.parents is None and edge.parent != parent
        if mixed or not edge.takes(floats):
            edge.reshape(edge.planar and edge.takes(floats), mixed)
            self.paths.clear()
        return edge

    def _replace(self, child: str, edge: TimeCache) -> None:
        self.edges[child] = edge
        self.paths.clear()

    def _check(
        self, edge: TimeCache | None, child: str, parent: str, stamp: int, floats: Floats, authority: str, static: bool
    ) -> Rejection | None:
        if edge is not None and edge.parent:
            if edge.static and not static:
                return Rejection(
                    "TF_STATIC_FRAME", f"{child} is static by {edge.authority}: {authority}'s sample is refused"
                )
            if not static:
                if edge.newest > stamp + self.cache:
                    return Rejection(
                        "TF_OLD_DATA", f"{child} from {authority} is older than the cache of {self.cache / 1e9} s"
                    )
                at = edge.find(stamp)
                if at >= 0:
                    if edge.has(at, floats, parent):
                        return DUPLICATE
                    return Rejection("TF_REPEATED_DATA", f"{child} has a sample of {stamp / 1e9:.9f} s already")
            if edge.parent == parent:
                return None
        return self._check_loop(child, parent, authority)

    def _check_loop(self, child: str, parent: str, authority: str) -> Rejection | None:
        if child not in self.chain(parent):
            return None
        other = self.edges[parent].authority if parent in self.edges else authority
        return Rejection("TF_LOOP", f"{parent} -> {child} by {authority} closes a loop with {other}'s transforms")

    def chain(self, frame: str) -> list[str]:
        """A frame and its ancestors, by the newest parents."""
        found = [frame]
        # This ends: a sample that would close a loop with the newest parents is refused.
        while (edge := self.edges.get(found[-1])) is not None and edge.parent:
            found.append(edge.parent)
        return found

    def forget(self, child: str) -> None:
        """Forget an edge and its history."""
        if self.edges.pop(child, None) is not None:
            self.paths.clear()

    def clear(self) -> None:
        """Forget all moving data."""
        for child, edge in self.edges.items():
            if not edge.static:
                self.edges[child] = TimeCache(static=False, planar=True)
        self.paths.clear()

    def newest(self, frame: str) -> int:
        """Stamp of a frame's own newest sample; 0 if it has none or does not move."""
        edge = self.edges.get(frame)
        return edge.newest if edge is not None else 0

    def check_frames(self, **arguments: str) -> None:
        """Raise InvalidArgumentException or LookupException for names that no frame has."""
        _check_frames(self._frames, arguments)

    def latest(self, target: str, source: str) -> int:
        """The newest time that all moving edges between two frames have; raises where they are not connected."""
        self.check_frames(target_frame=target, source_frame=source)
        if target == source:
            return self.newest(target)
        return latest_common(Walk(self.edges, self.cache, target, source, None).find_legs())

    def solve(self, target: str, source: str, time: int) -> Answer:
        """target_from_source at `time`; raises tf2's exceptions."""
        path = self.paths.get((target, source))
        answer = path.solve(time) if path is not None else None
        return answer if answer is not None else self._search(target, source, time)

    def _search(self, target: str, source: str, time: int) -> Answer:
        """`solve` without a prepared path; it prepares one if each edge on the way has one parent."""
        if target == source:
            return (time or self.newest(target), *IDENTITY)
        self.check_frames(target_frame=target, source_frame=source)
        try:
            legs = Walk(self.edges, self.cache, target, source, None).find_legs()
        except ConnectivityException:
            if not time:
                raise
            # Frames that are not connected by the newest parents may have been connected at that time.
            legs = Walk(self.edges, self.cache, target, source, time).find_legs()
        if all(edge.parents is None for edge in (*legs.source, *legs.target)):
            path = self.paths[target, source] = prepare_path(legs, self.cache)
            answer = path.solve(time)
            if answer is not None:
                return answer
            time = time or latest_common(legs)
            walk = Walk(self.edges, self.cache, target, source, time)
        else:
            # The parents at that time may differ from the newest ones.
            time = time or latest_common(legs)
            walk = Walk(self.edges, self.cache, target, source, time)
            legs = walk.find_legs()
        try:
            return (time, *walk.evaluate(legs, time))
        except ExtrapolationException:
            # If several edges lack data, tf2 names the one that its walk through the tree reaches.
            walk.find_legs()
            raise


def _check_frames(known: set[str], arguments: Mapping[str, str]) -> None:
    """Raise tf2's exception if an argument is not the name of a known frame."""
    for argument, name in arguments.items():
        what = f"passed to lookupTransform argument {argument}"
        if not name:
            raise InvalidArgumentException(f"Invalid argument {what} in tf2 frame_ids cannot be empty")
        if name.startswith("/"):
            raise InvalidArgumentException(
                f"Invalid argument \"{name}\" {what} in tf2 frame_ids cannot start with a '/' like: "
            )
    for argument, name in arguments.items():
        if name not in known:
            raise LookupException(f'"{name}" passed to lookupTransform argument {argument} does not exist. ')
