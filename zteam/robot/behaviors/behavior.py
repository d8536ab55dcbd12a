"""What a behaviour is, which further inputs it may declare, and how it is asked: only when its data is there, and with
the safety layer under its answer."""

import re
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

import msgspec

from zteam import names
from zteam.errors import BehaviorError, UsageError
from zteam.messages import Message, NavigationStatus, Twist
from zteam.messages.message import check_message_type
from zteam.messages.planar import checked_command
from zteam.robot.behaviors.steering import Steering
from zteam.robot.safety.layer import STALE_AFTER, SafetyLayer, old_scan
from zteam.robot.view import NO_POSE, View

_EXAMPLE = 'inputs = {"goal": ("goal_pose", PoseStamped)}'


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


def check_inputs(what: str, inputs: Any) -> None:
    """Raise UsageError that names the first mistake in what a behaviour declares; its text begins with `what`."""
    # Imported here, because most behaviours declare nothing.
    from zteam.messages.topics import type_of_key

    if not isinstance(inputs, Mapping):
        raise UsageError(f"{what} is {inputs!r}, not a dict such as {_EXAMPLE}")
    for name, declared in inputs.items():
        place = f"{what}: {name!r}"
        if not (isinstance(name, str) and isinstance(declared, tuple) and [*map(type, declared[:-1])] == [str]):
            raise UsageError(f"{place}: {declared!r} is no topic with its type: {_EXAMPLE}")
        topic, kind = declared
        key = (names.keys_in(names.input_key(0, topic), [0]) or [""])[0]
        if not all(re.fullmatch(r"[\w.-]+", chunk) for chunk in key.split("/")):
            way_out = "join words of letters, digits and _ by single slashes, for every robot as 'robot_$*/status'"
            raise UsageError(f"{place}: {topic!r} is no topic: {way_out}")
        check_message_type(f"{place}: {topic}", kind)
        carried = type_of_key(key)
        if carried not in (None, kind):
            raise UsageError(f"{place}: {topic} carries {carried.__name__}, not {kind.__name__}")


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
    steering: Steering | None = None
    """What makes a car's command of its velocity; None: `step` itself returns the angle of a car's wheels."""
    reason: str = ""
    """Why it stands still, for the robot's status; empty while it does not."""

    def __new__(cls, params: Any = None, *_: object, **__: object) -> Self:
        """A subclass with an `__init__` of its own has its parameters also where that does not call this one's."""
        made = super().__new__(cls)
        made.params = params
        return made

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


def old_data(behavior: Behavior, view: View) -> str:
    """Why the behaviour cannot be asked: what it drives by is missing or old; empty if it can."""
    if (trouble := old_scan(view)) or not behavior.uses_tf:
        return trouble
    own = view.map_from_robot(view.robot_id)
    if own is None:
        return NO_POSE
    is_stale = own[1] and abs(view.now - own[1]) > STALE_AFTER * 1e9
    return f"its own pose in {names.MAP_FRAME} is stale" if is_stale else ""


def ask(behavior: Behavior, view: View) -> tuple[Twist, str]:
    """The velocity that the behaviour wants, zero on old data, and why it is not what it is for ("" if it is)."""
    if trouble := old_data(behavior, view):
        return Twist(), trouble
    return ask_for_step(behavior, view)


def ask_for_step(behavior: Behavior, view: View) -> tuple[Twist, str]:
    """As `ask`, where the data is not old."""
    wanted = checked_command(behavior.step(view), f"{type(behavior).__name__}.step", view.robot_id)
    if behavior.steering is not None and view.base.drive == "car":
        wanted = behavior.steering.drive(view, wanted)
    return wanted, behavior.reason


def decide(behavior: Behavior, view: View, layer: SafetyLayer | None = None) -> tuple[Twist, str]:
    """As `ask`, made safe by `layer`, which remembers what came before; without one this is the first step."""
    wanted, reason = ask(behavior, view)
    command, trouble = (layer or SafetyLayer()).limit(wanted, view, reason)
    return command, trouble or reason


def missing(view: View, behavior: Behavior) -> list[str]:
    """What the robot lacks before it is ready, as nouns for its status; empty = ready."""
    lacking = []
    if view.scan is None:
        lacking.append(view.scan_needs or f"a first scan ({names.scan_key(view.robot_id, 0)})")
    if view.odom is None:
        lacking.append(f"odometry ({names.robot_key(view.robot_id, names.ODOM)})")
    if view.map_from_base() is None:
        lacking.append(f"its own pose in {names.MAP_FRAME} ({names.TF}, from zteam-tf)")
    return lacking + behavior.missing(view)
