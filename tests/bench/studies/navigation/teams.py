"""`zteam-nav` in whole teams, each in this process: tours of one robot, and a crowd with goals at random."""

import math
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import msgspec

from studies.navigation.scene import BEAMS
from zteam import names
from zteam.cli.bench_team import run_processes, write_world
from zteam.counter_random import uniform
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.messages import (
    Bool,
    Header,
    NavigationState,
    NavigationStatus,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    ns_from_time,
)
from zteam.node.node import Node
from zteam.team.run.report import RunReport
from zteam.team.run.run_team import run_team

_ENDS = (NavigationState.SUCCEEDED, NavigationState.ABORTED)
_START = 2.0
"""Simulated seconds after which the first goals are sent."""


class Goals(msgspec.Struct):
    """How the goals of one robot went."""

    robot: int
    reached: int = 0
    aborted: list[str] = []
    """Reasons."""
    recoveries: int = 0
    contacts: int = 0
    """How often it began to touch something that blocked it."""
    errors_m: list[float] = []
    """Metres from each pose that the localiser told to the true one."""


class TeamFigures(msgspec.Struct):
    """A run."""

    robots: list[Goals]
    distance_m: float
    tick_ms: float
    """Mean milliseconds of the navigation process a tick and robot."""
    rtf: float | None


class Sender:
    """A node that gives each robot its next goal when it has reached or given up the last one."""

    def __init__(self, node: Node, goals: Mapping[int, Sequence[Pose2]], found: dict[int, Goals]) -> None:
        self._goals, self._found = goals, found
        self._next = dict.fromkeys(goals, 0)
        self._busy = dict.fromkeys(goals, False)
        self._truths: dict[tuple[int, int], Point] = {}
        self._stalled = dict.fromkeys(goals, False)
        self._publishers = {i: node.publisher(names.robot_key(i, names.GOAL_POSE), PoseStamped) for i in goals}
        node.subscribe(names.all_robots_key(names.NAVIGATION_STATUS), NavigationStatus, self._on_status)
        node.subscribe(names.all_robots_key(names.STALL), Bool, self._on_stall)
        node.subscribe(names.all_robots_key(names.GROUND_TRUTH), Odometry, self._on_truth, every_tick=True)
        node.subscribe(names.all_robots_key(names.AMCL_POSE), PoseWithCovarianceStamped, self._on_pose)

    def _on_status(self, key: str, status: NavigationStatus) -> None:
        robot_id = _id_of(key)
        if robot_id in self._goals and self._busy[robot_id] and status.state in _ENDS:
            if status.goal != self._message(robot_id, self._next[robot_id] - 1):
                return
            self._busy[robot_id] = False
            found = self._found[robot_id]
            found.recoveries += status.recoveries
            if status.state == NavigationState.SUCCEEDED:
                found.reached += 1
            else:
                found.aborted.append(status.text)

    def _on_stall(self, key: str, stall: Bool) -> None:
        robot_id = _id_of(key)
        if robot_id in self._goals:
            self._found[robot_id].contacts += stall.data and not self._stalled[robot_id]
            self._stalled[robot_id] = stall.data

    def _on_truth(self, key: str, truth: Odometry) -> None:
        self._truths[_id_of(key), ns_from_time(truth.header.stamp)] = truth.pose.pose.position

    def _on_pose(self, key: str, told: PoseWithCovarianceStamped) -> None:
        truth = self._truths.get((_id_of(key), ns_from_time(told.header.stamp)))
        if truth is not None:
            place = told.pose.pose.position
            self._found[_id_of(key)].errors_m.append(math.hypot(place.x - truth.x, place.y - truth.y))

    def _message(self, robot_id: int, number: int) -> PoseStamped:
        pose = self._goals[robot_id][number]
        turn = Quaternion(*quaternion_from_yaw(pose.yaw))
        return PoseStamped(Header(frame_id=names.MAP_FRAME), Pose(Point(pose.x, pose.y), turn))

    def step(self, now: int) -> None:
        """Send the goals that are due."""
        if now < _START * 1e9:
            return
        self._truths = {key: place for key, place in self._truths.items() if key[1] >= now - 1_000_000_000}
        for robot_id, goals in self._goals.items():
            if not self._busy[robot_id] and self._next[robot_id] < len(goals):
                self._publishers[robot_id].put(self._message(robot_id, self._next[robot_id]))
                self._next[robot_id] += 1
                self._busy[robot_id] = True


def _id_of(key: str) -> int:
    target = names.split_robot_key(key)
    return -1 if target is None else target[0]


def drive(
    world: Path,
    starts: Mapping[int, Pose2],
    goals: Mapping[int, Sequence[Pose2]],
    seconds: float,
    localizer: str,
    *,
    seed: int = 1,
) -> TeamFigures:
    """Robots that start there and drive to their goals, one after the other, for so many simulated seconds."""
    found = {robot_id: Goals(robot_id) for robot_id in goals}

    def sender(node: Node) -> None:
        node.run(Sender(node, goals, found).step)

    with tempfile.TemporaryDirectory() as folder:
        path = write_team(Path(folder), world, starts, localizer)
        report = run_team(path, seconds=seconds, seed=seed, nodes={"goals": sender})
    return TeamFigures(
        robots=list(found.values()),
        distance_m=sum(robot.distance_m for robot in report.robots),
        tick_ms=report.rounds[names.navigation_name(min(goals))].act / len(goals),
        rtf=report.real_time_factor,
    )


def drive_in_processes(
    world: Path, starts: Mapping[int, Pose2], goals: Mapping[int, Sequence[Pose2]], seconds: float, localizer: str
) -> RunReport:
    """The same with a process for each robot, one for the navigation of all of them, and `zteam goals`."""
    listed = [{"robot": i, "x": p.x, "y": p.y, "yaw": p.yaw} for i, places in goals.items() for p in places]
    with tempfile.TemporaryDirectory() as folder:
        path = write_team(Path(folder), world, starts, localizer)
        file = path.with_name("goals.json")
        # JSON is YAML.
        file.write_bytes(msgspec.json.encode(listed))
        command = ["zteam", "goals", str(file)]
        with path.open("a", encoding="utf-8") as team:
            team.write(f'[[nodes]]\nname = "goals"\ncommand = {command}\nexpect = true\n')
        return run_processes([str(path), "--lockstep", "--for", str(seconds)], Path(folder), world, seconds)


def write_team(folder: Path, world: Path, starts: Mapping[int, Pose2], localizer: str) -> Path:
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


def draw_goals(places: Sequence[Pose2], count: int, seed: int, robot_id: int) -> list[Pose2]:
    """`count` of these places in an order that the seed gives, with any heading."""
    chosen: Iterable[int] = (int(uniform(seed, robot_id, k) * len(places)) for k in range(count))
    return [places[i]._replace(yaw=math.tau * uniform(seed, robot_id, k, 1) - math.pi) for k, i in enumerate(chosen)]
