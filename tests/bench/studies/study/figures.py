"""Many runs of the study `lines`: results in a file, and what they say together, real time beside lock-step."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import BinaryIO

import msgspec

from studies.launching import children
from studies.study.one_run import Outcome, Row, Task, measure
from zteam.cli.tables import format_table
from zteam.errors import UsageError


class Bounds(msgspec.Struct, frozen=True):
    """What all runs of a case must keep to; None: not judged."""

    contacts: int | None = None
    """In all runs together, at most."""
    held: float | None = None
    """Of each follower in each run, at least."""
    still: float | None = None
    """Seconds, at most."""
    share: float | None = None
    """Of the head's way, mean of the runs, at least."""
    stuck: int | None = None
    """Robots in all runs together that got stuck, at most."""


class CaseFigures(msgspec.Struct):
    """All runs of a case."""

    what: str
    seconds: float
    runs: list[Row]
    errors: int
    contacts: int
    stuck: int
    held: float | None
    """Of the worst follower in the worst run."""
    still: float
    share: float | None
    """Mean of the runs that went to their end."""
    missed: list[str]
    """What was missed, and in which run; empty if all is well."""
    lockstep: list[Row] = []
    """Of runs in real time: the same in lock-step."""


def read_results(path: Path) -> dict[bytes, Row]:
    """The rows of a file by their tasks as JSON, without a last line that was cut off. Raises UsageError."""
    found = {}
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1] if path.exists() else (), 1):
        try:
            row = msgspec.json.decode(line, type=Row)
        except msgspec.DecodeError as error:
            raise UsageError(f"--results {path}: line {number} is no result of a study: {error}") from None
        found[msgspec.json.encode(row.task)] = row
    return found


def run_study(
    tasks: Sequence[Task], results: Path | None, jobs: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Row]:  # fmt: skip
    """Run the tasks that `results` does not have yet, `jobs` at a time (None: one a core); the rows of all of them.

    Each row is written as soon as it is there. Raises UsageError for a file of another kind, OSError if it cannot be
    read or written.
    """
    known = read_results(results) if results is not None else {}
    keys = [msgspec.json.encode(task) for task in tasks]
    due = [task for task, key in zip(tasks, keys, strict=True) if key not in known]
    progress(len(tasks) - len(due), len(tasks))
    with ExitStack() as stack:
        file = stack.enter_context(_open_to_append(results)) if results is not None and due else None
        pool = stack.enter_context(children(jobs))
        futures = {pool.submit(measure, task): task for task in due}
        for done, future in enumerate(as_completed(futures), 1 + len(tasks) - len(due)):
            row = Row(futures[future], future.result())
            known[msgspec.json.encode(row.task)] = row
            if file is not None:
                file.write(msgspec.json.encode(row) + b"\n")
            progress(done, len(tasks))
    return [known[key] for key in keys]


def _open_to_append(path: Path) -> BinaryIO:
    """Behind the last whole line; each write reaches the file at once."""
    file = path.open("ab", buffering=0)
    file.truncate(path.read_bytes().rfind(b"\n") + 1)
    return file


APART, APART_OF = 0.1, {"navigation": 0.2}
"""Share of its way in lock-step by which the way of a robot may differ, and of a distance that of two robots. By case:
of the way where goals come from a list. A robot that is a moment later drives to another one in the end."""
MORE_STOPS = 2
"""Safety stops in real time beyond those in lock-step, of all robots together."""
LONGER = 3.0
"""Seconds by which the longest stand of a robot may be longer than that of any robot in lock-step."""


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


def disagreements(what: str, real: Sequence[Outcome], lockstep: Sequence[Outcome]) -> list[str]:
    """How the medians of at least one run of a case in real time differ too much from lock-step, a line each."""
    here, there = medians_of(real), medians_of(lockstep)
    missed = [
        f"robot {robot}: {name} {metres:.2f} m, in lock-step {beside[robot]:.2f} m: more than {100 * share:g} % apart"
        for name, found, beside, share in (
            ("driven", here.driven, there.driven, APART_OF.get(what, APART)),
            ("gap", here.gaps, there.gaps, APART),
        )
        for robot, metres in found.items()
        if robot in beside and abs(metres - beside[robot]) > share * beside[robot]
    ]
    if here.safety_stops > there.safety_stops + MORE_STOPS:
        missed.append(f"safety stops {here.safety_stops:g}, in lock-step {there.safety_stops:g}: more than 2 more")
    if here.stand > there.stand + LONGER:
        missed.append(f"a robot stood {here.stand:g} s, in lock-step {there.stand:g} s: more than 3 s longer")
    if contacts := max(run.contacts for run in real):
        missed.append(f"contacts {contacts} in one run, at most 0")
    return missed


def summarize(rows: Sequence[Row], lockstep: Sequence[Row], bounds: Bounds) -> CaseFigures:
    """The figures of the runs of one case, at least one, and what of the bounds they miss.

    `lockstep` are the same runs in lock-step, beside which runs in real time are judged.
    """
    good = [row for row in rows if not row.outcome.error]
    held = [(share, f"robot {i}, seed {row.task.seed}") for row in good for i, share in row.outcome.held.items()]
    stands = [(row.outcome.still, f"seed {row.task.seed}") for row in good]
    shares = [row.outcome.share for row in good if row.outcome.share is not None]
    contacts = sum(row.outcome.contacts for row in good)
    worst, longest = min(held, default=None), max(stands, default=(0.0, ""))
    share = round(sum(shares) / len(shares), 3) if shares else None
    missed = [f"seed {row.task.seed}: {row.outcome.error}" for row in (*lockstep, *rows) if row.outcome.error]
    if bounds.contacts is not None and contacts > bounds.contacts:
        seeds = ", ".join(str(row.task.seed) for row in good if row.outcome.contacts)
        missed.append(f"contacts {contacts}, at most {bounds.contacts}: seed {seeds}")
    if bounds.held is not None and worst is not None and worst[0] < bounds.held:
        missed.append(f"held {worst[0]:g}, at least {bounds.held:g}: {worst[1]}")
    if bounds.still is not None and longest[0] > bounds.still:
        missed.append(f"still {longest[0]:g} s, at most {bounds.still:g}: {longest[1]}")
    if bounds.share is not None and share is not None and share < bounds.share:
        missed.append(f"share {share:g} in the mean, at least {bounds.share:g}")
    stuck = [
        f"seed {row.task.seed}: robot {stand.robot} for {stand.seconds:g} s from {stand.begin:g} s on"
        for row in good
        for stand in ([] if row.outcome.too_small else row.outcome.stuck)
    ]
    if bounds.stuck is not None and len(stuck) > bounds.stuck:
        missed += stuck
    first, beside = rows[0].task, [row.outcome for row in lockstep if not row.outcome.error]
    if good and beside:
        missed += disagreements(first.what, [row.outcome for row in good], beside)
    return CaseFigures(
        first.what, first.seconds, list(rows), len(rows) - len(good), contacts, len(stuck),
        worst[0] if worst else None, longest[0], share, missed, list(lockstep),
    )  # fmt: skip


_LEGEND = [
    "failed, contacts, stuck: of all runs; a robot of a narrow place is stuck that stays though there is a way out.",
    "held: share of the time within 3 m of the robot that it follows, worst follower.",
    "still: longest time in which no robot moved. share: the head's way / (its speed x the time), mean of the runs.",
]
_BESIDE_LEGEND = [
    "medians of the runs: driven, by robot; gaps of robots that follow each other in the last third of the time;",
    "safety stops of all robots; the longest stand of a robot. late: steps that came late, in the worst run.",
]


def format_study(cases: Sequence[CaseFigures]) -> str:
    """One row a case, then what was missed."""
    header = ["case", "runs", "s", "failed", "contacts", "stuck", "held", "still, s", "share"]
    cells = [
        [
            case.what,
            f"{len(case.runs)}",
            f"{case.seconds:g}",
            f"{case.errors}",
            f"{case.contacts}",
            f"{case.stuck}",
            "-" if case.held is None else f"{case.held:.3f}",
            f"{case.still:.1f}",
            "-" if case.share is None else f"{case.share:.2f}",
        ]
        for case in cases
    ]
    missed = [f"{case.what}: MISSED: {text}" for case in cases for text in case.missed]
    small = [
        f"{case.what}: seed {row.task.seed}: {len(row.outcome.stuck)} stuck are not counted: {row.outcome.too_small}"
        for case in cases
        for row in case.runs
        if row.outcome.too_small
    ]
    beside = _beside_lockstep([case for case in cases if case.lockstep])
    return "\n".join([format_table(header, cells, numbers_from=1), *_LEGEND, *beside, *small, *missed])


def _beside_lockstep(cases: Sequence[CaseFigures]) -> list[str]:
    """Two rows a case, real time and lock-step, with the medians that are compared; nothing without a case."""
    cells = []
    for case in cases:
        for pace, rows in (("real time", case.runs), ("lock-step", case.lockstep)):
            runs = [row.outcome for row in rows if not row.outcome.error]
            if not runs:
                continue
            found = medians_of(runs)
            driven = " ".join(f"{metres:.1f}" for metres in found.driven.values())
            gaps = " ".join(f"{metres:.2f}" for metres in found.gaps.values()) or "-"
            late = f"{100 * max(run.late for run in runs):.1f}"
            cells.append([case.what, pace, driven, gaps, f"{found.safety_stops:g}", f"{found.stand:.1f}", late])
    header = ["case", "in", "driven, m", "gaps, m", "safety stops", "stood, s", "late, %"]
    return ["", format_table(header, cells, numbers_from=2), *_BESIDE_LEGEND] if cells else []
