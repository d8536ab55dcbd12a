"""One run of a study, in this process: `python -m studies.study.one_run`, with a Task as the line of its input."""

import logging
import math
import os
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.recorder import NAME, Recorder, make_tracks
from studies.study.cases import CASES
from studies.study.driver import Driver
from zteam import names
from zteam.messages import RobotStatus
from zteam.node.node import Node
from zteam.team.in_process.team_run import run_team

HELD = 3.0
"""Metres: a follower is held while the robot that it follows is so near."""
MOVED = 0.05
"""Metres: a robot that has not gone so far stands."""


class Task(msgspec.Struct, frozen=True):
    """What is run: two runs of equal tasks are the same, to the bit."""

    what: str
    """A case by its name, or a team file."""
    seconds: float
    seed: int
    world: str | None = None
    """In the place of the team's own."""
    arguments: dict[str, str] = {}
    """Of a team file."""


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
    still: float = 0.0
    """Longest time in which no robot moved, seconds."""
    share: float | None = None
    """Way of the first robot by its speed times the time; None where the speed is not known."""
    trajectory: str = ""
    """Hash of the way of all robots: a run of the same task has the same one."""


class Row(msgspec.Struct, frozen=True):
    """A line of a file with results."""

    task: Task
    outcome: Outcome


class Followed:
    """Which robot each one follows, by follower, tick by tick. Give its `body` to `run_team` as a node."""

    def __init__(self) -> None:
        self._now: dict[int, int] = {}
        self.rows: list[dict[int, int]] = []

    def body(self, node: Node) -> None:
        """Note it until asked to stop."""
        node.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._take)
        node.run(lambda _now: self.rows.append(self._now.copy()))

    def _take(self, _key: str, status: RobotStatus) -> None:
        self._now[status.robot_id] = status.followed


def measure(task: Task) -> Outcome:
    """Run it. An error of the team is part of the outcome."""
    case, recorder, followed = CASES.get(task.what), Recorder(), Followed()
    nodes = {NAME: recorder.body, "followed": followed.body}
    if case is not None and case.is_driven:
        nodes["teleop"] = Driver(0, task.seed).body
    with tempfile.TemporaryDirectory() as folder:
        team = task.what if case is None else case.team
        if not team and case is not None:
            path = Path(folder) / "team.toml"
            path.write_text(case.team_text())
            team = str(path)
        try:
            report = run_team(
                team, seconds=task.seconds, seed=task.seed, world=task.world, nodes=nodes, arguments=task.arguments
            )
        # Anything that ends a run is a result of the study.
        except (Exception, SystemExit) as error:
            return Outcome(error=f"{type(error).__name__}: {error}"[:200])
    places = make_tracks(recorder.rows()).poses[..., :2]
    apart = distances(places, [robot.id for robot in report.robots], followed.rows[-len(places) :])
    outcome = Outcome(
        driven=[round(robot.distance_m, 1) for robot in report.robots],
        contacts=sum(robot.stalls for robot in report.robots),
        held={i: round(sum(gap < HELD for gap in gaps) / len(gaps), 4) for i, gaps in apart.items()},
        last={i: round(gaps[-1], 1) for i, gaps in apart.items()},
        still=round(longest_stand(places) * task.seconds / len(places), 1),
        trajectory=report.trajectory_sha256,
    )
    if case is not None and case.speed is not None:
        outcome.share = round(report.robots[0].distance_m / (case.speed * task.seconds), 3)
    return outcome


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


def longest_stand(places: NDArray[np.float64]) -> int:
    """Ticks of the longest time in which no robot got MOVED from where it was; `places` are (ticks, robots, 2)."""
    anchors, still, longest = places[0].copy(), 0, 0
    for now in places:
        moved = np.hypot(*(now - anchors).T) > MOVED
        anchors[moved] = now[moved]
        still = 0 if moved.any() else still + 1
        longest = max(longest, still)
    return longest


def _end_with_input() -> None:
    # Not through `sys.stdin`: its lock would be held when the interpreter ends.
    while os.read(0, 1):
        pass
    os._exit(1)


if __name__ == "__main__":
    # A run's warnings, by the thousand, are no part of a study.
    logging.getLogger("zteam").setLevel(logging.ERROR)
    given = msgspec.json.decode(sys.stdin.buffer.readline(), type=Task)
    # Its input ends with the process that asked for it.
    threading.Thread(target=_end_with_input, daemon=True).start()
    sys.stdout.write(msgspec.json.encode(measure(given)).decode())
