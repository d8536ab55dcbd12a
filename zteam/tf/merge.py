"""One tree from many robots: names resolved at the boundary, every frame with its authority, conflicts by name.

What the aggregator process does, without the bus. Robots say their transforms with local names (`odom`), prefixed
ones (`robot_1/odom`) or a leading slash; all mean the same here. Stamps are never changed.
"""

import logging
from collections.abc import Iterable
from typing import NamedTuple

from zteam import names
from zteam.messages import Header, TFMessage, TransformStamped, ns_from_time
from zteam.tf.buffer import Buffer
from zteam.tf.validation import Rejection

log = logging.getLogger("zteam.tf")

TEAM_FILE = "team file"

_FILE, _LOCALISER, _SIMULATOR, _CALLER, _DESCRIPTION = 0, 1, 2, 3, 4
"""Ranks of the sources of `map -> robot_N/odom`: the lower number wins and shadows the other, which is no conflict.

A robot description gives way to every other source: the base itself knows best where its laser is.
"""

_MAX_CONFLICTS = 1000

MAX_APART = 10_000_000_000
"""Nanoseconds that a stamp may differ from the team's clock: as much as a buffer remembers."""


class _Static(NamedTuple):
    rank: int
    transform: TransformStamped
    authority: str


class Merger:
    """The tree of a whole team."""

    def __init__(self, configured: Iterable[TransformStamped] = ()) -> None:
        self.buffer = Buffer()
        self._statics: dict[str, _Static] = {}
        self._localised: set[str] = set()
        """`robot_N/odom` frames that a localiser places."""
        self._pending: list[TransformStamped] = []
        self._conflicts: dict[tuple[str, str, str], str] = {}
        self._unread_conflicts: list[str] = []
        self.statics_changed = False
        for transform in configured:
            self._say_static(_with_names("", transform), _FILE, TEAM_FILE)

    def take(self, robot_id: int, message: TFMessage, now: int = 0) -> None:
        """Moving transforms from `robot_N/tf`; `now` (ns) is the team's clock, 0 = not known."""
        for transform in self._own(robot_id, message):
            child, authority = transform.child_frame_id, names.robot_name(robot_id)
            apart = ns_from_time(transform.header.stamp) - now
            if now and abs(apart) > MAX_APART:
                # One such sample would make all that follow too old, or never be the latest of anything.
                side = "ahead of" if apart > 0 else "behind"
                text = f"{child} from {authority} is {abs(apart) / 1e9:.1f} s {side} the team's clock: set its clock"
                self._report(child, authority, f"clock {side}", text)
                continue
            refused = self._take_moving(transform, authority)
            if refused is not None:
                self._report(child, authority, refused.code, refused.text)

    def _take_moving(self, transform: TransformStamped, authority: str) -> Rejection | None:
        child = transform.child_frame_id
        shadowed = None
        if _is_start_pose(transform) and child not in self._localised:
            shadowed = self._statics.get(child)
            if shadowed is not None and shadowed.rank == _FILE:
                return None
        with self.buffer.lock:
            duplicates = self.buffer.duplicates
            if shadowed is not None:
                self.buffer.forget(child)
            refused = self.buffer.set_transform(transform, authority)
            if refused is not None:
                if shadowed is not None:
                    # A refused sample replaces nothing.
                    self.buffer.set_transform_static(shadowed.transform, shadowed.authority)
                return refused
            if self.buffer.duplicates == duplicates:
                self._pending.append(transform)
        if _is_start_pose(transform):
            self._localised.add(child)
            self.statics_changed |= shadowed is not None
        return None

    def describe(self, robot_id: int, transforms: Iterable[TransformStamped]) -> None:
        """The fixed joints of a robot's description, with the description's own names."""
        prefix = names.robot_name(robot_id)
        for transform in self._own(robot_id, TFMessage(list(transforms))):
            self._say_static(transform, _DESCRIPTION, f"{prefix}'s description")

    def take_static(self, robot_id: int, message: TFMessage) -> None:
        """The full set of fixed transforms from `robot_N/tf_static`."""
        authority = names.robot_name(robot_id)
        own = {t.child_frame_id: t for t in self._own(robot_id, message)}
        for child, static in list(self._statics.items()):
            if static.authority == authority and static.rank == _SIMULATOR:
                # An edge that hangs elsewhere from now on must not make a loop of the new set.
                new = own.get(child)
                if new is None or new.header.frame_id != static.transform.header.frame_id:
                    self._drop_static(child)
        for transform in own.values():
            self._say_static(transform, _SIMULATOR, authority)

    def add_static(self, transform: TransformStamped, authority: str) -> str | None:
        """Store a static transform on request; None, or the reason of the refusal."""
        resolved = _with_names("", transform)
        child = resolved.child_frame_id
        known = self._statics.get(child) or self.buffer.frames().get(child)
        if known is not None and known.authority != authority:
            return f"{child} is said by {known.authority} already"
        refused = self._put_static(resolved, _CALLER, authority)
        return refused.text if refused else None

    def drop_authority(self, authority: str) -> None:
        """Forget the fixed transforms that `authority` asked for."""
        for child, static in list(self._statics.items()):
            if static.authority == authority:
                self._drop_static(child)

    def take_pending(self) -> list[TransformStamped]:
        """The moving transforms since the last call, for one bundled message."""
        pending, self._pending = self._pending, []
        return pending

    def statics(self) -> TFMessage:
        """The full set of fixed transforms, sorted by child."""
        self.statics_changed = False
        shown = [s.transform for child, s in sorted(self._statics.items()) if not self._is_shadowed(child, s)]
        return TFMessage(shown)

    def conflicts(self) -> list[str]:
        """All conflicts seen so far."""
        return list(self._conflicts.values())

    def take_conflicts(self) -> list[str]:
        """Conflicts seen since the last call, each reported once."""
        found, self._unread_conflicts = self._unread_conflicts, []
        return found

    def jump_back(self) -> None:
        """Time went back: moving data is forgotten."""
        self.buffer.clear()
        self._pending.clear()
        for child in self._localised:
            # The start pose holds again until the localiser speaks.
            self.buffer.forget(child)
            shadowed = self._statics.get(child)
            if shadowed is not None:
                self.buffer.set_transform_static(shadowed.transform, shadowed.authority)
                self.statics_changed = True
        self._localised.clear()

    def _own(self, robot_id: int, message: TFMessage) -> list[TransformStamped]:
        """The message's transforms with their tree's names; a robot's frames lie under its own prefix."""
        prefix, found = names.robot_name(robot_id), []
        for transform in message.transforms:
            resolved = _with_names(prefix, transform)
            child, parent = resolved.child_frame_id, resolved.header.frame_id
            if not _is_below(prefix, child):
                self._report(child, prefix, "foreign", f"{prefix} may not say where {child or 'nothing'} is")
            elif not _is_below(prefix, parent) and parent not in names.GLOBAL_FRAMES:
                self._report(child, prefix, "foreign", f"{prefix} may not hang {child} under {parent or 'nothing'}")
            else:
                found.append(resolved)
        return found

    def _say_static(self, transform: TransformStamped, rank: int, authority: str) -> None:
        refused = self._put_static(transform, rank, authority)
        if refused is not None:
            self._report(transform.child_frame_id, authority, refused.code, refused.text)

    def _put_static(self, transform: TransformStamped, rank: int, authority: str) -> Rejection | None:
        child = transform.child_frame_id
        known = self._statics.get(child)
        if known is not None and known.authority != authority and _DESCRIPTION in (known.rank, rank):
            if rank > known.rank:
                return None
            # It may hang elsewhere now, which must not make a loop with what the description said.
            self._drop_static(child)
        elif known is not None and known.authority != authority:
            if known.rank < rank and _is_start_pose(transform):
                return None
            if not (rank < known.rank and _is_start_pose(transform)):
                text = f"{child} is said by {known.authority} and by {authority}: {known.authority} stays"
                return Rejection("second authority", text)
        static = _Static(rank, transform, authority)
        if self._is_shadowed(child, static):
            self._statics[child] = static
            return None
        if known is not None and known.transform == transform and known.authority == authority:
            return None
        refused = self.buffer.set_transform_static(transform, authority)
        if refused is None:
            self._statics[child] = static
            self.statics_changed = True
        return refused

    def _drop_static(self, child: str) -> None:
        del self._statics[child]
        if child not in self._localised:
            self.buffer.forget(child)
        self.statics_changed = True

    def _is_shadowed(self, child: str, static: _Static) -> bool:
        return static.rank > _LOCALISER and child in self._localised

    def _report(self, child: str, authority: str, code: str, text: str) -> None:
        key = (child, authority, code)
        if key not in self._conflicts and len(self._conflicts) < _MAX_CONFLICTS:
            self._conflicts[key] = text
            self._unread_conflicts.append(text)


def _is_below(prefix: str, frame: str) -> bool:
    """Whether `frame` is a frame, and the robot's own."""
    return frame.startswith(prefix + "/") and len(frame) > len(prefix) + 1


def _is_start_pose(transform: TransformStamped) -> bool:
    """Whether this is a `map -> robot_N/odom`, which has several sources by design."""
    return transform.header.frame_id == names.MAP_FRAME and names.is_robot_frame(transform.child_frame_id, names.ODOM)


def _with_names(prefix: str, transform: TransformStamped) -> TransformStamped:
    header = Header(transform.header.stamp, names.resolve_frame(prefix, transform.header.frame_id))
    return TransformStamped(header, names.resolve_frame(prefix, transform.child_frame_id), transform.transform)
