"""Rows of the study `nav` with whole teams: tours of one robot, a crowd, and what navigation costs."""

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import msgspec
import numpy as np

from studies.navigation.scene import BEAMS, NavFigure, Progress, costmap_of, find_map, find_ways, make_robot, outline_of
from zteam import names
from zteam.cli.bench import run_processes, write_world
from zteam.clock import NS_PER_S
from zteam.counter_random import uniform
from zteam.geometry import Pose2
from zteam.messages import Odometry, Point, PoseWithCovarianceStamped, ns_from_time
from zteam.navigation.client import GoalWatch, NavigationClient, TaskResult, goal_message
from zteam.node.node import Node
from zteam.team.run.report import RunReport
from zteam.team.run.run_team import run_team
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

_START = 2 * NS_PER_S
"""Simulated time after which the first goals are sent."""

Goals = Mapping[int, Sequence[Pose2]]
"""By robot, one after the other."""


class _Drive:
    """A run in this process, and how the goals of all its robots went."""

    def __init__(
        self, world: Path, starts: Mapping[int, Pose2], goals: Goals, seconds: float, localizer: str, seed: int = 1
    ) -> None:
        self.reached = self.recoveries = 0
        self.given_up: list[str] = []
        """Why, for each goal."""
        self.errors: list[float] = []
        """Metres from each pose that a localiser reported to the true one."""
        self._goals, self._truths = goals, dict[tuple[str, int], Point]()
        with tempfile.TemporaryDirectory() as folder:
            path = _write_team(Path(folder), world, starts, localizer)
            self.report = run_team(path, seconds=seconds, seed=seed, nodes={"goals": self._send_goals})
        self.contacts = sum(robot.stalls for robot in self.report.robots)
        self.distance = sum(robot.distance_m for robot in self.report.robots)

    def _send_goals(self, node: Node) -> None:
        clients = {i: NavigationClient(node, i, node.clock.now) for i in self._goals}
        left = {i: iter(poses) for i, poses in self._goals.items()}
        watches: dict[int, GoalWatch] = {}
        node.subscribe(names.all_robots_key(names.GROUND_TRUTH), Odometry, self._on_truth, every_tick=True)
        node.subscribe(names.all_robots_key(names.AMCL_POSE), PoseWithCovarianceStamped, self._on_pose)

        def step(now: int) -> None:
            self._truths = {key: place for key, place in self._truths.items() if key[1] >= now - NS_PER_S}
            for robot_id, client in clients.items() if now >= _START else ():
                client.look()
                watch = watches.get(robot_id)
                if watch is not None and not watch.ended:
                    continue
                if watch is not None:
                    self._take_end(robot_id, watches.pop(robot_id))
                if (pose := next(left[robot_id], None)) is not None:
                    watches[robot_id] = client.send(goal_message(pose))

        node.run(step)

    def _take_end(self, robot_id: int, watch: GoalWatch) -> None:
        self.recoveries += watch.status.recoveries if watch.status is not None else 0
        if watch.result == TaskResult.SUCCEEDED:
            self.reached += 1
        else:
            self.given_up.append(f"robot {robot_id}: {watch.text}")

    def _on_truth(self, key: str, truth: Odometry) -> None:
        self._truths[key.partition("/")[0], ns_from_time(truth.header.stamp)] = truth.pose.pose.position

    def _on_pose(self, key: str, told: PoseWithCovarianceStamped) -> None:
        truth = self._truths.get((key.partition("/")[0], ns_from_time(told.header.stamp)))
        if truth is not None:
            place = told.pose.pose.position
            self.errors.append(math.hypot(place.x - truth.x, place.y - truth.y))


def _tours(localizer: str, share: float) -> "TeamRow":
    def measure(path: Path, world: World, tours: int, progress: Progress) -> Iterator[NavFigure]:
        costmap = costmap_of(find_map(world, _CELL), outline_of(make_robot(world, Pose2(0.0, 0.0, 0.0))))
        drives: list[_Drive] = []
        for number, way in enumerate(find_ways(costmap, tours, 25.0, 60.0), 1):
            progress(f"team-{localizer}", number, tours)
            seconds = way.plan.length / _SLOWEST + _SPARE
            drives.append(_Drive(path, {0: way.start}, {0: [way.goal]}, seconds, localizer, number))
        what, reached = f"{tours} tours with {localizer}", sum(drive.reached for drive in drives)
        yield NavFigure(f"{what}: goals reached", reached / tours, "share", share, _troubles(drives))
        yield NavFigure(f"{what}: contacts", sum(drive.contacts for drive in drives), "", 0.0)
        errors = [error for drive in drives for error in drive.errors]
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
    goals = {i: _draw_goals(places, 100, i) for i in starts}
    found = _Drive(path, starts, goals, _CROWD_SECONDS, "fake")
    what = f"{_CROWD} robots for {_CROWD_SECONDS:g} s"
    yield NavFigure(f"{what}: contacts", found.contacts, "", 0.0)
    yield NavFigure(f"{what}: goals reached", found.reached, "", None, f"{found.distance:.0f} m driven")
    yield NavFigure(f"{what}: goals given up", len(found.given_up), "", None, _troubles([found]))


def _robot(path: Path, world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    progress("robot", 1, 1)
    places = _find_places(world)
    found = _Drive(path, {0: places[0]}, {0: _draw_goals(places[1:], 20, 0)}, _ROBOT_SECONDS, "amcl")
    tick_ms = found.report.rounds[names.navigation_name(0)].act
    detail = f"amcl, {found.distance:.0f} m in {_ROBOT_SECONDS:g} s at 10 Hz, 1081 beams"
    yield NavFigure("one robot, mean of a tick", tick_ms, "ms", 5.0, detail)


def _fleet(path: Path, world: World, _tours: int, progress: Progress) -> Iterator[NavFigure]:
    places = _find_places(world)
    starts = _choose_apart(places, _FLEET)
    for step, count in enumerate((1, _FLEET), 1):
        progress("fleet", step, 2)
        poses = dict(enumerate(starts[:count]))
        report = _drive_in_processes(path, poses, {i: _draw_goals(places, 20, i) for i in poses})
        name = names.navigation_name(0)
        navigation = next(process for process in report.processes if process.name == name)
        robots = "one robot" if count == 1 else f"{count} robots"
        if count > 1:
            act, driven = report.rounds[name].act, sum(robot.distance_m for robot in report.robots)
            detail = f"lock-step, amcl; a tick of navigation {act:.1f} ms; {driven:.0f} m"
            yield NavFigure(f"{robots}: x real time", report.real_time_factor or 0.0, "", 1.0, detail)
        must = 250.0 if count == 1 else 500.0
        detail = f"PSS {navigation.pss_mb:g} MB"
        yield NavFigure(f"{robots}: memory of the navigation process", navigation.rss_mb, "MB", must, detail)


def _drive_in_processes(world: Path, starts: Mapping[int, Pose2], goals: Goals) -> RunReport:
    """With a process for each robot, one for the navigation of all of them, and `zteam goals`."""
    listed = [{"robot": i, "x": p.x, "y": p.y, "yaw": p.yaw} for i, places in goals.items() for p in places]
    with tempfile.TemporaryDirectory() as folder:
        path = _write_team(Path(folder), world, starts, "amcl")
        file = path.with_name("goals.json")
        # JSON is YAML.
        file.write_bytes(msgspec.json.encode(listed))
        command = ["zteam", "goals", str(file)]
        with path.open("a", encoding="utf-8") as team:
            team.write(f'[[nodes]]\nname = "goals"\ncommand = {command}\nexpect = true\n')
        words = [str(path), "--lockstep", "--for", str(_FLEET_SECONDS)]
        return run_processes(words, Path(folder), world, _FLEET_SECONDS)


def _write_team(folder: Path, world: Path, starts: Mapping[int, Pose2], localizer: str) -> Path:
    """A team file in `folder`: robots with the lectures' laser there, whose odometry errs by alphas of 0.2."""
    write_world(world, BEAMS, folder / "bench.world")
    lines = ["[team]", 'world = "bench.world"', "world_robots = false", "[simulation]"]
    lines.append("odom_alphas = [0.2, 0.2, 0.2, 0.2]")
    for robot_id, pose in starts.items():
        lines += ["[[robots]]", f"id = {robot_id}", 'model = "bench_robot"']
        lines += [f"pose = [{pose.x}, {pose.y}, {pose.yaw}]", f'navigation = {{ localizer = "{localizer}" }}']
    path = folder / "team.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


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


def _draw_goals(places: Sequence[Pose2], count: int, robot_id: int) -> list[Pose2]:
    """`count` of these places in a drawn order, with any heading."""
    chosen: Iterable[int] = (int(uniform(1, robot_id, k) * len(places)) for k in range(count))
    return [places[i]._replace(yaw=math.tau * uniform(1, robot_id, k, 1) - math.pi) for k, i in enumerate(chosen)]


def _troubles(drives: Sequence[_Drive]) -> str:
    """How often robots recovered, and why they gave up, each reason once."""
    recoveries = f"{sum(drive.recoveries for drive in drives)} recoveries"
    return "; ".join(dict.fromkeys([recoveries, *(text for drive in drives for text in drive.given_up)]))


TeamRow = Callable[[Path, World, int, Progress], Iterator[NavFigure]]
TEAM_ROWS: dict[str, TeamRow] = {
    "team-fake": _tours("fake", 1.0),
    "team-amcl": _tours("amcl", 29 / 30),
    "crowd": _crowd,
    "robot": _robot,
    "fleet": _fleet,
}
