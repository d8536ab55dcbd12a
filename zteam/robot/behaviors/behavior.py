"""What a behaviour is, what it sees each step, and the further inputs that it may declare."""

import math
import re
from collections.abc import Callable, Mapping, Set
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import msgspec

from zteam import names
from zteam.counter_random import uniform
from zteam.errors import BehaviorError, UsageError
from zteam.geometry import Point2, Pose2
from zteam.messages import LaserScan, Message, NavigationStatus, Odometry, Twist
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.messages.message import check_message_type

SILENT_AFTER = 2.0
"""Seconds without a status (they come at 1 Hz) after which a teammate is silent: simulated in lock-step, else the
host's."""
FindPose = Callable[[str, str], tuple[Pose2, int] | None]
"""`find_pose(target_frame, source_frame)`: the newest target_from_source and its stamp (ns; 0 where nothing between the
two frames moves), or None where the look-up failed."""


class Teammate(NamedTuple):
    """Another robot of the team."""

    robot_id: int
    pose: Pose2
    """In the own base frame."""
    age: float
    """Seconds since it was there."""
    base: Base

    def along(self, heading: float) -> tuple[float, float]:
        """Metres to it along a heading (rad) from the own base, and to the left of that."""
        return Pose2(0.0, 0.0, heading).locate(self.pose.x, self.pose.y)


class View(msgspec.Struct, frozen=True, kw_only=True, eq=False, dict=True):
    """One robot's knowledge at `now`. Nothing in it changes while a behaviour looks at it."""

    now: int
    """Nanoseconds."""
    dt: float
    """Seconds since the last step; 0 on the first, and on the first after a pause."""
    robot_id: int
    scan: LaserScan | None
    """The newest, in the axes of the base however its laser is mounted: beams run from right to left, and angles count
    from the base's x axis. None before the first one, and if it cannot be used."""
    odom: Odometry | None
    lookup: FindPose
    laser: Point2 = (0.0, 0.0)
    """Where the beams of `scan` begin, in the base (m)."""
    scan_needs: str = ""
    """What is missing for the newest scan to be used, as a noun; empty if nothing is, or none has come."""
    base: Base = DEFAULT_BASE
    """Its outline and limits."""
    team: tuple[int, ...] = ()
    """Ids of the robots whose process is alive, as far as known; in lock-step those that take part in the tick."""
    inputs: Mapping[str, Any] = {}
    """What the behaviour declares in `inputs`, by name: the newest message or None; for a topic of every robot the
    newest messages by robot id."""
    silent: Set[int] = frozenset()
    """Robots whose newest status is more than SILENT_AFTER old: their process is frozen, cut off or gone. Known to
    behaviours that declare `robot_$*/status`."""
    seed: int = 1
    bases: Mapping[int, Base] = {}
    """The bases of the robots that have told theirs, by id."""

    @cached_property
    def teammates(self) -> tuple[Teammate, ...]:
        """All other robots of `team` and `bases` whose pose is known, by id; looked up when first asked for."""
        found = []
        for robot_id in sorted({*self.team, *self.bases} - {self.robot_id}):
            at = self.base_from_robot(robot_id)
            if at is not None:
                age = max(0.0, (self.now - at[1]) / 1e9) if at[1] else 0.0
                found.append(Teammate(robot_id, at[0], age, self.bases.get(robot_id, DEFAULT_BASE)))
        return tuple(found)

    @property
    def base_frame(self) -> str:
        """The robot's own base: x forward, y left."""
        return names.robot_frame(self.robot_id, names.BASE_FOOTPRINT)

    def map_from_base(self) -> tuple[Pose2, int] | None:
        """The robot's own pose in `map` and its stamp, or None."""
        return self._found

    @cached_property
    def _found(self) -> tuple[Pose2, int] | None:
        return self.lookup(names.MAP_FRAME, self.base_frame)

    def base_from_robot(self, robot_id: int) -> tuple[Pose2, int] | None:
        """Another robot's pose in the own base frame and its stamp, or None."""
        return self.lookup(self.base_frame, names.robot_frame(robot_id, names.BASE_FOOTPRINT))

    def random(self, draw: int = 0) -> float:
        """A number in [0, 1): the same for the same seed, robot, time and `draw`, whatever else was drawn."""
        return uniform(self.seed, self.robot_id, self.now, draw)

    def is_fresh(self, stamp: int, max_age: float) -> bool:
        """Whether data of `stamp` is at most `max_age` seconds away from now: a stamp from the future counts as old."""
        return abs(self.now - stamp) <= max_age * 1e9


_EXAMPLE = 'inputs = {"goal": ("goal_pose", PoseStamped)}'


NO_POSE = f"its own pose in {names.MAP_FRAME} is not known"


def own_pose(view: View) -> Pose2 | None:
    """The robot's own pose in `map`; None where it is not known, or no number."""
    found = view.map_from_base()
    return found[0] if found is not None and math.isfinite(sum(found[0])) else None


class DeclaredInput(NamedTuple):
    """One input of one robot's behaviour."""

    name: str
    """In `view.inputs`."""
    key: str
    """A key, or the wildcard for a topic of every robot."""
    type: type[Message]

    @property
    def of_all_robots(self) -> bool:
        """Whether the view holds a message of each robot."""
        return names.is_wildcard(self.key)


def declared_inputs(inputs: Mapping[str, tuple[str, type[Message]]], robot_id: int) -> list[DeclaredInput]:
    """What robot `robot_id` listens to for a behaviour that declares these."""
    return [DeclaredInput(name, names.input_key(robot_id, topic), kind) for name, (topic, kind) in inputs.items()]


def check_inputs(inputs: Any) -> None:
    """Raise UsageError that names the first mistake in what a behaviour declares."""
    if not isinstance(inputs, Mapping):
        raise UsageError(f"inputs is {inputs!r}, not a dict such as {_EXAMPLE}")
    for name, declared in inputs.items():
        if not (isinstance(name, str) and isinstance(declared, tuple) and len(declared) == 2):
            raise UsageError(f"inputs: {name!r}: {declared!r} is no topic with its type: {_EXAMPLE}")
        try:
            _check_input(*declared)
        except UsageError as error:
            raise UsageError(f"inputs: {name!r}: {error}") from None


def _check_input(topic: Any, kind: Any) -> None:
    # Imported here, because most behaviours declare nothing.
    from zteam.messages.topics import type_of_key

    if not isinstance(topic, str) or not topic:
        raise UsageError(f"{topic!r} is no topic, such as 'goal_pose'")
    key = names.input_key(0, topic)
    single = names.keys_in(key, [0])
    if not single:
        raise UsageError(f"{topic!r} stands for many keys: take one topic, of every robot as 'robot_$*/status'")
    if not all(re.fullmatch(r"[\w.-]+", chunk) for chunk in single[0].split("/")):
        raise UsageError(f"{topic!r} is no topic: join words of letters, digits and _ by single slashes")
    check_message_type(topic, kind)
    carried = type_of_key(single[0])
    if carried not in (None, kind):
        raise UsageError(f"{topic} carries {carried.__name__}, not {kind.__name__}")


class NoParams(msgspec.Struct, forbid_unknown_fields=True):
    """The parameters of a behaviour that has none."""


class Behavior:
    """Observations in, a velocity out: no bus, no sleeping, no clock but the view's, nothing random but the view's.

    A subclass writes `step`. If it takes parameters, it names their type in `Params`, a msgspec.Struct that forbids
    unknown fields. `zteam param set` replaces `params` between two steps; nothing else of the object changes.
    The safety layer (`decide`) lies under every behaviour and stops it on old data and in front of obstacles.
    """

    Params: ClassVar[type[msgspec.Struct]] = NoParams
    params: Any
    """Its parameters, a `Params`."""
    uses_tf: bool = False
    """Whether it drives by what it looks up; if so, it is stopped while the robot's own pose is unknown or old."""
    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = {}
    """What it looks at in `view.inputs` besides: by name, a topic of the own robot and its type, such as
    `{"goal": ("goal_pose", PoseStamped)}`; `robot_$*/status` is that topic of every robot."""
    leader: int | None = None
    """The robot that it was started to follow."""
    follows: int | None = None
    """The robot that it follows now: where a line is led from its other end, the one behind it."""
    gap: float = 0.0
    """Metres that it keeps to the robot that it follows."""
    turns: int = -1
    """How often its line has been led from the other end; -1 where it cannot be. Each robot takes the highest."""
    navigation: NavigationStatus | None = None
    """What it says of its goal, for `robot_N/navigation/status`; None if it takes no goals. Its step changes it."""
    reason: str = ""
    """Why it stands still, for the robot's status; empty while it does not."""

    def __init__(self, params: Any) -> None:
        self.params = params

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        # What the class above it says of its own step need not be true of another one.
        if "step" in vars(cls) and "why_it_rests" not in vars(cls):
            cls.why_it_rests = Behavior.why_it_rests  # type: ignore[method-assign]

    def step(self, view: View) -> Twist:
        """The velocity from now on, in the base frame: m/s and rad/s."""
        raise BehaviorError(f"{type(self).__name__} has no step(view)")

    def on_params(self) -> None:
        """Do what a change of `params` needs; called before the next step. A `step` that reads them needs nothing."""

    def on_release(self) -> None:
        """Begin anew what counts time: the robot goes on after it was stopped (`zteam stop`), had no usable data or was
        frozen. Called before the next step. No step is asked for meanwhile.
        """

    def cancel_goal(self) -> bool:
        """Give up the goal with the next step, if there is one; returns whether there was. Any thread may call it."""
        return False

    def why_it_rests(self) -> str:
        """Why the velocity of its last step is zero without a `reason`, for the robot's status; empty = no word."""
        return ""

    def missing(self, view: View) -> list[str]:
        """What the behaviour itself still needs before the robot may call itself ready."""
        return []
