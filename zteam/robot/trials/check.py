"""All trials of a behaviour. Each is one comparison of two runs with new objects, as after a reset.

The last ones drive in the simulator: a small world, another robot, and the safety layer under both, as in a team.
"""

import inspect
import math
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import msgspec

from zteam import names
from zteam.clock import monotonic, thread_time
from zteam.config.resources import find_world
from zteam.errors import BehaviorError, UsageError
from zteam.geometry import Pose2, Velocity
from zteam.messages import Twist, Vector3
from zteam.messages.base import DEFAULT_BASE
from zteam.node.faults import dump_stacks, stacks_in
from zteam.robot.behaviors.behavior import Behavior, ask, decide
from zteam.robot.behaviors.registry import error_text, find_behavior, is_own, read_params
from zteam.robot.behaviors.wander import Forward, ForwardParams
from zteam.robot.safety.layer import SafetyLayer
from zteam.robot.safety.motion import limit_speed
from zteam.robot.trials import situations
from zteam.robot.trials.situations import DT, LEADER, POSES, ROBOT, SITUATIONS, empty_messages, make_views, steady
from zteam.robot.view import View
from zteam.simulator.core import Engine, Observation
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.simulator.world import add_robot, load_world

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


class Fault(msgspec.Struct, frozen=True):
    """One thing that a behaviour does wrong."""

    kind: str
    text: str
    """What it does, with the behaviour as the subject that is left out: `step raises …`."""
    place: str
    """`file:line` of the author's own line."""


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
        self.answers: list[Velocity] = []
        """Of all steps of the run so far."""
        self.faults: dict[tuple[str, str], Fault] = {}
        """By kind and place."""
        self.note = ""
        self.label = ""
        """Which parameters the objects have besides those of the trial, for the texts of faults."""
        self.began: float | None = None
        """Host time when the step began that is under way."""
        self.slow_steps = 0
        self.error: BaseException | None = None
        """What went wrong in zteam itself."""

    def blame(self, kind: str, text: str, place: str = "") -> None:
        place = place or self.place_of("step")
        self.faults.setdefault((kind, place), Fault(kind, text + self.label, place))

    def give_up(self, kind: str, text: str, place: str = "") -> NoReturn:
        """As `blame`; the trial is over."""
        self.blame(kind, text, place)
        raise TrialOver

    def place_in(self, stack: traceback.StackSummary) -> str:
        """The author's innermost line in a stack; where there is none, that of its `step`."""
        module = getattr(sys.modules.get(self.kind.__module__), "__file__", "")
        own = [frame for frame in stack if is_own(frame.filename) or frame.filename == module]
        return _place(own[-1].filename, own[-1].lineno) if own else self.place_of("step")

    def place_of(self, method: str) -> str:
        code = inspect.unwrap(getattr(self.kind, method)).__code__
        return _place(code.co_filename, code.co_firstlineno)

    def compare(self, act: Callable[["Trial"], object]) -> None:
        """Do it twice, and compare the answers."""
        runs = []
        for _ in range(2):
            self.answers, self.label = [], ""
            with suppress(TrialOver):
                act(self)
            runs.append(self.answers)
        self.label = ""
        for step, (one, other) in enumerate(zip(*runs, strict=False), 1):
            # As text, because nan is not equal to itself.
            if str(one) != str(other):
                text = f"step {step} asks for {_text(one)}, then for {_text(other)}"
                self.blame("differs", f"a new object answers the same views otherwise: {text}")
                return

    def look(
        self, situation: Iterable[situations.Moment], ages: tuple[float, float] = (0.0, 0.0), robots: Sequence[int] = ()
    ) -> list[Velocity]:
        """What a new object answers in a situation; `robots` send empty messages. Raises TrialOver, as all below."""
        behavior, before = self.make(), len(self.answers)
        for view in make_views(situation, empty_messages(self.kind.inputs, robots), ages):
            self.step(behavior, view)
        return self.answers[before:]

    def read(self, params: Mapping[str, Any]) -> Any:
        """The parameters of the trial and these. Raises UsageError."""
        return read_params(self.spec, self.kind, {**self.params, **params}, ROBOT)

    def make(self, **params: Any) -> Behavior:
        """A new object, with these `params` too. Raises UsageError if it does not take them."""
        given = self.read(params)
        return self.call("__init__", lambda: self.kind(given))

    def step(self, behavior: Behavior, view: View) -> tuple[Twist, str]:
        """The velocity that it wants, and its reason. First it is asked what it lacks before it is ready."""
        lacks: Any = self.call("missing", lambda: behavior.missing(view))
        if not (isinstance(lacks, list) and all(isinstance(noun, str) for noun in lacks)):
            self.give_up("type", f"missing returned {lacks!r}, not a list of texts", self.place_of("missing"))
        worked = thread_time()
        self.began = began = monotonic()
        try:
            wanted, reason = self.call("step", lambda: ask(behavior, view))
        finally:
            self.began = None
        seconds = monotonic() - began
        self.slow_steps += thread_time() - worked > TICK or seconds > WAIT
        if self.slow_steps >= SLOW_STEPS:
            self.give_up("slow", f"{SLOW_STEPS} steps took longer than a tick of {TICK:g} s, the last {seconds:.2f} s")
        if not isinstance(reason, str):
            self.give_up("type", f"self.reason is {reason!r}, not a text")
        self._check(wanted, view)
        return wanted, reason

    def _check(self, wanted: Twist, view: View) -> None:
        linear, angular = wanted.linear, wanted.angular
        motion = Velocity(linear.x, turn=angular.z)
        self.answers.append(motion)
        if not math.isfinite(motion.x + motion.turn):
            self.blame("number", f"step asks for {_text(motion)}")
            return
        limited, _ = limit_speed(Twist(Vector3(motion.x), Vector3(z=motion.turn)), view.base)
        most = Velocity(limited.linear.x, turn=limited.angular.z)
        if max(abs(most.x - motion.x), abs(most.turn - motion.turn)) > _TOLERANCE:
            self.blame("limit", f"step asks for {_text(motion)}, this robot does {_text(most)}")
        ignored = {"linear.y": linear.y, "linear.z": linear.z, "angular.x": angular.x, "angular.y": angular.y}
        for name, value in ignored.items():
            if value:
                self.blame("ignored", f"step sets {name} = {value!r}, which moves nothing")

    def call(self, method: str, call: Callable[[], T]) -> T:
        """What the author's method returns; TrialOver if it raises."""
        try:
            return call()
        except BehaviorError as error:
            self.give_up("type", str(error))
        except BaseException as error:
            # The author's own code may raise anything, also SystemExit.
            place = self.place_in(traceback.extract_tb(error.__traceback__))
            self.give_up("raises", f"{method} raises {error_text(error)}", place)


def _place(file: str, line: int | None) -> str:
    path = Path(file)
    return f"{path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path}:{line}"


def _text(motion: Velocity) -> str:
    return f"{motion.x:.6g} m/s, {motion.turn:.6g} rad/s"


def _look_at_old_poses(ages: tuple[float, float], trial: Trial) -> None:
    """A robot that other old poses would move otherwise, and that stands or fails while these are unknown, drives by
    them."""
    own, unknown = ages[0] > 0.0, list[Velocity]()
    others = [poses if own else {**poses, ROBOT: POSES[ROBOT]} for poses in situations.OTHER_POSES]
    here, *there = (str(trial.look(steady(poses=each), ages)) for each in (POSES, *others))
    known = dict(trial.faults)
    with suppress(TrialOver):
        unknown = trial.look(steady(poses={} if own else {ROBOT: POSES[ROBOT]}))
    trial.faults = known
    if any(each != here for each in there) and not any(map(any, unknown)):
        trial.blame("old", f"it drives by poses that are {max(ages):g} s old: see view.is_fresh")


def _try_bounds(trial: Trial) -> None:
    for name, value in situations.bounds(trial.kind):
        # Another rule of its Params may forbid this value.
        with suppress(UsageError):
            trial.label, given = f", with {name} = {value}", trial.read({name: value})
            made, changed = trial.make(**{name: value}), trial.make()
            for step, view in enumerate(make_views(steady(), empty_messages(trial.kind.inputs))):
                if step == 1:
                    changed.params = given
                    trial.call("on_params", changed.on_params)
                trial.step(made, view)
                trial.step(changed, view)


PLACES = {
    "a robot stands in its way": (Pose2(-1.0, 0.0, 0.0), Pose2(0.8, 0.0, math.pi), 0.0),
    "a robot drives towards it": (Pose2(-2.0, 0.0, 0.0), Pose2(2.5, 0.1, math.pi), 0.4),
    "a wall is right behind it": (Pose2(-4.4, 0.0, 0.0), Pose2(-2.0, 1.0, -0.5 * math.pi), 0.3),
    "it starts in a corner": (Pose2(4.2, 4.2, 0.25 * math.pi), Pose2(2.7, 4.0, 0.0), 0.2),
}
"""By the name of the trial: where the robot and another one begin, in `map`, and the speed of the other one (m/s)."""
_WORLD = cache(lambda: load_world(find_world("arena")))


def drive(
    step: Callable[[View], tuple[Twist, str]],
    place: tuple[Pose2, Pose2, float],
    inputs: Mapping[str, Any],
    contacts: list[Pose2],
) -> float:
    """Drive in the simulator for SECONDS with the velocities and reasons of `step`; `inputs` are those of its views.

    Returns metres. Adds to `contacts` its pose of each tick in which it stands against something.
    """
    world, starts = _WORLD(), {LEADER: place[1], ROBOT: place[0]}
    robots = {i: add_robot(world, "erratic", pose, names.robot_name(i)) for i, pose in starts.items()}
    engine, other = Engine(world, robots=robots), Forward(ForwardParams(place[2]))
    layers = {i: SafetyLayer() for i in robots}
    commands: dict[int, Twist] = {}
    at, travelled = place[0], 0.0
    for _ in range(round(SECONDS / DT)):
        observation = engine.step(commands)
        robot = observation.robots[ROBOT]
        travelled, at = travelled + math.dist(robot.truth[:2], at[:2]), robot.truth
        if robot.stall:
            contacts.append(at)
        view = _view(observation, ROBOT, inputs)
        wanted, reason = step(view)
        commands[ROBOT], _cause = layers[ROBOT].limit(wanted, view, reason)
        commands[LEADER], _reason = decide(other, _view(observation, LEADER, {}), layers[LEADER])
    return travelled


def _drive(place: tuple[Pose2, Pose2, float], trial: Trial) -> None:
    contacts, behavior = list[Pose2](), trial.make()
    try:
        travelled = drive(partial(trial.step, behavior), place, empty_messages(trial.kind.inputs), contacts)
    finally:
        if contacts:
            x, y, _ = contacts[0]
            seconds = DT * len(contacts)
            trial.blame("touched", f"it drove against something for {seconds:.1f} s, at x {x:.1f}, y {y:.1f}")
    trial.note = f"{travelled:.1f} m in {SECONDS:g} s"


def _view(observation: Observation, robot_id: int, inputs: Mapping[str, Any]) -> View:
    now = observation.stamp
    return View(
        now=now,
        dt=DT if observation.tick > 1 else 0.0,
        robot_id=robot_id,
        scan=scan_message(observation, robot_id, 0),
        odom=odometry_message(observation, robot_id),
        lookup=situations.lookup_in({i: robot.truth for i, robot in observation.robots.items()}, now),
        team=tuple(observation.robots),
        bases=dict.fromkeys(observation.robots, DEFAULT_BASE),
        inputs=inputs,
    )


def all_trials(kind: type[Behavior]) -> dict[str, Callable[[Trial], object]]:
    """The trials of a behaviour, by their names, in order."""
    found: dict[str, Callable[[Trial], object]] = {
        name: partial(Trial.look, situation=situation) for name, situation in SITUATIONS.items()
    }
    if kind.inputs:
        found["empty messages on its inputs"] = partial(Trial.look, situation=steady(), robots=(LEADER, 2))
    found |= {name: partial(_look_at_old_poses, ages) for name, ages in situations.STALE_SITUATIONS.items()}
    if any(situations.bounds(kind)):
        found["parameters at their bounds"] = _try_bounds
    return found | {name: partial(_drive, place) for name, place in PLACES.items()}


def run_trials(spec: str, kind: type[Behavior], params: dict[str, Any]) -> Iterator[TrialResult]:
    """Try the behaviour `spec`; each result as soon as it is there. A behaviour that is slow or hangs ends the trials.

    Raises UsageError where `params` are not what it takes.
    """
    given = situations.given_params(spec, kind, params)
    read_params(spec, kind, given, ROBOT)
    for name, act in all_trials(kind).items():
        began, trial = monotonic(), Trial(spec, kind, given)
        _run(trial, act)
        faults = [*trial.faults.values()]
        yield TrialResult(name, faults, trial.note, monotonic() - began)
        if any(fault.kind in ("slow", "hangs") for fault in faults):
            return


def _run(trial: Trial, act: Callable[[Trial], object]) -> None:
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
            trial.blame("hangs", f"step did not return within {HANGS_AFTER:g} s", trial.place_in(stack))
            return
    if trial.error is not None:
        raise trial.error


def format_faults(results: Iterable[TrialResult]) -> list[str]:
    """Each fault once, on one line: the author's line, what is wrong, and in which trials."""
    found: dict[tuple[str, str], tuple[Fault, list[str]]] = {}
    for result in results:
        for fault in result.faults:
            found.setdefault((fault.kind, fault.place), (fault, []))[1].append(result.name)
    lines = []
    for fault, trials in found.values():
        more = f" and {len(trials) - 1} more" if trials[1:] else ""
        lines.append(f"{fault.place}: {fault.text} (trial: {trials[0]}{more})")
    return lines


def find_faults(behavior: str, **params: Any) -> list[str]:
    """What `zteam check` finds wrong with a behaviour, such as `"my_robot:Circle"`: a line for each fault.

    Raises UsageError where there is no such behaviour, or it does not take `params`.
    """
    return format_faults(run_trials(behavior, find_behavior(behavior), params))
