"""The trials by name, and one run of each."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from zteam.behaviors.safety.swept import Motion
from zteam.behaviors.view import View
from zteam.errors import UsageError
from zteam.trials.fault import Fault, place_of_step
from zteam.trials.limits import bounds
from zteam.trials.situations import POSES, ROBOT, SITUATIONS, STALE_SITUATIONS, Moment, elsewhere, nothing
from zteam.trials.subject import Answer, Candidate, Subject, TrialOver
from zteam.trials.watch import Watch
from zteam.trials.worlds import PLACES, SECONDS, Drive, Place

MakeSubject = Callable[..., Subject]
"""`make(name=value, …)`: a new object of the behaviour with these parameters besides."""


class Run(NamedTuple):
    """One run of a trial."""

    make: MakeSubject
    moment: Moment
    blame: Callable[[Fault], None]
    candidate: Candidate


class Outcome(NamedTuple):
    """What a run came to."""

    answers: list[Answer]
    note: str = ""
    """What else a person may want to know."""


Trial = Callable[[Run], Outcome]


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


def _look(views: Callable[[Moment], Iterator[View]], run: Run) -> Outcome:
    return Outcome(_answers(run.make(), views(run.moment)))


def _answers(subject: Subject, views: Iterator[View]) -> list[Answer]:
    answers = []
    for view in views:
        subject.prepare(view)
        answers.append(subject.step(view))
    return answers


def _before_anything(run: Run) -> Outcome:
    """No robot asks for a step before its first scan, so an error there is a remark."""
    view = nothing(run.moment)
    subject = run.make()
    subject.prepare(view)
    subject.step_anyhow(view)
    return Outcome([])


def _look_at_old_poses(ages: tuple[float, float], run: Run) -> Outcome:
    """Robots that differ in nothing but old poses: if they drive differently, they drive by these.

    One that drives without these poses too is not meant: to keep clear of where another robot was is no fault.
    """
    here, again, *there = (
        _answers(run.make(), run.moment.views(poses=poses, ages=ages))
        for poses in (POSES, POSES, *elsewhere(own=ages[0] > 0.0))
    )
    depends = any(_motions(answers) != _motions(here) for answers in there)
    if depends and _motions(here) == _motions(again) and _stands_without(run, own=ages[0] > 0.0):
        text = f"it drives by poses that are {max(ages):g} s old"
        hint = "stand unless view.is_fresh(stamp, 0.5)" + ("; set uses_tf = True" if ages[0] else "")
        run.blame(Fault("old", text, hint, place_of_step(run.candidate.kind)))
    return Outcome(here)


def _stands_without(run: Run, *, own: bool) -> bool:
    """Whether it stands, or fails, while the others' poses are unknown, and its `own` one if asked for."""
    subject = Subject(run.candidate, ROBOT, Watch(run.candidate.kind), lambda _: None)
    try:
        answers = _answers(subject, run.moment.views(poses={} if own else {ROBOT: POSES[ROBOT]}))
    except TrialOver:
        return True
    return not any(any(answer.motion) for answer in answers)


def _motions(answers: list[Answer]) -> list[Motion]:
    return [answer.motion for answer in answers]


def _try_bounds(run: Run) -> Outcome:
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
    return Outcome(answers)


def _drive(place: Place, run: Run) -> Outcome:
    drive = Drive(run.make(), place, run.moment.no_messages())
    try:
        drive.run()
    finally:
        if drive.contact_at is not None:
            x, y, _ = drive.contact_at
            text = f"it drove against something for {drive.contact:.1f} s, at x {x:.1f}, y {y:.1f}"
            hint = "the safety layer sees only what the laser has seen: look before you turn or back up"
            run.blame(Fault("touched", text, hint, place_of_step(run.candidate.kind)))
    note = f"{drive.travelled:.1f} m in {SECONDS:g} s"
    return Outcome(drive.answers, note + (f"; the safety layer held it for {drive.cut:.1f} s" if drive.cut else ""))
