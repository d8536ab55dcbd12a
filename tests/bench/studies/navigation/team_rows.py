"""Rows of the study `nav` with whole teams: tours of one robot, a crowd, and what navigation costs."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from studies.navigation.row import NavFigure, Progress
from studies.navigation.scene import costmap_of, find_map, find_ways, make_robot, outline_of
from studies.navigation.teams import Goals, draw_goals, drive, drive_in_processes
from zteam import names
from zteam.geometry import Pose2
from zteam.world import World

_CELL = 0.05
"""Metres of a cell of the map in which goals are sought."""
_SLOWEST, _SPARE = 0.3, 100.0
"""A tour of d metres lasts d / _SLOWEST + _SPARE simulated seconds at most: the robots' greatest speed is 0.5 m/s."""
_PLACES = 40
_APART = 2.0
"""Metres between two robots at the start, at least."""
_CROWD, _CROWD_SECONDS = 8, 600.0
_ROBOT_SECONDS = 120.0
_FLEET, _FLEET_SECONDS = 20, 30.0


def _tours(localizer: str, share: float) -> "TeamRow":
    def measure(path: Path, world: World, tours: int, progress: Progress) -> Iterator[NavFigure]:
        costmap = costmap_of(find_map(world, _CELL), outline_of(make_robot(world, Pose2(0.0, 0.0, 0.0))))
        goals: list[Goals] = []
        for number, way in enumerate(find_ways(costmap, tours, 25.0, 60.0), 1):
            progress(f"team-{localizer}", number, tours)
            seconds = way.plan.length / _SLOWEST + _SPARE
            goals += drive(path, {0: way.start}, {0: [way.goal]}, seconds, localizer, seed=number).robots
        recoveries = f"{sum(robot.recoveries for robot in goals)} recoveries"
        what = f"{tours} tours with {localizer}"
        yield NavFigure(
            f"{what}: goals reached", sum(robot.reached for robot in goals) / tours, "share", share,
            _join(recoveries, _reasons(goals)),
        )  # fmt: skip
        yield NavFigure(f"{what}: contacts", sum(robot.contacts for robot in goals), "", 0.0)
        errors = [error for robot in goals for error in robot.errors_m]
        if localizer == "amcl" and errors:
            told = f"{len(errors)} poses told"
            yield NavFigure(f"{what}: error, median", float(np.median(errors)), "m", 0.12, told)
            detail = f"max {max(errors):.2f}"
            yield NavFigure(f"{what}: error, 95 %", float(np.percentile(errors, 95)), "m", 0.30, detail)

    return measure


def _crowd(path: Path, world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    progress("crowd", 1, 1)
    places = _find_places(world)
    starts = dict(enumerate(_choose_apart(places, _CROWD)))
    goals = {i: draw_goals(places, 100, 1, i) for i in starts}
    found = drive(path, starts, goals, _CROWD_SECONDS, "fake")
    what = f"{_CROWD} robots for {_CROWD_SECONDS:g} s"
    yield NavFigure(f"{what}: contacts", sum(robot.contacts for robot in found.robots), "", 0.0)
    reached = sum(robot.reached for robot in found.robots)
    yield NavFigure(f"{what}: goals reached", reached, "", None, f"{found.distance_m:.0f} m driven")
    given_up = sum(len(robot.aborted) for robot in found.robots)
    recoveries = f"{sum(robot.recoveries for robot in found.robots)} recoveries"
    yield NavFigure(f"{what}: goals given up", given_up, "", None, _join(recoveries, _reasons(found.robots)))


def _robot(path: Path, world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    progress("robot", 1, 1)
    places = _find_places(world)
    found = drive(path, {0: places[0]}, {0: draw_goals(places[1:], 20, 1, 0)}, _ROBOT_SECONDS, "amcl")
    detail = f"amcl, {found.distance_m:.0f} m in {_ROBOT_SECONDS:g} s at 10 Hz, 1081 beams"
    yield NavFigure("one robot, mean of a tick", found.tick_ms, "ms", 5.0, detail)


def _fleet(path: Path, world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    places = _find_places(world)
    starts = _choose_apart(places, _FLEET)
    for step, count in enumerate((1, _FLEET), 1):
        progress("fleet", step, 2)
        poses = dict(enumerate(starts[:count]))
        goals = {i: draw_goals(places, 20, 1, i) for i in poses}
        report = drive_in_processes(path, poses, goals, _FLEET_SECONDS, "amcl")
        name = names.navigation_name(0)
        navigation = next(process for process in report.processes if process.name == name)
        robots = "one robot" if count == 1 else f"{count} robots"
        if count > 1:
            act = report.rounds[name].act
            detail = (
                f"lock-step, amcl; a tick of navigation {act:.1f} ms; {sum(r.distance_m for r in report.robots):.0f} m"
            )
            yield NavFigure(f"{robots}: x real time", report.real_time_factor or 0.0, "", 1.0, detail)
        must = 250.0 if count == 1 else 500.0
        detail = f"PSS {navigation.pss_mb:g} MB"
        yield NavFigure(f"{robots}: memory of the navigation process", navigation.rss_mb, "MB", must, detail)


def _find_places(world: World) -> list[Pose2]:
    costmap = costmap_of(find_map(world, _CELL), outline_of(make_robot(world, Pose2(0.0, 0.0, 0.0))))
    return [pose for way in find_ways(costmap, _PLACES // 2, 15.0) for pose in (way.start, way.goal)]


def _choose_apart(places: Sequence[Pose2], count: int) -> list[Pose2]:
    """The first `count` places that are _APART from those before."""
    chosen: list[Pose2] = []
    for place in places:
        if len(chosen) < count and all(math.dist(place[:2], other[:2]) >= _APART for other in chosen):
            chosen.append(place)
    return chosen


def _reasons(goals: Sequence[Goals]) -> str:
    """Why robots gave up, each reason once."""
    return "; ".join(dict.fromkeys(f"robot {robot.robot}: {text}" for robot in goals for text in robot.aborted))


def _join(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


TeamRow = Callable[[Path, World, int, Progress], Iterator[NavFigure]]
TEAM_ROWS: dict[str, TeamRow] = {
    "team-fake": _tours("fake", 1.0),
    "team-amcl": _tours("amcl", 29 / 30),
    "crowd": _crowd,
    "robot": _robot,
    "fleet": _fleet,
}
