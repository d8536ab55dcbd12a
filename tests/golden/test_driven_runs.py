"""Runs of the shipped behaviours on a flat floor, each with the safety layer, come out as they were recorded.

A behaviour that is meant to drive otherwise changes numbers here: check the drive, then record what the failure shows.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import msgspec
import pytest

from support.flat_floor import Segment, box, clearance
from support.goals import make_goal
from support.team_floor import GAP, Commanded, TeamFloor, follower, line
from zteam.behaviors import Behavior, View, load_behavior
from zteam.geometry import Pose2
from zteam.messages import PoseStamped, Twist


class Led(Behavior):
    """A robot of a line that commands drive while it leads, or from a tick on as by hand; else its behaviour."""

    def __init__(self, behavior: Behavior, commands: Commanded, by_hand: range | None = None) -> None:
        super().__init__(None)
        self._inner, self._commands, self._by_hand = behavior, commands, by_hand
        self.leader, self.gap, self.told, self._ticks = behavior.leader, behavior.gap, 0, 0
        """`told`: `turns` that it tells; it hands over where that is raised."""

    def step(self, view: View) -> Twist:
        """The next command, or that of its behaviour."""
        command, self._ticks = self._inner.step(view), self._ticks + 1
        self.uses_tf, self.follows, self.reason = self._inner.uses_tf, self._inner.follows, self._inner.reason
        self.turns = max(self._inner.turns, self.told)
        leads = self.follows is None if self._by_hand is None else self._ticks in self._by_hand
        return self._commands.step(view) if leads else command


class Run(NamedTuple):
    """What is driven."""

    robots: list[tuple[Pose2, Behavior]]
    ticks: int
    walls: Sequence[Segment] = ()
    events: Mapping[int, Callable[[TeamFloor], None]] = MappingProxyType({})
    """What happens before a tick."""
    delay: int = 0
    """Ticks by which transforms are late."""
    ways: Sequence[tuple[float, float, float]] = ()
    """Recorded for each robot: the mean x and y of its places, and metres driven."""
    said: str = ""
    """Recorded: all reasons, sorted."""


def at(x: float, y: float, yaw: float, name: str, **params: Any) -> tuple[Pose2, Behavior]:
    """A robot that runs a shipped behaviour without others."""
    return Pose2(x, y, yaw), load_behavior(name, params)


def on_x(x: float, behavior: Behavior, y: float = 0.0) -> tuple[Pose2, Behavior]:
    """A robot that looks along x."""
    return Pose2(x, y, 0.0), behavior


def formation(robots: int, shape: str, y: float = 0.0) -> list[tuple[Pose2, Behavior]]:
    """Robots behind robot 0."""
    params = {"leader": 0, "spacing": GAP, "shape": shape}
    return [on_x(-GAP * i, load_behavior("formation", params, i), y) for i in range(1, robots)]


def set_params(robot: int, **params: Any) -> Callable[[TeamFloor], None]:
    """Change parameters as `zteam param set` does."""

    def change(floor: TeamFloor) -> None:
        behavior = floor.team[robot]
        behavior.params = msgspec.structs.replace(behavior.params, **params)
        behavior.on_params()

    return change


def place(robot: int, pose: Pose2) -> Callable[[TeamFloor], None]:
    """Set a robot down elsewhere."""
    return lambda floor: floor.place(robot, pose)


def lose(robot: int) -> Callable[[TeamFloor], None]:
    """A robot's process ends."""
    return lambda floor: floor.gone.add(robot)


def send(robot: int, goal: PoseStamped) -> Callable[[TeamFloor], None]:
    """A goal comes."""
    return lambda floor: floor.goals.update({robot: goal})


def hand_over(floor: TeamFloor) -> None:
    """The head of a led line says so."""
    head = floor.team[0]
    assert isinstance(head, Led)
    head.told = 1


def corridor(width: float, x0: float, x1: float, *, closed: bool = False) -> list[Segment]:
    """Two walls along x, and perhaps one across its end."""
    half = 0.5 * width
    return [(x0, -half, x1, -half), (x0, half, x1, half), *([(x1, -half, x1, half)] if closed else [])]


BEND = 0.5 / 0.6
QUARTER = math.pi / 2
AWAY = (0.0, QUARTER, 10), (0.5, 0.0, 22), (0.0, -QUARTER, 10), (0.5, 0.0, 40)
POCKET = [*box(2.0, -1.5, 2.2, 1.5), *box(0.0, 1.5, 2.2, 1.7), *box(0.0, -1.7, 2.2, -1.5)]
NARROW: list[Segment] = [(-0.1, 0.21, 0.4, 0.21), (-0.1, -0.21, 0.4, -0.21), (0.4, -0.21, 0.4, 0.21)]

RUNS: dict[str, Callable[[], Run]] = {
    "a line keeps to the way of its head through two bends, with late poses": lambda: Run(
        line(Commanded((0.5, 0.0, 40), (0.5, BEND, 19), (0.5, 0.0, 30), (0.5, -BEND, 19), (0.5, 0.0, 20)), 4), 130,
        delay=2,
        ways=[(2.309, 1.18, 6.399), (1.746, 0.829, 6.49), (1.171, 0.484, 6.51), (0.556, 0.214, 6.352)],
    ),
    "it makes room for a head that backs up, the last robot first": lambda: Run(
        line(Commanded((0.3, 0.0, 20), (-0.3, 0.0, 80)), 3), 110, corridor(1.2, -8.0, 3.0),
        ways=[(-0.016, 0.0, 1.954), (-0.781, 0.0, 2.159), (-1.538, 0.0, 2.106)],
        said="it cannot see behind; makes room for robot_0; makes room for robot_1; robot_1 behind; robot_2 behind",
    ),
    "it makes room for a head that turns round": lambda: Run(
        line(Commanded((0.0, 1.0, 31), (0.3, 0.0, 100)), 3), 130, corridor(1.2, -8.0, 3.0),
        ways=[(-0.858, 0.036, 2.114), (-1.546, 0.0, 1.932), (-2.297, 0.0, 1.88)],
        said="makes room for robot_0; makes room for robot_1; robot_1 ahead; robot_2 behind",
    ),
    "it makes room for a head that drives a circle into it": lambda: Run(
        line(Commanded((0.5, 0.0, 20), (0.5, 0.5, 130)), 4), 115,
        ways=[(1.08, 1.004, 5.75), (0.989, 0.817, 5.743), (0.708, 0.553, 5.743), (0.203, 0.287, 5.742)],
    ),
    "a robot drives round a head that faces it": lambda: Run(
        [(Pose2(0.0, 0.0, math.pi), Commanded()), (Pose2(-1.1, 0.1, 0.0), follower(1))], 70,
        ways=[(0.0, 0.0, 0.0), (-0.804, 0.239, 2.079)],
        said="drives round robot_0; it cannot see ahead; it cannot see behind",
    ),
    "a robot that comes late finds its place": lambda: Run(
        [*line(Commanded((0.3, 0.0, 90)), 2), (Pose2(1.0, -2.0, 1.0), follower(2))], 95,
        ways=[(1.435, 0.0, 2.7), (0.577, 0.0, 2.73), (0.249, -0.483, 4.481)], said="waits for robot_2 behind it",
    ),
    "the place counts from the head, and the robot in front hangs back": lambda: Run(
        [on_x(0.0, Commanded()), on_x(-0.8, Commanded(leader=0)), on_x(-3.0, follower(2), 0.3)], 48,
        ways=[(0.0, 0.0, 0.0), (-0.8, 0.0, 0.0), (-1.968, 0.161, 1.393)],
    ),
    "a new gap and a new law hold at once": lambda: Run(
        line(Commanded((0.4, 0.0, 100)), 2), 110, [], {40: set_params(1, gap=1.2), 90: set_params(1, law="direct")},
        ways=[(2.2, 0.0, 4.0), (1.214, 0.0, 4.006)],
    ),
    "a line that is led from its other end goes back over its own way": lambda: Run(
        [
            on_x(0.0, Led(load_behavior("wander", {}, 0), Commanded((0.5, 0.0, 40), (0.5, BEND, 19)))),
            on_x(-GAP, follower(1)),
            on_x(-2 * GAP, Led(follower(2), Commanded((0.0, QUARTER, 20), (0.0, 0.0, 10), (0.4, 0.0, 60)))),
        ],
        150, [], {59: hand_over},
        ways=[(1.676, 0.141, 5.522), (0.926, 0.018, 5.381), (0.128, 0.0, 5.176)],
    ),
    "a robot behind a wall goes back over its own way": lambda: Run(
        [
            on_x(0.0, Commanded((0.4, 0.0, 140))),
            on_x(-GAP, Led(follower(1), Commanded(*AWAY), range(40, 122))),
        ],
        320, [(1.6, 0.55, 40.0, 0.55)],
        ways=[(4.384, 0.0, 5.6), (1.983, 0.53, 11.565)], said="is stuck: leaves its way",
    ),
    "a robot that is gone is passed": lambda: Run(
        [on_x(0.0, Commanded((0.3, 0.0, 60))), on_x(-0.8, Commanded(leader=0), 0.05), on_x(-1.6, follower(2))],
        66, [], {2: lose(1)},
        ways=[(0.995, 0.0, 1.8), (-0.8, 0.05, 0.0), (-0.266, -0.27, 3.108)],
    ),
    "a head that is gone is passed by the next one, which leads": lambda: Run(
        line(Commanded((0.3, 0.0, 20)), 3, on_leader_lost="takeover", takeover_behavior="forward"), 120,
        [], {25: lose(0)},
        ways=[(0.553, 0.0, 0.6), (1.138, 0.176, 4.378), (0.398, 0.208, 4.303)],
    ),
    "a line hands over in a dead end and gets out": lambda: Run(
        line(load_behavior("wander", {}, 0), 3, 3.0), 300, corridor(1.4, 0.0, 4.0, closed=True),
        ways=[(0.805, 0.662, 8.553), (0.2, 0.887, 8.597), (-0.424, 1.102, 8.818)],
        said="hands over to the other end of the line; makes room for robot_1; robot_1 ahead",
    ),
    "a head that was set down behind its line is followed by the last robot": lambda: Run(
        [(Pose2(-2.8, 0.6, math.pi), Commanded((0.3, 0.0, 60))), *line(Commanded(), 4)[1:]], 66,
        ways=[(-3.795, 0.6, 1.8), (-1.396, 0.211, 1.54), (-2.148, 0.343, 1.657), (-3.046, 0.461, 1.752)],
        said="robot_2 ahead",
    ),
    "a robot that was passed passes again": lambda: Run(
        line(load_behavior("wander", {}, 0), 3), 200, [], {60: place(1, Pose2(-1.9, 0.3, 0.0))},
        ways=[(0.336, 1.819, 2.9), (0.087, 0.208, 5.411), (-0.021, 0.48, 2.81)],
        said="robot_2 ahead; waits for robot_1 behind it",
    ),
    "a line of four by the lectures' law stands before a wall": lambda: Run(
        [
            at(6.5, 18.5, 0.0, "avoid", speed=0.3),
            *((pose, follower(i, law="direct")) for i, pose in enumerate(
                (Pose2(4.25, 18.5, 0.0), Pose2(6.5, 16.5, 0.0), Pose2(4.25, 16.5, 0.0)), 1
            )),
        ],
        103, [(9.8, 10.0, 9.8, 25.0)], delay=1,
        ways=[(8.041, 18.5, 2.765), (6.977, 18.5, 4.26), (6.667, 17.973, 3.63), (5.943, 17.508, 3.651)],
        said="obstacle ahead",
    ),
    "a follower goes round what stands between": lambda: Run(
        [at(3.0, 0.4, 0.0, "idle"), on_x(0.0, follower(1, law="direct")), at(1.0, -0.8, 0.0, "idle")], 150,
        [(1.5, -0.6, 1.5, 4.0)],
        ways=[(3.0, 0.4, 0.0), (1.132, 0.885, 7.304), (1.0, -0.8, 0.0)],
    ),
    "a formation makes way for a leader that turns in a dead end": lambda: Run(
        [on_x(0.0, Commanded((0.0, 1.0, 120))), *formation(3, "column")], 120, box(-12.0, -0.9, 1.0, 0.9),
        ways=[(0.0, 0.0, 0.0), (-1.305, -0.151, 2.006), (-2.052, 0.235, 1.658)],
        said="boxed in: leaves its way to its slot; in its slot; leader robot_0 stands; makes way: robot_0 turns back",
    ),
    "a formation goes round a bend, is squeezed by a doorway and opens again": lambda: Run(
        [on_x(0.0, Commanded((0.3, 0.3, 50), (0.3, -0.3, 50), (0.3, 0.0, 50))), *formation(3, "line", 0.4)], 200,
        [(2.0, 0.3, 2.0, -3.0), (2.0, 2.1, 2.0, 5.0)],
        ways=[(2.067, 1.399, 4.5), (1.427, 1.381, 5.292), (0.849, 0.8, 5.576)],
        said="in its slot; leader robot_0 stands; robot_0 ahead",
    ),
    "a robot of a formation comes along the trail round a corner, and out of a pocket": lambda: Run(
        [
            on_x(0.8, Commanded((0.4, 0.0, 30), (0.0, QUARTER, 10), (0.4, 0.0, 60)), -0.5),
            on_x(0.0, load_behavior("formation", {"leader": 0, "shape": "column", "max_linear": 0.5}, 1)),
        ],
        480, [*NARROW, (1.0, 0.6, 1.0, 6.0)],
        ways=[(1.964, 1.552, 3.6), (0.449, 0.35, 4.354)],
        said="boxed in: leaves its way to its slot; in its slot; leader robot_0 stands; is stuck: leaves its way; "
        "it cannot see ahead; it cannot see behind; obstacle ahead; obstacle beside",
    ),
    "go_to leaves a dead end": lambda: Run(
        [at(0, 0, 0, "go_to")], 289, POCKET, {1: send(0, make_goal(4.0, 0.3))},
        ways=[(1.382, 1.174, 9.397)], said="goal reached",
    ),
    "go_to finds a door, and another goal on the way": lambda: Run(
        [at(0, 0, 0, "go_to")], 323, [*box(-3.0, -3.0, 6.0, 3.0), *box(2.0, -3.0, 2.1, 1.0), *box(2.0, 1.9, 2.1, 3.0)],
        {1: send(0, make_goal(-1.0, -1.0)), 30: send(0, make_goal(4.5, -1.5, 1.0))},
        ways=[(1.997, -0.17, 7.693)], said="goal reached",
    ),
    "go_to gives up a goal without a way": lambda: Run(
        [at(0, 0, 0, "go_to", speed=0.8)], 203, box(2.0, -1.0, 4.0, 1.0), {1: send(0, make_goal(3.0, 0.0))},
        ways=[(2.628, 0.042, 12.249)], said="no way to the goal found: it went all round what stands between",
    ),
    "go_to backs out of a pocket": lambda: Run(
        [at(0, 0, 0, "go_to")], 150, NARROW, {1: send(0, make_goal(-2.0, 0.5))},
        ways=[(-0.274, -0.13, 0.84)], said="it cannot see ahead; it cannot see behind; obstacle beside",
    ),
    "wander gets about a room with a pillar": lambda: Run(
        [at(1.0, 1.0, 0.0, "wander", speed=0.8)], 260, box(0.0, 0.0, 6.0, 5.0) + box(2.5, 2.0, 3.2, 2.8),
        ways=[(3.299, 1.252, 14.32)],
    ),
    "wander finds out of a dead end": lambda: Run(
        [at(0.6, 0.0, math.pi, "wander")], 200, [*corridor(0.9, 0.0, 3.0), (0.0, -0.45, 0.0, 0.45)],
        ways=[(1.714, -0.032, 4.2)],
    ),
    "path drives there and back, and joins at the nearest place": lambda: Run(
        [at(0.6, 0.3, 0.0, "path", waypoints=[[0, 0], [2, 0], [2, 1], [2, 0], [0, 0]])], 136,
        ways=[(1.392, 0.228, 4.99)], said="end of the path",
    ),
    "path goes round and round": lambda: Run(
        [at(0, 0, 0, "path", waypoints=[[0, 0], [1.5, 0], [1.5, 1.5], [0, 1.5]], loop=True, speed=0.8)], 130,
        ways=[(0.828, 0.589, 7.736)],
    ),
}  # fmt: skip
"""By what they show."""


def drive(run: Run) -> tuple[list[tuple[float, float, float]], str]:
    """What is recorded of a run; no robot comes too near to a wall or to another one."""
    floor, said = TeamFloor(run.robots, run.walls, delay=run.delay), set[str]()
    sums = [[0.0, 0.0, 0.0] for _ in run.robots]
    for tick in range(1, run.ticks + 1):
        if tick in run.events:
            run.events[tick](floor)
        before = floor.poses
        floor.tick()
        said.update(reason for _, reason in floor.commands)
        for i, (last, pose) in enumerate(zip(before, floor.poses, strict=True)):
            sums[i] = [sums[i][0] + pose.x, sums[i][1] + pose.y, sums[i][2] + math.dist(last[:2], pose[:2])]
            assert clearance(pose, run.walls) > 0.17
            assert all(math.dist(pose[:2], other[:2]) > 0.4 for other in floor.poses[:i])
    ways = [(round(x / run.ticks, 3), round(y / run.ticks, 3), round(way, 3)) for x, y, way in sums]
    return ways, "; ".join(sorted(said - {""}))


@pytest.mark.parametrize("name", RUNS)
def test_a_run_is_as_it_was_recorded(name: str) -> None:
    """All robots drive the same way to the millimetre, and say the same."""
    run = RUNS[name]()
    assert drive(run) == ([pytest.approx(way, abs=2e-3) for way in run.ways], run.said)
