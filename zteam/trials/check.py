"""All trials of a behaviour, each twice, watched from another thread: it may hang."""

import queue
import threading
from collections.abc import Collection, Iterator
from typing import Any

import msgspec

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.registry import find_behavior, read_params
from zteam.clock import monotonic
from zteam.trials import shared_state
from zteam.trials.chance import Heard
from zteam.trials.fault import Fault, place_of_step
from zteam.trials.limits import given_params
from zteam.trials.situations import ROBOT, Moment
from zteam.trials.subject import Answer, Candidate, Subject, TrialOver, velocity_text
from zteam.trials.trials import Outcome, Run, Trial, all_trials
from zteam.trials.watch import Watch

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
    """The names of all trials of a behaviour, in order."""
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
                yield judge.abandon(hanging)
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
        self.watch = Watch(candidate.kind)
        self._candidate = candidate
        self._name = ""
        self._faults: dict[tuple[str, str], Fault] = {}
        """Of the trial that runs, by kind and place."""
        self._began = 0.0

    def judge(self, name: str, trial: Trial) -> TrialResult:
        """What comes of a trial."""
        self._name, self._faults, self._began = name, {}, monotonic()
        note = ""
        try:
            note = self._compare(trial)
        except TrialOver:
            # Its fault is noted.
            pass
        self._take(self.watch.slowness())
        return self._result(note)

    def abandon(self, fault: Fault) -> TrialResult:
        """The result of a trial that will not end."""
        self._take(fault)
        return self._result("")

    def _result(self, note: str) -> TrialResult:
        return TrialResult(self._name, [*self._faults.values()], note, monotonic() - self._began)

    def _take(self, fault: Fault | None) -> None:
        if fault is not None:
            self._faults.setdefault((fault.kind, fault.place), fault)

    def _compare(self, trial: Trial) -> str:
        kind = self._candidate.kind
        before = shared_state.look(kind)
        first = self._run(trial)
        kept = shared_state.changed(before, shared_state.look(kind))
        heard = self.watch.heard = Heard(kind)
        try:
            second = self._run(trial)
        finally:
            self.watch.heard = None
        for name, place in heard.clocks.items():
            hint = "go by view.now and view.dt, and never wait: simulated time is faster, slower, or stands still"
            self._take(Fault("clock", f"step calls {name}, by the host's clock", hint, place))
        difference = _difference(first.answers, second.answers)
        if difference:
            self._take(self._why(difference, kept, heard))
        return first.note

    def _run(self, trial: Trial) -> Outcome:
        def make(**params: Any) -> Subject:
            return Subject(self._candidate, ROBOT, self.watch, self._take, **params)

        return trial(Run(make, Moment(self._candidate.kind.inputs), self._take, self._candidate))

    def _why(self, difference: str, kept: list[str], heard: Heard) -> Fault:
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


def _difference(first: list[Answer], second: list[Answer]) -> str:
    """Where two runs differ first, for people; empty where they do not."""
    for step, (one, other) in enumerate(zip(first, second, strict=True), 1):
        # As text, because nan is not equal to itself.
        if str(one.motion) != str(other.motion):
            return f"step {step} asks for {velocity_text(one.motion)}, then for {velocity_text(other.motion)}"
    return ""
