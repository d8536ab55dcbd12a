"""The static transforms of a whole team: each child frame has one authority at a time.

The first source that lives holds a frame, and after it the last one that it kept out. Sources that may have ended give
way to the next one; a frame outlives its source, as in tf2. The start pose `map -> robot_N/odom` has several sources by
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


class Static(NamedTuple):
    """A static transform and its source."""

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
        self._kept_out: dict[str, Static] = {}
        """By child frame, what was refused last because another source holds the frame."""
        self._localised: set[str] = set()
        """The `robot_N/odom` frames that a localiser has placed."""

    def shown(self, authority: str) -> str:
        """What users read for a source, whether it lives or not."""
        return self._name_of(authority) or authority

    def put(self, static: Static) -> Rejection | None:
        """Let a source give a frame; None, or why it does not count though no higher rank hides it."""
        rank, transform, authority, sent = static
        child = transform.child_frame_id
        held = self.holders.get(child)
        if held is not None and held.authority == authority:
            if held.sent.hides(sent):
                if held.sent.stamp == sent.stamp:
                    self.holders[child] = held._replace(sent=sent)
                return None
        elif held is not None:
            new, old = self._precedence(static), self._precedence(held)
            if new > old or (new == old and not old[1]):
                if Rank.DESCRIPTION in (held.rank, rank) or (is_start_pose(transform) and held.rank < rank):
                    return None
                self._kept_out[child] = static
                first = self.shown(held.authority)
                text = f"{child} is said by {first} and by {self.shown(authority)}: {first} stays"
                return Rejection("second authority", text)
        if not self._is_shadowed(child, static):
            if refused := self._store(static):
                return refused
            self.changed |= held is None or transform != held.transform
        self.holders[child] = static
        return None

    def _store(self, static: Static) -> Rejection | None:
        child = static.transform.child_frame_id
        with self._buffer.lock:
            known = self._buffer.frame(child)
            if known is None or known.static:
                return self._buffer.set_transform_static(static.transform, static.authority)
            source, mover = self.shown(static.authority), known.authority
            return Rejection("moving frame", f"{child} moves, by {mover}: the static transform of {source} is refused")

    def _precedence(self, static: Static) -> tuple[int, bool]:
        """The less counts: the rank where that matters, and whether the source may have ended."""
        rank, transform, authority, _ = static
        counts = rank if rank == Rank.DESCRIPTION or is_start_pose(transform) else 0
        return counts, self._name_of(authority) is None

    def look_again(self, authority: str) -> None:
        """A source has come to life or may have ended: one that it kept out may count now."""
        for child, kept_out in [*self._kept_out.items()]:
            if authority in (self.holders[child].authority, kept_out.authority):
                del self._kept_out[child]
                self.put(kept_out)

    def drop_reparented(self, authority: str, new: Mapping[str, TransformStamped], sent: Sent = NOT_KNOWN) -> None:
        """Drop what the source said before it `sent` its `new` edges (by child frame) and that contradicts them."""
        parents = {transform.header.frame_id for transform in new.values()}
        for child, held in [*self.holders.items()]:
            if held.authority == authority and not held.sent.hides(sent):
                parent = held.transform.header.frame_id
                if new[child].header.frame_id != parent if child in new else child in parents and parent in new:
                    self._drop(child)

    def drop_authority(self, authority: str) -> None:
        for child, held in [*self.holders.items()]:
            if held.authority == authority:
                self._drop(child)

    def _drop(self, child: str) -> None:
        del self.holders[child]
        self.changed = True
        if child not in self._localised:
            self._buffer.forget(child)
        if (kept_out := self._kept_out.pop(child, None)) is not None:
            self.put(kept_out)

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
