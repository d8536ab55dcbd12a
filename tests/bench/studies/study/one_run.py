"""One run of the study `lines`: a team, and what the true poses of its robots say."""

import math
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.recorder import NAME, Moment, Recorder, make_tracks
from studies.launching import run_processes
from studies.on_time import late_share, run_on_time
from studies.study.cases import CASES
from studies.study.driver import TELEOP, Driver
from studies.study.narrow import Narrow, why_too_small
from studies.study.stuck import Floor, Stand, find_stuck
from zteam.clock import to_ns
from zteam.config.resources import find_team
from zteam.team.run.report import RunReport
from zteam.team.run.run_team import run_team
from zteam.world import load_world

HELD = 3.0
"""Metres: a follower is held while the robot that it follows is so near."""
MOVED = 0.05
"""Metres: a robot that has not gone so far stands."""


class Task(msgspec.Struct, frozen=True):
    """What is run: two runs of equal tasks in lock-step are the same, to the bit."""

    what: str
    """A case by its name, or a team file."""
    seconds: float
    seed: int
    world: str | None = None
    """In the place of the team's own."""
    arguments: dict[str, str] = {}
    """Of a team file."""
    processes: bool = False
    """Whether it runs as the processes that `zteam up` starts; otherwise in this process and in lock-step."""
    speed: float | None = None
    """Of processes: simulated seconds a second of the host, in real time; None: in lock-step."""


class Outcome(msgspec.Struct, omit_defaults=True):
    """What a run gave; of one that failed only `error`."""

    error: str = ""
    driven: list[float] = []
    """Metres, by robot."""
    contacts: int = 0
    held: dict[int, float] = {}
    """Of the time in which a robot followed another, the share in which that was within HELD, by follower. Its status
    names the other: the robot of the team file, or its other neighbour after a turn of the line."""
    last: dict[int, float] = {}
    """Metres between them in the last tick of that time."""
    gaps: dict[int, float] = {}
    """Mean distance of two robots of which one follows the other, in the last third of the time, metres; by the higher
    id, so that a pair keeps its key when its line is led from the other end."""
    still: float = 0.0
    """Longest time in which no robot moved, seconds."""
    stands: list[float] = []
    """Longest time in which a robot did not move, seconds, by robot."""
    safety_stops: int = 0
    """How often the safety layers of all robots stopped or slowed them."""
    late: float = 0.0
    """Share of the steps that came late (real time)."""
    share: float | None = None
    """Way of the first robot by its speed times the time; None where the speed is not known."""
    stuck: list[Stand] = []
    """Robots that stayed in their place though there was a way to leave it; only of narrow places."""
    too_small: str = ""
    """Why the place is too small for the line to go round; stands in it are reported, and not counted as stuck."""
    trajectory: str = ""
    """Hash of the way of all robots: a run of the same task has the same one."""


class Row(msgspec.Struct, frozen=True):
    """A line of a file with results."""

    task: Task
    outcome: Outcome


def measure(task: Task) -> Outcome:
    """Run it. An error of the team is part of the outcome."""
    case = CASES.get(task.what)
    with tempfile.TemporaryDirectory() as folder:
        team = task.what if case is None else case.team
        if not team and case is not None:
            team = str(case.write(Path(folder), task.seed))
        try:
            report, moments = (_run_processes if task.processes else _run_here)(task, team)
        # Anything that ends a run is a result of the study.
        except (Exception, SystemExit) as error:
            return Outcome(error=f"{type(error).__name__}: {error}"[:200])
        floor = Floor(load_world(Path(folder, "narrow.world"))) if isinstance(case, Narrow) else None
    # The world stands still when the time is over; before GO no time counts.
    moments = [each for each in moments if each.now > moments[-1].now - to_ns(task.seconds)]
    places = make_tracks(moments).poses[..., :2]
    robots, followed = [robot.id for robot in report.robots], [each.followed for each in moments]
    apart, end = distances(places, robots, followed), -(len(moments) // 3)
    pairs = distances(places[end:], robots, pairs_of(followed[end:]))
    outcome = Outcome(
        driven=[round(robot.distance_m, 1) for robot in report.robots],
        contacts=sum(robot.stalls for robot in report.robots),
        held={i: round(sum(gap < HELD for gap in gaps) / len(gaps), 4) for i, gaps in apart.items()},
        last={i: round(gaps[-1], 1) for i, gaps in apart.items()},
        gaps={i: round(fmean(gaps), 3) for i, gaps in pairs.items()},
        still=_seconds(task, places),
        stands=[_seconds(task, places[:, [i]]) for i in range(len(robots))],
        safety_stops=sum(report.safety_stops.values()),
        late=round(late_share(report), 4),
        trajectory=report.trajectory_sha256,
    )
    if floor is not None and isinstance(case, Narrow):
        poses, tick = make_tracks(moments).poses, task.seconds / len(moments)
        waits = [each.waits for each in moments]
        outcome.too_small = "" if case.shape else why_too_small(case.kind, task.seed, case.robots)
        outcome.stuck = find_stuck(floor, poses, tick, followed, waits, is_line=not case.shape)
    if case is not None and case.speed is not None:
        outcome.share = round(report.robots[0].distance_m / (case.speed * task.seconds), 3)
    return outcome


def _run_here(task: Task, team: str) -> tuple[RunReport, list[Moment]]:
    case, recorder = CASES.get(task.what), Recorder()
    nodes = {NAME: recorder.body}
    if case is not None and case.is_driven:
        nodes[TELEOP] = Driver(0, task.seed).body
    report = run_team(
        team, seconds=task.seconds, seed=task.seed, world=task.world, nodes=nodes, arguments=task.arguments
    )
    return report, recorder.rows()


def _run_processes(task: Task, team: str) -> tuple[RunReport, list[Moment]]:
    case = CASES.get(task.what)
    is_driven = case is not None and case.is_driven
    driver = {TELEOP: [sys.executable, "-P", "-m", Driver.__module__, f"{task.seed}"]} if is_driven else {}
    words = [*(f"{name}={value}" for name, value in task.arguments.items()), "--seed", f"{task.seed}"]
    words += ["--world", task.world] if task.world else []

    def run(*pace: str) -> tuple[RunReport, list[Moment]]:
        return run_processes(find_team(team), task.seconds, [*words, *pace], driver)

    if task.speed is None:
        return run("--lockstep")
    return run_on_time(lambda speed: run("--speed", f"{speed:g}"), lambda found: found[0], task.speed)


def _seconds(task: Task, places: NDArray[np.float64]) -> float:
    return round(longest_stand(places) * task.seconds / len(places), 1)


def distances(
    places: NDArray[np.float64], robots: Sequence[int], followed: Sequence[Mapping[int, int]]
) -> dict[int, list[float]]:
    """Metres to the robot that each one follows, by follower; `places` are (ticks, robots, 2)."""
    # Statuses before the first tick come in real time: until one is there, the first one counts.
    first = {robot: other for row in reversed(followed) for robot, other in row.items()}
    index = {robot: i for i, robot in enumerate(robots)}
    apart: dict[int, list[float]] = {}
    for at, row in zip(places, followed, strict=True):
        for robot, other in sorted({**first, **row}.items()):
            if robot in index and other in index:
                apart.setdefault(robot, []).append(math.dist(at[index[robot]], at[index[other]]))
    return apart


def pairs_of(followed: Sequence[Mapping[int, int]]) -> list[dict[int, int]]:
    """The same pairs of robots tick by tick: the lower id by the higher one, whichever robot follows."""
    return [{max(pair): min(pair) for pair in row.items() if min(pair) >= 0} for row in followed]


def longest_stand(places: NDArray[np.float64]) -> int:
    """Ticks of the longest time in which no robot got MOVED from where it was; `places` are (ticks, robots, 2)."""
    anchors, still, longest = places[0].copy(), 0, 0
    for now in places:
        moved = np.hypot(*(now - anchors).T) > MOVED
        anchors[moved] = now[moved]
        still = 0 if moved.any() else still + 1
        longest = max(longest, still)
    return longest
