"""How far runs in real time may differ from the same runs in lock-step."""

from collections.abc import Iterable, Mapping, Sequence
from statistics import median

import msgspec

from studies.study.one_run import Outcome


class Agreement(msgspec.Struct, frozen=True):
    """The bounds of one case. Each is for the median of all runs, contacts for every run."""

    driven: float = 0.1
    """Share of its way in lock-step by which the way of a robot may differ."""
    gap: float = 0.1
    """Share of their distance in lock-step by which the distance of two robots may differ."""
    safety_stops: int = 2
    """More than in lock-step, of all robots together."""
    stand: float = 3.0
    """Seconds by which the longest stand of a robot may be longer than the longest of any robot in lock-step."""
    contacts: int = 0
    """In one run."""


AGREEMENTS = {
    "wanderer": Agreement(),
    "arena": Agreement(),
    "line": Agreement(),
    "chain": Agreement(),
    # Goals come from a list: a robot that is a moment later drives to another one in the end.
    "navigation": Agreement(driven=0.2),
}
"""By case; others have the default."""


def disagreements(what: str, real: Sequence[Outcome], lockstep: Sequence[Outcome]) -> list[str]:
    """What is further apart than the case `what` may be, a line each; both have at least one run."""
    bounds, (here, there) = AGREEMENTS.get(what, Agreement()), (medians_of(real), medians_of(lockstep))
    missed = _apart("driven", here.driven, there.driven, bounds.driven)
    missed += _apart("gap", here.gaps, there.gaps, bounds.gap)
    if here.safety_stops > there.safety_stops + bounds.safety_stops:
        more = f"{here.safety_stops:g}, in lock-step {there.safety_stops:g}: more than {bounds.safety_stops} more"
        missed.append(f"safety stops {more}")
    if here.stand > there.stand + bounds.stand:
        longer = f"{here.stand:g} s, in lock-step {there.stand:g} s: more than {bounds.stand:g} s longer"
        missed.append(f"a robot stood {longer}")
    contacts = max(run.contacts for run in real)
    if contacts > bounds.contacts:
        missed.append(f"contacts {contacts} in one run, at most {bounds.contacts}")
    return missed


def _apart(what: str, here: Mapping[int, float], there: Mapping[int, float], share: float) -> list[str]:
    return [
        f"robot {robot}: {what} {metres:.2f} m, in lock-step {there[robot]:.2f} m: more than {100 * share:g} % apart"
        for robot, metres in here.items()
        if robot in there and abs(metres - there[robot]) > share * there[robot]
    ]


class Medians(msgspec.Struct, frozen=True):
    """Of some runs of a case."""

    driven: dict[int, float]
    """Metres, by robot."""
    gaps: dict[int, float]
    """As `Outcome.gaps`."""
    safety_stops: float
    stand: float
    """Longest of any robot, seconds."""


def medians_of(runs: Sequence[Outcome]) -> Medians:
    """The medians of at least one run."""
    return Medians(
        _by_robot(dict(enumerate(run.driven)) for run in runs),
        _by_robot(run.gaps for run in runs),
        median(run.safety_stops for run in runs),
        median(max(run.stands) for run in runs),
    )


def _by_robot(rows: Iterable[Mapping[int, float]]) -> dict[int, float]:
    by_robot: dict[int, list[float]] = {}
    for row in rows:
        for robot, value in row.items():
            by_robot.setdefault(robot, []).append(value)
    return {robot: median(values) for robot, values in sorted(by_robot.items())}
