"""The transforms of all robots merged into one tree: the work of the aggregator process, without the bus.

A robot may publish the frames below its own prefix, under its own frames or the global ones. It may write a frame as a
local name (`odom`), with its prefix (`robot_1/odom`) or with a leading slash: all three are resolved to the same full
name. `static_transforms` chooses the authority of each static transform. Stamps are never changed.
"""

from collections.abc import Callable, Container, Iterable
from functools import lru_cache

from zteam import names
from zteam.clock import NOT_KNOWN, Sent
from zteam.messages import Header, TFMessage, TransformStamped, encode, ns_from_time
from zteam.messages.geometry_msgs import is_base
from zteam.transforms.buffer import Buffer
from zteam.transforms.static_transforms import Rank, Static, StaticTransforms, is_start_pose
from zteam.transforms.tree import Rejection

TEAM_FILE = "team_file"

MAX_APART = 10_000_000_000
"""Nanoseconds that a stamp may differ from the team's clock: as long as a buffer remembers."""
MAX_PLACE = 1e9
"""Metres: no frame is further away from its parent. With larger numbers its readers could not compute."""
MAX_HELD = 1000
"""Frames of a robot that wait for the bundle of their tick; the world may stand still while others send."""
MAX_CONFLICTS = 1000
"""Conflicts that are recorded; later ones are dropped, so that a faulty robot cannot fill the memory."""
_Held = tuple[int, TransformStamped, str]
"""The stamp (ns) of the tick in which it was sent, the transform and its authority."""


class Merger:
    """The tree of a whole team. Transforms of the team file and of tools have full names."""

    def __init__(
        self,
        configured: Iterable[TransformStamped] = (),
        name_of: Callable[[str], str | None] = lambda authority: authority,
    ) -> None:
        """The team file's fixed transforms; `name_of` as in StaticTransforms."""
        self.buffer = Buffer()
        self.statics = StaticTransforms(self.buffer, name_of)
        self._conflicts: dict[tuple[str, str, str], str] = {}
        """Texts by child frame, authority and code: each conflict once, however often it happens."""
        self._bases: list[TransformStamped] = []
        self._others: list[TransformStamped] = []
        """For the next bundle: the robots' bases, and frames of the user's processes."""
        self._held: dict[str, list[_Held]] = {}
        """Frames of the user's processes in lock-step, by authority, which are not stored before their bundle."""
        for transform in configured:
            self._put_static(Static(Rank.TEAM_FILE, transform, TEAM_FILE))

    def receive(
        self, robot_id: int, message: TFMessage, now: int = 0, tick: int = 0, wall: int = 0,
        trusts: Callable[[], bool] = lambda: True,
    ) -> None:  # fmt: skip
        """Store moving transforms from `robot_N/tf`; `now` (ns) is the team's clock, 0 = not known, and `wall` then the
        host's, which no clock of a team is ahead of. Unless the caller `trusts()` its clock, a stamp that is far from
        it is refused without a conflict.

        In lock-step `tick` is the stamp (ns) of the tick in which they were sent: see `take_pending`.
        """
        authority, known = names.robot_name(robot_id), now or wall
        for transform in self._keep_own(robot_id, message.transforms):
            apart = ns_from_time(transform.header.stamp) - known
            if known and (apart > MAX_APART or (now and apart < -MAX_APART)):
                if trusts():
                    # With a stamp far ahead, all later samples would be too old.
                    side = "ahead of" if apart > 0 else "behind"
                    far = f"{transform.child_frame_id} from {authority} is {abs(apart) / 1e9:.1f} s {side}"
                    text = f"{far} the team's clock: set its clock"
                    self._report(transform.child_frame_id, authority, Rejection(side, text))
            elif tick and not is_base(transform.child_frame_id):
                held = self._held.setdefault(authority, [])
                if len(held) < MAX_HELD:
                    held.append((tick, transform, authority))
                else:
                    text = f"{authority} sends more than {MAX_HELD} frames within a tick: the others do not count"
                    self._report("", authority, Rejection("full", text))
            else:
                self._store(transform, authority)

    def _keep_own(self, robot_id: int, transforms: Iterable[TransformStamped]) -> list[TransformStamped]:
        """The transforms that the robot may publish, with full names; the others are conflicts."""
        kept = []
        for transform in transforms:
            parent, child, problem = _own(robot_id, transform.header.frame_id, transform.child_frame_id)
            place = transform.transform.translation
            if not (abs(place.x) <= MAX_PLACE and abs(place.y) <= MAX_PLACE and abs(place.z) <= MAX_PLACE):
                robot = names.robot_name(robot_id)
                self._report(child, robot, Rejection("far", f"{child} from {robot} is more than {MAX_PLACE:g} m away"))
            elif problem:
                self._report(child, names.robot_name(robot_id), Rejection("foreign", problem))
            elif child == transform.child_frame_id and parent == transform.header.frame_id:
                kept.append(transform)
            else:
                kept.append(TransformStamped(Header(transform.header.stamp, parent), child, transform.transform))
        return kept

    def _report(self, child: str, authority: str, refused: Rejection) -> None:
        key = (child, authority, refused.code)
        if key not in self._conflicts and len(self._conflicts) < MAX_CONFLICTS:
            self._conflicts[key] = refused.text

    def _store(self, transform: TransformStamped, authority: str) -> None:
        """Store a moving sample for the next bundle too, unless it is an exact duplicate."""
        # Only this thread stores moving transforms, so the count needs no lock.
        duplicates = self.buffer.duplicates
        if is_start_pose(transform):
            holder = self.statics.holders.get(transform.child_frame_id)
            if holder is not None and holder.rank == Rank.TEAM_FILE:
                return
            refused = self.statics.localise(transform, authority)
        else:
            refused = self.buffer.set_transform(transform, authority)
        if refused is not None:
            self._report(transform.child_frame_id, authority, refused)
        elif self.buffer.duplicates == duplicates:
            (self._bases if is_base(transform.child_frame_id) else self._others).append(transform)

    def describe(self, robot_id: int, transforms: Iterable[TransformStamped]) -> None:
        """Store the fixed joints of a robot's description; their frames have the description's own names."""
        authority = f"{names.robot_name(robot_id)}'s description"
        for transform in self._keep_own(robot_id, transforms):
            self._put_static(Static(Rank.DESCRIPTION, transform, authority))

    def receive_static(self, robot_id: int, message: TFMessage, authority: str = "", sent: Sent = NOT_KNOWN) -> None:
        """Store static transforms from `robot_N/tf_static`, which `authority` (else the robot) sent."""
        authority = authority or names.robot_name(robot_id)
        new = {t.child_frame_id: t for t in self._keep_own(robot_id, message.transforms)}
        self.statics.drop_reparented(authority, new, sent)
        for transform in new.values():
            self._put_static(Static(Rank.SIMULATOR, transform, authority, sent))

    def _put_static(self, static: Static) -> None:
        refused = self.statics.put(static)
        if refused is not None:
            self._report(static.transform.child_frame_id, static.authority, refused)

    def why_not_static(self, transform: TransformStamped, authority: str, ended: Container[str] = ()) -> str:
        """Why a static transform that a tool asks for is refused; empty if it is not. What `ended` authorities have
        said does not count."""
        child = transform.child_frame_id
        known = self.statics.holders.get(child) or self.buffer.frame(child)
        if known is not None and known.authority != authority and known.authority not in ended:
            way_out = "name another child"
            if known.authority == TEAM_FILE:
                way_out = "change it there"
            elif names.is_robot_frame(child, names.ODOM):
                way_out = "a start pose belongs in [[static_transforms]] of the team file"
            elif isinstance(known, Static) and known.rank == Rank.CALLER:
                way_out = "end that process or name another child"
            return f"{self.statics.shown(known.authority)} publishes {child} already: {way_out}"
        refused = self.statics.refusal(Static(Rank.CALLER, transform, authority))
        return refused.text if refused else ""

    def add_static(self, transform: TransformStamped, authority: str) -> str:
        """Store a static transform that a tool asks for; the reason of a refusal, else empty."""
        if refused := self.why_not_static(transform, authority):
            return refused
        self.statics.put(Static(Rank.CALLER, transform, authority))
        return ""

    def take_pending(self, tick: int = 0) -> list[TransformStamped]:
        """The moving transforms stored since the last call, for one bundled message.

        With the stamp of a tick (ns, 0 = none), of that tick only those of the bases: a frame of a user's process
        comes at any moment of the tick, so it is taken with the next one, in an order that does not depend on when.
        """
        due: list[_Held] = []
        for authority, frames in [*self._held.items()]:
            due += [held for held in frames if held[0] < tick or not tick]
            if later := [held for held in frames if held[0] >= tick > 0]:
                self._held[authority] = later
            else:
                del self._held[authority]
        for _, transform, authority in sorted(due, key=_order):
            self._store(transform, authority)
        # Bases stand last: readers look there for the stamp of the tick.
        pending, self._others, self._bases = self._others + self._bases, [], []
        return pending

    def conflicts(self) -> list[str]:
        """All conflicts so far, each reported once, oldest first."""
        return list(self._conflicts.values())

    def jump_back(self) -> None:
        """Forget all moving data, because time went back."""
        self.buffer.clear()
        self._bases.clear()
        self._others.clear()
        self._held.clear()
        self.statics.restore_start_poses()


def base_stamp(robot_id: int, message: TFMessage) -> int:
    """The stamp (ns) of the base in a message of `robot_N/tf`, in which names may be relative; -1 without one."""
    base, newest = names.robot_frame(robot_id, names.BASE_FOOTPRINT), -1
    for each in message.transforms:
        if _own(robot_id, each.header.frame_id, each.child_frame_id)[1] == base:
            newest = max(newest, ns_from_time(each.header.stamp))
    return newest


@lru_cache(maxsize=4096)
def _own(robot_id: int, parent: str, child: str) -> tuple[str, str, str]:
    """The full names of an edge of `robot_N/tf`, and why the robot may not publish it; empty if it may.

    Nearly all messages have the frames of the one before.
    """
    prefix = names.robot_name(robot_id)
    parent, child = names.resolve_frame(prefix, parent), names.resolve_frame(prefix, child)
    problem = ""
    if not _is_below(prefix, child):
        problem = f"{prefix} may not say where {child or 'nothing'} is"
    elif not _is_below(prefix, parent) and parent not in names.GLOBAL_FRAMES:
        problem = f"{prefix} may not hang {child} under {parent or 'nothing'}"
    return parent, child, problem


def _is_below(prefix: str, frame: str) -> bool:
    """Whether `frame` is the prefix, a slash and a name that is not empty."""
    return frame.startswith(prefix + "/") and len(frame) > len(prefix) + 1


def _order(held: _Held) -> tuple[int, str, int, bytes]:
    """In which order frames are stored: of two senders that disagree, the same one is refused in every run."""
    tick, transform, _ = held
    return tick, transform.child_frame_id, ns_from_time(transform.header.stamp), encode(transform)
