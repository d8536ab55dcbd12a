"""All trials of a behaviour. Each is one comparison of two runs with new objects, as after a reset.

The last ones drive in the simulator: a small world, another robot, and the safety layer under both, as in a team.
"""

import inspect
import linecache
import math
import os
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec

from zteam import names
from zteam.clock import monotonic, thread_time
from zteam.config.resources import find_world
from zteam.errors import BehaviorError, EncodeError, UsageError
from zteam.geometry import Pose2, Velocity
from zteam.messages import Message, Twist
from zteam.messages.base import DEFAULT_BASE
from zteam.messages.cdr import encode
from zteam.node.faults import dump_stacks, stacks_in
from zteam.robot.behaviors.behavior import Behavior, ask, decide
from zteam.robot.behaviors.registry import error_text, find_behavior, is_own, read_params
from zteam.robot.behaviors.straight import Forward, ForwardParams
from zteam.robot.safety import SafetyLayer
from zteam.robot.safety.motion import BaseLimits
from zteam.robot.trials.situations import (
    DT,
    LEADER,
    POSES,
    ROBOT,
    SITUATIONS,
    STALE_SITUATIONS,
    ViewMaker,
    bounds,
    elsewhere,
    given_params,
    lookup_in,
)
from zteam.robot.view import View
from zteam.simulator.core import Engine, Observation
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.simulator.world import World, add_robot, load_world

T = TypeVar("T")

TICK = 0.1
"""Seconds of processor time that a step may take: a scan of Stage's worlds comes every 0.1 s."""
WAIT = 1.0
"""Seconds of the host's clock that a step may take: on a crowded machine a step waits for the processor."""
SLOW_STEPS = 3
"""So many steps above TICK or WAIT are the behaviour's fault; a single one may be the machine's."""
SECONDS = 10.0
"""Simulated seconds of a drive."""
HANGS_AFTER = 5.0
"""Seconds after which a step is one that does not return."""
_LOOK_EVERY = 0.1
"""Host seconds between two looks at a step that is under way."""
_TOLERANCE = 1e-6
"""m/s and rad/s above a limit that are rounding."""
_NO_SPEED = "a robot only drives forward (linear.x) and turns (angular.z): Twist(Vector3(speed), Vector3(z=turn))"
_HINTS = {
    "read-only": "the scan is not yours to change: take ranges = view.scan.ranges.copy()",
    **dict.fromkeys(("mappingproxy", "immutable type"), "the view is not yours to change: keep what you need in self"),
    "NoneType": "what has not come yet, or is unknown, is None: test it with `if x is None`",
    "ZeroDivisionError": "view.dt is 0 on the first step, and a range may be 0",
    **dict.fromkeys(
        ("NaN", "infinity"),
        "beams that say nothing are nan, those that meet nothing inf: zteam.behaviors.look_ahead sorts them out",
    ),
    **dict.fromkeys(
        ("IndexError", "zero-size", "empty"),
        "a laser may have any number of beams: take angles (zteam.behaviors.look_ahead), not places in the list",
    ),
}
"""What mostly is behind an error, by what Python and numpy say of it."""


class Fault(msgspec.Struct, frozen=True):
    """One thing that a behaviour does wrong."""

    kind: str
    text: str
    """What it does, with the behaviour as the subject that is left out: `step raises …`."""
    hint: str
    """What to do instead; empty if the text says it."""
    place: str
    """`file:line: source` of the author's own line; empty where there is none."""


class TrialResult(msgspec.Struct, frozen=True):
    """What a trial came to."""

    name: str
    faults: list[Fault]
    note: str
    """What else a person may want to know."""
    seconds: float
    """Of the host's time."""


class TrialOver(Exception):  # noqa: N818 - it is no error
    """The behaviour cannot go on in this trial."""


class Trial:
    """One trial of a behaviour: what its objects answer in a run, and what they do wrong."""

    def __init__(self, spec: str, kind: type[Behavior], params: dict[str, Any]) -> None:
        self.spec, self.kind, self.params = spec, kind, params
        self.moment = ViewMaker(kind.inputs)
        self.answers: list[Velocity] = []
        """Of all steps of the run so far."""
        self.faults: dict[tuple[str, str], Fault] = {}
        """By kind and place."""
        self.note = ""
        self.began: float | None = None
        """Host time when the step began that is under way."""
        self.slow_steps = 0
        self.error: BaseException | None = None
        """What went wrong in zteam itself."""

    def blame(self, kind: str, text: str, hint: str = "", place: str = "") -> None:
        place = place or self.place_of("step")
        self.faults.setdefault((kind, place), Fault(kind, text, hint, place))

    def look(self, views: Iterable[View]) -> list[Velocity]:
        """What a new object answers to these views."""
        subject, before = Subject(self), len(self.answers)
        for view in views:
            subject.step(view)
        return self.answers[before:]

    def compare(self, act: Callable[["Trial"], None]) -> None:
        """Do it twice, and compare the answers."""
        runs = []
        for _ in range(2):
            self.answers = []
            with suppress(TrialOver):
                act(self)
            runs.append(self.answers)
        for step, (one, other) in enumerate(zip(*runs, strict=False), 1):
            # As text, because nan is not equal to itself.
            if str(one) != str(other):
                text = f"step {step} asks for {velocity_text(one)}, then for {velocity_text(other)}"
                hint = "view.random() for chance, view.now for time, and what changes in self, from __init__ on"
                self.blame("differs", f"a new object answers the same views otherwise: {text}", hint)
                return

    def place_in(self, stack: traceback.StackSummary) -> str:
        """The author's innermost line in a stack; where there is none, that of its `step`."""
        module = getattr(sys.modules.get(self.kind.__module__), "__file__", "")
        own = [frame for frame in stack if is_own(frame.filename) or frame.filename == module]
        return _line_text(own[-1].filename, own[-1].lineno or 0) if own else self.place_of("step")

    def place_of(self, method: str) -> str:
        code = getattr(inspect.unwrap(getattr(self.kind, method)), "__code__", None)
        return "" if code is None else _line_text(code.co_filename, code.co_firstlineno)


class Subject:
    """A new object of the behaviour. It raises TrialOver after a fault that ends a robot."""

    def __init__(self, trial: Trial, **params: Any) -> None:
        """With these `params` besides those of the trial. Raises UsageError if it does not take them."""
        self._trial, self._label = trial, ""
        given = self._read(params)
        self._behavior = self._call("__init__", lambda: trial.kind(given))

    def _read(self, params: dict[str, Any]) -> Any:
        self._label = "".join(f", with {name} = {value}" for name, value in params.items())
        return read_params(self._trial.spec, self._trial.kind, {**self._trial.params, **params}, ROBOT)

    def set_params(self, **params: Any) -> None:
        """Set parameters as `zteam param set` does. Raises UsageError."""
        self._behavior.params = self._read(params)
        self._call("on_params", self._behavior.on_params)

    def step(self, view: View) -> tuple[Twist, str]:
        """The velocity that it wants, and its reason. First it is asked what it lacks before it is ready."""
        lacks: Any = self._call("missing", lambda: self._behavior.missing(view))
        if not (isinstance(lacks, list) and all(isinstance(noun, str) for noun in lacks)):
            place = self._trial.place_of("missing")
            self._blame("type", f"missing returned {lacks!r}", "return a list of texts, [] for ready", place)
            raise TrialOver
        trial, before = self._trial, _bytes_of(view)
        began, worked = monotonic(), thread_time()
        trial.began = began
        try:
            wanted, reason = self._call("step", lambda: ask(self._behavior, view))
        finally:
            trial.began = None
        seconds = monotonic() - began
        if thread_time() - worked > TICK or seconds > WAIT:
            trial.slow_steps += 1
            if trial.slow_steps >= SLOW_STEPS:
                text = f"{SLOW_STEPS} steps took longer than a tick of {TICK:g} s, the last {seconds:.2f} s"
                self._blame("slow", text, "do less in a step, and never sleep: count view.dt until it is time")
                raise TrialOver
        for what, content in _bytes_of(view).items():
            if content != before[what]:
                self._blame("changed", f"step changed view.{what}", f"copy it first: copy.deepcopy(view.{what})")
        self._check(wanted, reason, view)
        return wanted, reason

    def _check(self, wanted: Twist, reason: Any, view: View) -> None:
        linear, angular = wanted.linear, wanted.angular
        motion = Velocity(linear.x, turn=angular.z)
        self._trial.answers.append(motion)
        if not isinstance(reason, str):
            self._blame("type", f"self.reason is {reason!r}", 'it is a text: "" while the robot drives')
            raise TrialOver
        if not math.isfinite(motion.x + motion.turn):
            hint = "nan comes of beams that say nothing, of 0/0 and of inf - inf: test with math.isfinite"
            self._blame("number", f"step asks for {velocity_text(motion)}", hint)
            return
        most = BaseLimits(view.base).clamp(motion)
        if max(abs(most.x - motion.x), abs(most.turn - motion.turn)) > _TOLERANCE:
            hint = "limit it, for example max(-1.0, min(1.0, speed)); view.base has the limits"
            self._blame("limit", f"step asks for {velocity_text(motion)}, this robot does {velocity_text(most)}", hint)
        ignored = {"linear.y": linear.y, "linear.z": linear.z, "angular.x": angular.x, "angular.y": angular.y}
        for name, value in ignored.items():
            if value:
                self._blame("ignored", f"step sets {name} = {value!r}, which moves nothing", _NO_SPEED)

    def _blame(self, kind: str, text: str, hint: str = "", place: str = "") -> None:
        self._trial.blame(kind, text + self._label, hint, place)

    def _call(self, method: str, call: Callable[[], T]) -> T:
        """What the author's method returns; TrialOver if it raises."""
        try:
            return call()
        except BehaviorError as error:
            self._blame("type", str(error))
        except BaseException as error:
            # The author's own code may raise anything, also SystemExit.
            text, place = error_text(error), self._trial.place_in(traceback.extract_tb(error.__traceback__))
            hint = next((hint for word, hint in _HINTS.items() if word in text), "")
            self._blame("raises", f"{method} raises {text}", hint, place)
        raise TrialOver


def _line_text(file: str, line: int) -> str:
    source = linecache.getline(file, line).strip()
    path = Path(file)
    shown = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return f"{os.fspath(shown)}:{line}: {source}".removesuffix(": ")


def velocity_text(motion: Velocity) -> str:
    return f"{motion.x:.6g} m/s, {motion.turn:.6g} rad/s"


def _bytes_of(view: View) -> dict[str, bytes]:
    """The messages of a view, by the name of its field."""
    found = {"scan": _encoded(view.scan), "odom": _encoded(view.odom)}
    for name, message in view.inputs.items():
        messages = message.values() if isinstance(message, Mapping) else [message]
        found[f'inputs["{name}"]'] = b"".join(map(_encoded, messages))
    return found


def _encoded(message: Message | None) -> bytes:
    try:
        return b"" if message is None else encode(message)
    except EncodeError as error:
        return str(error).encode()


def _look(make: Callable[[ViewMaker], Iterable[View]], trial: Trial) -> None:
    trial.look(make(trial.moment))


def _look_at_old_poses(ages: tuple[float, float], trial: Trial) -> None:
    """A robot that other old poses would move otherwise, and that stands or fails while these are unknown, drives by
    them."""
    own, unknown = ages[0] > 0.0, list[Velocity]()
    here, *there = (str(trial.look(trial.moment.views(poses=each, ages=ages))) for each in (POSES, *elsewhere(own=own)))
    known = dict(trial.faults)
    with suppress(TrialOver):
        unknown = trial.look(trial.moment.views(poses={} if own else {ROBOT: POSES[ROBOT]}))
    trial.faults = known
    if any(each != here for each in there) and not any(map(any, unknown)):
        hint = "stand unless view.is_fresh(stamp, 0.5)" + ("; set uses_tf = True" if own else "")
        trial.blame("old", f"it drives by poses that are {max(ages):g} s old", hint)


def _try_bounds(trial: Trial) -> None:
    for name, value in bounds(trial.kind):
        # Another rule of its Params may forbid this value.
        with suppress(UsageError):
            made, changed = Subject(trial, **{name: value}), Subject(trial)
            for step, view in enumerate(trial.moment.views()):
                if step == 1:
                    changed.set_params(**{name: value})
                made.step(view)
                changed.step(view)


class Start(NamedTuple):
    """Where both robots of a trial begin, in `map`, and the speed of the other one (m/s)."""

    own: Pose2
    other: Pose2
    speed: float = 0.0


PLACES = {
    "a robot stands in its way": Start(Pose2(-1.0, 0.0, 0.0), Pose2(0.8, 0.0, math.pi)),
    "a robot drives towards it": Start(Pose2(-2.0, 0.0, 0.0), Pose2(2.5, 0.1, math.pi), 0.4),
    "a wall is right behind it": Start(Pose2(-4.4, 0.0, 0.0), Pose2(-2.0, 1.0, -0.5 * math.pi), 0.3),
    "it starts in a corner": Start(Pose2(4.2, 4.2, 0.25 * math.pi), Pose2(2.7, 4.0, 0.0), 0.2),
}
"""By the name of the trial."""


def drive(
    step: Callable[[View], tuple[Twist, str]],
    place: Start,
    inputs: Mapping[str, Any],
    touch: Callable[[Pose2], None] = lambda _: None,
) -> tuple[float, float]:
    """Drive in the simulator for SECONDS with the velocities and reasons of `step`; `inputs` are those of its views.

    Returns metres, and seconds in which the safety layer held the robot. `touch(pose)` is called in each tick in which
    it stands against something.
    """
    world, starts = _load(), {LEADER: place.other, ROBOT: place.own}
    robots = {i: add_robot(world, "erratic", pose, names.robot_name(i)) for i, pose in starts.items()}
    engine, other = Engine(world, robots=robots), Forward(ForwardParams(place.speed))
    layers = {i: SafetyLayer() for i in robots}
    commands: dict[int, Twist] = {}
    at, travelled, held = place.own, 0.0, 0.0
    for _ in range(round(SECONDS / DT)):
        observation = engine.step(commands)
        robot = observation.robots[ROBOT]
        travelled, at = travelled + math.dist(robot.truth[:2], at[:2]), robot.truth
        if robot.stall:
            touch(at)
        view = _view(observation, ROBOT, inputs)
        wanted, reason = step(view)
        commands[ROBOT], cause = layers[ROBOT].limit(wanted, view, reason)
        held += DT if cause else 0.0
        commands[LEADER], _reason = decide(other, _view(observation, LEADER, {}), layers[LEADER])
    return travelled, held


def _drive(place: Start, trial: Trial) -> None:
    contacts = list[Pose2]()
    try:
        travelled, held = drive(Subject(trial).step, place, trial.moment.messages(), contacts.append)
    finally:
        if contacts:
            x, y, _ = contacts[0]
            text = f"it drove against something for {DT * len(contacts):.1f} s, at x {x:.1f}, y {y:.1f}"
            hint = "the safety layer sees only what the laser has seen: look before you turn or back up"
            trial.blame("touched", text, hint)
    trial.note = f"{travelled:.1f} m in {SECONDS:g} s"
    trial.note += f"; the safety layer held it for {held:.1f} s" if held else ""


def _view(observation: Observation, robot_id: int, inputs: Mapping[str, Any]) -> View:
    now = observation.stamp
    return View(
        now=now,
        dt=DT if observation.tick > 1 else 0.0,
        robot_id=robot_id,
        scan=scan_message(observation, robot_id, 0),
        odom=odometry_message(observation, robot_id),
        lookup=lookup_in({i: robot.truth for i, robot in observation.robots.items()}, now),
        team=tuple(observation.robots),
        bases=dict.fromkeys(observation.robots, DEFAULT_BASE),
        inputs=inputs,
    )


@cache
def _load() -> World:
    return load_world(find_world("arena"))


def all_trials(kind: type[Behavior]) -> dict[str, Callable[[Trial], None]]:
    """The trials of a behaviour, by their names, in order."""
    found: dict[str, Callable[[Trial], None]] = {name: partial(_look, make) for name, make in SITUATIONS.items()}
    if kind.inputs:
        found["empty messages on its inputs"] = partial(_look, lambda moment: moment.views(has_messages=True))
    found |= {name: partial(_look_at_old_poses, ages) for name, ages in STALE_SITUATIONS.items()}
    if any(bounds(kind)):
        found["parameters at their bounds"] = _try_bounds
    return found | {name: partial(_drive, place) for name, place in PLACES.items()}


def run_trials(spec: str, kind: type[Behavior], params: dict[str, Any]) -> Iterator[TrialResult]:
    """Try the behaviour `spec`; each result as soon as it is there. A behaviour that is slow or hangs ends the trials.

    Raises UsageError where `params` are not what it takes.
    """
    given = given_params(spec, kind, params)
    read_params(spec, kind, given, ROBOT)
    for name, act in all_trials(kind).items():
        began, trial = monotonic(), Trial(spec, kind, given)
        _run(trial, act)
        faults = [*trial.faults.values()]
        yield TrialResult(name, faults, trial.note, monotonic() - began)
        if any(fault.kind in ("slow", "hangs") for fault in faults):
            return


def _run(trial: Trial, act: Callable[[Trial], None]) -> None:
    """Run a trial on a thread, which is left alone where a step does not return."""

    def work() -> None:
        try:
            trial.compare(act)
        except BaseException as error:
            trial.error = error

    thread = threading.Thread(target=work, name="trial", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_LOOK_EVERY)
        began = trial.began
        if began is not None and monotonic() - began > HANGS_AFTER:
            stack = stacks_in(dump_stacks()).get(thread.ident or 0, traceback.StackSummary())
            text = f"step did not return within {HANGS_AFTER:g} s"
            hint = "do one thing and return: step is called anew for each scan"
            trial.blame("hangs", text, hint, trial.place_in(stack))
            return
    if trial.error is not None:
        raise trial.error


def find_faults(behavior: str, **params: Any) -> list[str]:
    """What `zteam check` finds wrong with a behaviour, such as `"my_robot:Circle"`: text, line and first trial of each.

    Raises UsageError where there is no such behaviour, or it does not take `params`.
    """
    found: dict[tuple[str, str], str] = {}
    for result in run_trials(behavior, find_behavior(behavior), params):
        for fault in result.faults:
            found.setdefault((fault.kind, fault.place), f"{fault.text} ({fault.place}; {result.name})")
    return [*found.values()]
