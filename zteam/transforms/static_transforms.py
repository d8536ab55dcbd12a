"""The static transforms of a whole team: each child frame has one authority at a time.

What all sources say of a frame is kept. Of those that live the first one counts; without one, the last of those that
may have ended: a frame outlives its source, as in tf2. The start pose `map -> robot_N/odom` has several sources by
design, and a higher rank replaces a lower one without a conflict. A localiser publishes this edge as moving data: it
shadows a start pose of a lower rank until the localiser's data is forgotten.
"""

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import NamedTuple

from zteam import names
from zteam.clock import NOT_KNOWN, Sent
from zteam.messages import TFMessage, TransformStamped
from zteam.transforms.buffer import Buffer
from zteam.transforms.tree import Rejection


class Rank(IntEnum):
    """The sources of static transforms, the highest rank first: the lower number replaces the higher one."""

    TEAM_FILE = 0
    LOCALISER = 1
    SIMULATOR = 2
    CALLER = 3
    """A tool that asked for a static transform."""
    DESCRIPTION = 4
    """It gives way for every frame, not only for a start pose: the base itself knows best where its laser is."""


MOST_SOURCES = 8
"""Of one frame; a sender can invent sessions."""


class Static(NamedTuple):
    rank: Rank
    transform: TransformStamped
    authority: str
    sent: Sent = NOT_KNOWN


def is_start_pose(transform: TransformStamped) -> bool:
    """Whether this is a `map -> robot_N/odom`: the only edge that may have several sources."""
    return transform.header.frame_id == names.MAP_FRAME and names.is_robot_frame(transform.child_frame_id, names.ODOM)


class StaticTransforms:
    """The static transforms of a team; those that are not shadowed are also in `buffer`."""

    def __init__(self, buffer: Buffer, name_of: Callable[[str], str | None] = lambda authority: authority) -> None:
        """`name_of(authority)` is what users read for a source that lives; None for one that may have ended."""
        self.changed = False
        """Whether the full set differs from the last `message`."""
        self.holders: dict[str, Static] = {}
        """Those that count, by child frame, the shadowed ones included."""
        self._buffer, self._name_of = buffer, name_of
        self._said: dict[str, dict[str, Static]] = {}
        """By child frame and authority, in the order in which they first said the frame."""
        self._localised: set[str] = set()
        """The `robot_N/odom` frames that a localiser has placed."""

    def shown(self, authority: str) -> str:
        """What users read for a source, whether it lives or not."""
        return self._name_of(authority) or authority

    def put(self, static: Static) -> Rejection | None:
        """Keep what a source says; None, or why it does not count though no higher rank hides it."""
        rank, transform, authority, sent = static
        child = transform.child_frame_id
        said = self._said.setdefault(child, {})
        before = said.get(authority)
        if before is not None and before.sent.hides(sent):
            if before.sent.stamp == sent.stamp:
                said[authority] = before._replace(sent=sent)
            return None
        said[authority] = static
        if (refused := self._choose(child)) is not None:
            if before is None:
                self._take_back(child, authority)
            else:
                said[authority] = before
            return refused
        if len(said) > MOST_SOURCES:
            del said[max(enumerate(said.values()), key=self._order)[1].authority]
        holder = self.holders[child]
        gives_way = Rank.DESCRIPTION in (holder.rank, rank) or (is_start_pose(transform) and holder.rank < rank)
        if holder.authority == authority or gives_way:
            return None
        first = self.shown(holder.authority)
        text = f"{child} is said by {first} and by {self.shown(authority)}: {first} stays"
        return Rejection("second authority", text)

    def refusal(self, static: Static) -> Rejection | None:
        """What `put` would return; nothing is kept."""
        child, authority, changed = static.transform.child_frame_id, static.authority, self.changed
        before = self._said.get(child, {}).get(authority)
        refused = self.put(static)
        if before is not None:
            self.put(before)
        elif authority in self._said.get(child, {}):
            self._take_back(child, authority)
        self.changed = changed
        return refused

    def _choose(self, child: str) -> Rejection | None:
        """Let the best source count; None, or why the buffer refused it and the one of before still counts."""
        held, said = self.holders.get(child), self._said[child]
        if not said:
            del self._said[child]
            if self.holders.pop(child, None) is not None:
                self.changed = True
                if child not in self._localised:
                    self._buffer.forget(child)
            return None
        _, best = min(enumerate(said.values()), key=self._order)
        if best != held and not self._is_shadowed(child, best):
            if refused := self._store(best):
                return refused
            self.changed |= held is None or best.transform != held.transform
        self.holders[child] = best
        return None

    def _store(self, static: Static) -> Rejection | None:
        child = static.transform.child_frame_id
        with self._buffer.lock:
            known = self._buffer.frame(child)
            if known is None or known.static:
                return self._buffer.set_transform_static(static.transform, static.authority)
            source, mover = self.shown(static.authority), known.authority
            return Rejection("moving frame", f"{child} moves, by {mover}: the static transform of {source} is refused")

    def _order(self, numbered: tuple[int, Static]) -> tuple[int, bool, int]:
        """The least one counts: of sources that live the first one, of the others the one that came last."""
        number, (rank, transform, authority, _) = numbered
        lives = self._name_of(authority) is not None
        counts = rank if rank == Rank.DESCRIPTION or is_start_pose(transform) else 0
        return counts, not lives, number if lives else -number

    def look_again(self, authority: str) -> None:
        """A source has come to life or may have ended: other sources may count now."""
        for child, said in self._said.items():
            if authority in said and len(said) > 1:
                self._choose(child)

    def drop_reparented(self, authority: str, new: Mapping[str, TransformStamped], sent: Sent = NOT_KNOWN) -> None:
        """Drop what the source said before it `sent` its `new` edges (by child frame) and that contradicts them."""
        parents = {transform.header.frame_id for transform in new.values()}
        for child, said in list(self._said.items()):
            if authority in said and not said[authority].sent.hides(sent):
                parent = said[authority].transform.header.frame_id
                if new[child].header.frame_id != parent if child in new else child in parents and parent in new:
                    self._take_back(child, authority)

    def drop_authority(self, authority: str) -> None:
        for child, said in list(self._said.items()):
            if authority in said:
                self._take_back(child, authority)

    def _take_back(self, child: str, authority: str) -> None:
        del self._said[child][authority]
        self._choose(child)

    def localise(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store a localiser's moving `map -> robot_N/odom`, which shadows the static one; None, or why it was refused.

        The team file does not give this start pose: it would hide the localiser's.
        """
        child = transform.child_frame_id
        shadowed = None if child in self._localised else self.holders.get(child)
        with self._buffer.lock:
            if shadowed is not None:
                self._buffer.forget(child)
            refused = self._buffer.set_transform(transform, authority)
            if refused is None:
                self._localised.add(child)
                self.changed |= shadowed is not None
            elif shadowed is not None:
                # A refused sample replaces nothing.
                self._buffer.set_transform_static(shadowed.transform, shadowed.authority)
        return refused

    def restore_start_poses(self) -> None:
        """Forget what the localisers published: each start pose holds again until its localiser publishes."""
        for child in self._localised:
            self._buffer.forget(child)
            shadowed = self.holders.get(child)
            if shadowed is not None:
                self._buffer.set_transform_static(shadowed.transform, shadowed.authority)
                self.changed = True
        self._localised.clear()

    def message(self) -> TFMessage:
        """The full set of transforms that are not shadowed, sorted by child frame; `changed` becomes False."""
        self.changed = False
        shown = [s.transform for child, s in sorted(self.holders.items()) if not self._is_shadowed(child, s)]
        return TFMessage(shown)

    def _is_shadowed(self, child: str, static: Static) -> bool:
        return static.rank > Rank.LOCALISER and child in self._localised
