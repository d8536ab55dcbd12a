"""All trials of a behaviour, each twice, watched from another thread: it may hang."""

import queue
import threading
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any

import msgspec

from zteam.clock import monotonic
from zteam.errors import UsageError
from zteam.robot.behaviors.behavior import Behavior, View
from zteam.robot.behaviors.registry import find_behavior, read_params
from zteam.robot.safety.motion import Motion
from zteam.robot.trials.situations import (
    POSES,
    ROBOT,
    SITUATIONS,
    STALE_SITUATIONS,
    ViewMaker,
    bounds,
    elsewhere,
    given_params,
)
from zteam.robot.trials.subject import (
    Candidate,
    Fault,
    HeardCalls,
    StepAnswer,
    Subject,
    TrialOver,
    TrialWatch,
    place_of_step,
    shared_state,
    velocity_text,
)
from zteam.robot.trials.worlds import PLACES, SECONDS, Start, TrialDrive


class TrialRun:
    """One run of a trial: makes its subjects, and keeps what it came to."""

    def __init__(self, candidate: Candidate, watch: TrialWatch, blame: Callable[[Fault], None]) -> None:
        self.candidate, self.blame, self._watch = candidate, blame, watch
        self.moment = ViewMaker(candidate.kind.inputs)
        self.note = ""
        """What else a person may want to know."""

    def make(self, **params: Any) -> Subject:
        """A new object of the behaviour, with these parameters besides."""
        return Subject(self.candidate, self._watch, self.blame, **params)

    def look(self, views: Iterable[View]) -> list[StepAnswer]:
        """What a new object answers to these views."""
        subject, answers = self.make(), []
        for view in views:
            subject.prepare(view)
            answers.append(subject.step(view))
        return answers


Trial = Callable[[TrialRun], list[StepAnswer]]


def all_trials(candidate: Candidate) -> dict[str, Trial]:
    """The trials of a behaviour, by their names, in order."""
    found: dict[str, Trial] = {name: partial(_look, make) for name, make in SITUATIONS.items()}
    found["nothing has come yet"] = _before_anything
    if candidate.kind.inputs:
        found["empty messages on its inputs"] = partial(_look, lambda moment: moment.views(has_messages=True))
    found |= {name: partial(_look_at_old_poses, ages) for name, ages in STALE_SITUATIONS.items()}
    if any(bounds(candidate.kind)):
        found["parameters at their bounds"] = _try_bounds
    return found | {name: partial(_drive, place) for name, place in PLACES.items()}


def _look(views: Callable[[ViewMaker], Iterable[View]], run: TrialRun) -> list[StepAnswer]:
    return run.look(views(run.moment))


def _before_anything(run: TrialRun) -> list[StepAnswer]:
    """No robot asks for a step before its first scan, so an error there is a remark."""
    view, subject = run.moment.view(1.0, 0.0, None, {}, has_odom=False), run.make()
    subject.prepare(view)
    subject.step_anyhow(view)
    return []


def _look_at_old_poses(ages: tuple[float, float], run: TrialRun) -> list[StepAnswer]:
    """Robots that differ in nothing but old poses: if they drive differently, they drive by these.

    One that drives without these poses too is not meant: to keep clear of where another robot was is no fault.
    """
    own, kind = ages[0] > 0.0, run.candidate.kind
    here, again, *there = (
        run.look(run.moment.views(poses=poses, ages=ages)) for poses in (POSES, POSES, *elsewhere(own=own))
    )
    depends = any(_motions(answers) != _motions(here) for answers in there)
    if depends and _motions(here) == _motions(again) and _stands_without(run, own=own):
        text = f"it drives by poses that are {max(ages):g} s old"
        hint = "stand unless view.is_fresh(stamp, 0.5)" + ("; set uses_tf = True" if own else "")
        run.blame(Fault("old", text, hint, place_of_step(kind)))
    return here


def _stands_without(run: TrialRun, *, own: bool) -> bool:
    """Whether it stands, or fails, while the others' poses are unknown, and its `own` one if asked for."""
    unwatched = TrialRun(run.candidate, TrialWatch(run.candidate.kind), lambda _: None)
    try:
        answers = unwatched.look(run.moment.views(poses={} if own else {ROBOT: POSES[ROBOT]}))
    except TrialOver:
        return True
    return not any(any(answer.motion) for answer in answers)


def _motions(answers: list[StepAnswer]) -> list[Motion]:
    return [answer.motion for answer in answers]


def _try_bounds(run: TrialRun) -> list[StepAnswer]:
    answers = []
    for name, value in bounds(run.candidate.kind):
        try:
            subject, changed = run.make(**{name: value}), run.make()
        except UsageError:
            # Another rule of its Params forbids this value.
            continue
        for step, view in enumerate(run.moment.views()):
            if step == 1:
                changed.set_params(**{name: value})
            answers += [subject.step(view), changed.step(view)]
    return answers


def _drive(place: Start, run: TrialRun) -> list[StepAnswer]:
    drive = TrialDrive(run.make(), place, run.moment.messages())
    try:
        drive.run()
    finally:
        if drive.contact_at is not None:
            x, y, _ = drive.contact_at
            text = f"it drove against something for {drive.contact:.1f} s, at x {x:.1f}, y {y:.1f}"
            hint = "the safety layer sees only what the laser has seen: look before you turn or back up"
            run.blame(Fault("touched", text, hint, place_of_step(run.candidate.kind)))
    run.note = f"{drive.travelled:.1f} m in {SECONDS:g} s"
    run.note += f"; the safety layer held it for {drive.cut:.1f} s" if drive.cut else ""
    return drive.answers


_LOOK_EVERY = 0.02
"""Host seconds between two looks at the thread that steps."""
_PATIENCE = 3.0
"""Host seconds of slow steps after which no further trial begins."""


class TrialResult(msgspec.Struct, frozen=True):
    """What a trial came to."""

    name: str
    faults: list[Fault]
    note: str
    seconds: float
    """Of the host's time."""

    @property
    def is_good(self) -> bool:
        """Whether nothing was wrong; remarks are not."""
        return all(fault.is_remark for fault in self.faults)


def trial_names(kind: type[Behavior]) -> list[str]:
    return [*all_trials(Candidate("", kind, {}))]


def run_trials(
    spec: str, kind: type[Behavior], params: dict[str, Any], leave_out: Collection[str] = ()
) -> Iterator[TrialResult]:
    """Try the behaviour `spec`; each result as soon as it is there. A behaviour that hangs or waits ends the trials.

    The trials of these names are left out. Raises UsageError where `params` are not what it takes.
    """
    candidate = Candidate(spec, kind, given_params(spec, kind, params))
    read_params(spec, kind, candidate.params, ROBOT)
    results = queue.Queue[TrialResult | BaseException | None]()
    judge = _Judge(candidate)
    trials = {name: trial for name, trial in all_trials(candidate).items() if name not in leave_out}

    def work() -> None:
        try:
            for name, trial in trials.items():
                results.put(judge.judge(name, trial))
                if judge.watch.lost > _PATIENCE:
                    break
        except BaseException as error:
            results.put(error)
        results.put(None)

    threading.Thread(target=work, name="trials", daemon=True).start()
    while True:
        try:
            result = results.get(timeout=_LOOK_EVERY)
        except queue.Empty:
            hanging = judge.watch.look()
            if hanging is not None:
                yield judge.end_trial(hanging)
                return
            continue
        if result is None:
            return
        if isinstance(result, BaseException):
            raise result
        yield result


def find_faults(behavior: str, **params: Any) -> list[str]:
    """What `zteam check` finds wrong with a behaviour, such as `"my_robot:Circle"`: text, line and first trial of each.

    Raises UsageError where there is no such behaviour, or it does not take `params`.
    """
    found: dict[tuple[str, str], str] = {}
    for result in run_trials(behavior, find_behavior(behavior), params):
        for fault in result.faults:
            if not fault.is_remark:
                found.setdefault((fault.kind, fault.place), f"{fault.text} ({fault.place}; {result.name})")
    return [*found.values()]


class _Judge:
    """Runs each trial twice with new objects, as after a reset, and compares."""

    def __init__(self, candidate: Candidate) -> None:
        self.watch = TrialWatch(candidate.kind)
        self._candidate = candidate
        self._name = ""
        self._faults: dict[tuple[str, str], Fault] = {}
        """Of the trial that runs, by kind and place."""
        self._began = 0.0

    def judge(self, name: str, trial: Trial) -> TrialResult:
        self._name, self._faults, self._began = name, {}, monotonic()
        note = ""
        # The fault that ends a trial is noted.
        with suppress(TrialOver):
            note = self._compare(trial)
        return self.end_trial(self.watch.slowness(), note)

    def end_trial(self, fault: Fault | None, note: str = "") -> TrialResult:
        """The result of the trial that runs; `fault` is a last one."""
        if fault is not None:
            self._take(fault)
        return TrialResult(self._name, [*self._faults.values()], note, monotonic() - self._began)

    def _take(self, fault: Fault) -> None:
        self._faults.setdefault((fault.kind, fault.place), fault)

    def _compare(self, trial: Trial) -> str:
        kind = self._candidate.kind
        before, run = shared_state(kind), TrialRun(self._candidate, self.watch, self._take)
        first = trial(run)
        kept = [name for name, value in shared_state(kind).items() if before.get(name) != value]
        heard = self.watch.heard = HeardCalls(kind)
        try:
            second = trial(TrialRun(self._candidate, self.watch, self._take))
        finally:
            self.watch.heard = None
        for name, place in heard.clocks.items():
            hint = "go by view.now and view.dt, and never wait: simulated time is faster, slower, or stands still"
            self._take(Fault("clock", f"step calls {name}, by the host's clock", hint, place))
        difference = _difference(first, second)
        if difference:
            self._take(self._why(difference, kept, heard))
        return run.note

    def _why(self, difference: str, kept: list[str], heard: HeardCalls) -> Fault:
        """The fault behind two runs that differ."""
        step = place_of_step(self._candidate.kind)
        if kept and not heard.chance:
            text = f"it keeps {', '.join(kept)} over a reset: {difference}"
            return Fault("state", text, "a new object is made then: keep what changes in self, from __init__ on", step)
        text = f"the same views and seed do not give the same velocities: {difference}"
        if heard.chance:
            return Fault("random", text, "take view.random(), which a run repeats", heard.chance["random"])
        hint = "step may go by its view alone: view.random() for chance (not numpy.random), view.now for time"
        return Fault("random", text, hint, step)


def _difference(first: list[StepAnswer], second: list[StepAnswer]) -> str:
    """Where two runs differ first, for people; empty where they do not."""
    for step, (one, other) in enumerate(zip(first, second, strict=True), 1):
        # As text, because nan is not equal to itself.
        if str(one.motion) != str(other.motion):
            return f"step {step} asks for {velocity_text(one.motion)}, then for {velocity_text(other.motion)}"
    return ""
