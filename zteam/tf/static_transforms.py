"""The static transforms of a whole team: each child frame has one authority, which is chosen by rank.

The start pose `map -> robot_N/odom` has several sources by design. A source of a higher rank replaces the other one
without a conflict. A localiser publishes this edge as moving data: it shadows a start pose of a lower rank, which is
kept aside and comes back when the localiser's data is forgotten.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

from zteam.messages import TFMessage, TransformStamped
from zteam.tf.buffer import Buffer
from zteam.tf.own_frames import is_start_pose
from zteam.tf.validation import Rejection


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


class StaticTransforms:
    """The static transforms of a team; those that are not shadowed are also in `buffer`."""

    def __init__(self, buffer: Buffer) -> None:
        self.changed = False
        """Whether the full set differs from the last `message`."""
        self._buffer = buffer
        self._statics: dict[str, Static] = {}
        """By child frame, the shadowed ones included."""
        self._localised: set[str] = set()
        """The `robot_N/odom` frames that a localiser has placed."""

    def get(self, child: str) -> Static | None:
        """The static transform of a child frame, also a shadowed one."""
        return self._statics.get(child)

    def put(self, static: Static) -> Rejection | None:
        """Store a static transform, or leave it out if its rank is too low; None, or why it was refused."""
        rank, transform, authority = static
        child = transform.child_frame_id
        known = self._statics.get(child)
        if known is not None and known.authority != authority:
            if Rank.DESCRIPTION in (known.rank, rank):
                if rank > known.rank:
                    return None
                # The new edge may have another parent: with the old edge still there, that could look like a loop.
                self._drop(child)
            elif not is_start_pose(transform) or rank == known.rank:
                text = f"{child} is said by {known.authority} and by {authority}: {known.authority} stays"
                return Rejection("second authority", text)
            elif rank > known.rank:
                return None
        if self._is_shadowed(child, static):
            self._statics[child] = static
            return None
        if known is not None and known.transform == transform and known.authority == authority:
            return None
        refused = self._buffer.set_transform_static(transform, authority)
        if refused is None:
            self._statics[child] = static
            self.changed = True
        return refused

    def drop_replaced(self, authority: str, rank: Rank, new: Mapping[str, TransformStamped]) -> None:
        """Drop the source's transforms that its new full set, by child frame, lacks or has under another parent."""
        for child, static in list(self._statics.items()):
            if static.authority == authority and static.rank == rank:
                # An edge whose parent changes must not make a loop with the rest of the new set.
                transform = new.get(child)
                if transform is None or transform.header.frame_id != static.transform.header.frame_id:
                    self._drop(child)

    def drop_authority(self, authority: str) -> None:
        """Drop all static transforms of one authority."""
        for child, static in list(self._statics.items()):
            if static.authority == authority:
                self._drop(child)

    def localise(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store a localiser's moving `map -> robot_N/odom`, which shadows the static one; None, or why it was refused.

        The caller holds the buffer's lock and has asked `is_fixed_by_team_file`.
        """
        child = transform.child_frame_id
        shadowed = None if child in self._localised else self._statics.get(child)
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

    def is_fixed_by_team_file(self, child: str) -> bool:
        """Whether the team file gives this frame's transform: then a localiser's data is ignored."""
        static = self._statics.get(child)
        return static is not None and static.rank == Rank.TEAM_FILE

    def restore_start_poses(self) -> None:
        """Forget what the localisers published: each start pose holds again until its localiser publishes."""
        for child in self._localised:
            self._buffer.forget(child)
            shadowed = self._statics.get(child)
            if shadowed is not None:
                self._buffer.set_transform_static(shadowed.transform, shadowed.authority)
                self.changed = True
        self._localised.clear()

    def message(self) -> TFMessage:
        """The full set of transforms that are not shadowed, sorted by child frame; `changed` becomes False."""
        self.changed = False
        shown = [s.transform for child, s in sorted(self._statics.items()) if not self._is_shadowed(child, s)]
        return TFMessage(shown)

    def _drop(self, child: str) -> None:
        del self._statics[child]
        if child not in self._localised:
            self._buffer.forget(child)
        self.changed = True

    def _is_shadowed(self, child: str, static: Static) -> bool:
        return static.rank > Rank.LOCALISER and child in self._localised
