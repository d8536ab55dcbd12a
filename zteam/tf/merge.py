"""The transforms of all robots merged into one tree: the work of the aggregator process, without the bus.

`own_frames` resolves names and refuses frames that are not the robot's own, `static_transforms` chooses the authority
of each static transform, and `conflicts` records what was refused. Stamps are never changed.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from zteam import names
from zteam.messages import TFMessage, TransformStamped, encode, ns_from_time
from zteam.tf.bases import is_base
from zteam.tf.buffer import Buffer
from zteam.tf.conflicts import Conflicts
from zteam.tf.own_frames import is_start_pose, keep_own, resolve
from zteam.tf.static_transforms import Rank, Static, StaticTransforms
from zteam.tf.tree import Rejection

TEAM_FILE = "team file"

MAX_APART = 10_000_000_000
"""Nanoseconds that a stamp may differ from the team's clock: as long as a buffer remembers."""


class _Held(NamedTuple):
    """A frame of lock-step that is not in a bundle yet."""

    tick: int
    """The stamp (ns) of the tick in which it was sent."""
    transform: TransformStamped
    authority: str


class Merger:
    """The tree of a whole team."""

    def __init__(
        self,
        configured: Iterable[TransformStamped] = (),
        name_of: Callable[[str], str | None] = lambda authority: authority,
    ) -> None:
        """The team file's fixed transforms; `name_of` as in StaticTransforms."""
        self.buffer = Buffer()
        self._conflicts = Conflicts()
        self._statics = StaticTransforms(self.buffer, name_of)
        self._bases: list[TransformStamped] = []
        """For the next bundle."""
        self._others: list[TransformStamped] = []
        """Frames of the user's processes for the next bundle."""
        self._held: list[_Held] = []
        """Frames of the user's processes in lock-step, which are not stored before their bundle."""
        for transform in configured:
            self._put_static(Static(Rank.TEAM_FILE, resolve("", transform), TEAM_FILE))

    def take(self, robot_id: int, message: TFMessage, now: int = 0, tick: int = 0) -> None:
        """Store moving transforms from `robot_N/tf`; `now` (ns) is the team's clock, 0 = not known.

        In lock-step `tick` is the stamp (ns) of the tick in which they were sent: see `take_pending`.
        """
        authority = names.robot_name(robot_id)
        for transform in keep_own(robot_id, message.transforms, self._conflicts):
            stamp = transform.header.stamp
            if now and not -MAX_APART <= stamp.sec * 1_000_000_000 + stamp.nanosec - now <= MAX_APART:
                refused: Rejection | None = _refuse_stamp(transform, authority, now)
            elif is_base(transform):
                refused = self._store(transform, authority, self._bases)
            elif tick:
                self._held.append(_Held(tick, transform, authority))
                continue
            else:
                refused = self._store_other(transform, authority)
            if refused is not None:
                self._note_refusal(transform, authority, refused)

    def _note_refusal(self, transform: TransformStamped, authority: str, refused: Rejection | None) -> None:
        if refused is not None:
            self._conflicts.report(transform.child_frame_id, authority, refused.code, refused.text)

    def _store(self, transform: TransformStamped, authority: str, pending: list[TransformStamped]) -> Rejection | None:
        """Store a moving sample; it is then `pending` for the next bundle, unless it is an exact duplicate."""
        # Only this thread stores moving transforms, so the count needs no lock.
        duplicates = self.buffer.duplicates
        refused = self.buffer.set_transform(transform, authority)
        if refused is None and self.buffer.duplicates == duplicates:
            pending.append(transform)
        return refused

    def _store_other(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """As _store, of a frame that is no base."""
        if not is_start_pose(transform):
            return self._store(transform, authority, self._others)
        if self._statics.is_fixed_by_team_file(transform.child_frame_id):
            return None
        duplicates = self.buffer.duplicates
        with self.buffer.lock:
            refused = self._statics.localise(transform, authority)
        if refused is None and self.buffer.duplicates == duplicates:
            self._others.append(transform)
        return refused

    def describe(self, robot_id: int, transforms: Iterable[TransformStamped]) -> None:
        """Store the fixed joints of a robot's description; their frames have the description's own names."""
        authority = f"{names.robot_name(robot_id)}'s description"
        for transform in keep_own(robot_id, transforms, self._conflicts):
            self._put_static(Static(Rank.DESCRIPTION, transform, authority))

    def take_static(self, robot_id: int, message: TFMessage, authority: str = "", sent: int = 0) -> None:
        """Store static transforms from `robot_N/tf_static`, which `authority` (else the robot) sent.

        They are merged by child frame. `sent` is when they were sent, in the source's own count; 0 where it has none.
        """
        authority = authority or names.robot_name(robot_id)
        new = {t.child_frame_id: t for t in keep_own(robot_id, message.transforms, self._conflicts)}
        self._statics.drop_reparented(authority, new, sent)
        for transform in new.values():
            self._put_static(Static(Rank.SIMULATOR, transform, authority, sent))

    def look_again(self, authority: str) -> None:
        """A source of static transforms has come to life or may have ended."""
        self._statics.look_again(authority)

    def _put_static(self, static: Static) -> None:
        refused = self._statics.put(static)
        if refused is not None:
            self._conflicts.report(static.transform.child_frame_id, static.authority, refused.code, refused.text)

    def add_static(self, transform: TransformStamped, authority: str) -> str | None:
        """Store a static transform that a tool asks for; None, or the reason of the refusal."""
        resolved = resolve("", transform)
        child = resolved.child_frame_id
        known = self._statics.get(child) or self.buffer.frame(child)
        if known is not None and known.authority != authority:
            return f"{child} is said by {known.authority} already"
        refused = self._statics.put(Static(Rank.CALLER, resolved, authority))
        return refused.text if refused else None

    def drop_authority(self, authority: str) -> None:
        """Forget the static transforms that `authority` asked for."""
        self._statics.drop_authority(authority)

    def take_pending(self, tick: int = 0) -> list[TransformStamped]:
        """The moving transforms stored since the last call, for one bundled message.

        With the stamp of a tick (ns, 0 = none), of that tick only those of the bases: a frame of a user's process
        comes at any moment of the tick, so it is taken with the next one, in an order that does not depend on when.
        """
        bases, self._bases = self._bases, []
        if self._held:
            due = [held for held in self._held if held.tick < tick or not tick]
            self._held = [held for held in self._held if held.tick >= tick > 0]
            for _, transform, authority in sorted(due, key=_order):
                self._note_refusal(transform, authority, self._store_other(transform, authority))
        if not self._others:
            return bases
        others, self._others = self._others, []
        return others + bases

    @property
    def statics_changed(self) -> bool:
        """Whether the static transforms differ from those that `statics` returned last."""
        return self._statics.changed

    def statics(self) -> TFMessage:
        """The full set of static transforms, sorted by child frame."""
        return self._statics.message()

    def conflicts(self) -> list[str]:
        """All conflicts so far, each reported once."""
        return self._conflicts.all()

    def take_conflicts(self) -> list[str]:
        """The conflicts since the last call."""
        return self._conflicts.take_unread()

    def jump_back(self) -> None:
        """Forget all moving data, because time went back."""
        self.buffer.clear()
        self._bases.clear()
        self._others.clear()
        self._held.clear()
        self._statics.restore_start_poses()


def _order(held: _Held) -> tuple[int, str, int, bytes]:
    """In which order frames are stored: of two senders that disagree, the same one is refused in every run."""
    transform = held.transform
    return held.tick, transform.child_frame_id, ns_from_time(transform.header.stamp), encode(transform)


def _refuse_stamp(transform: TransformStamped, authority: str, now: int) -> Rejection:
    """Why a stamp that is too far from the team's clock `now` (ns) is refused.

    With one stamp far ahead, all later samples would be too old; a sample far behind would never be the latest one.
    """
    apart = ns_from_time(transform.header.stamp) - now
    side = "ahead of" if apart > 0 else "behind"
    child = transform.child_frame_id
    text = f"{child} from {authority} is {abs(apart) / 1e9:.1f} s {side} the team's clock: set its clock"
    return Rejection(f"clock {side}", text)
