"""trail: no corners cut, no error that grows along the line, no collision, and a line that is led from either end."""

import math
from collections.abc import Sequence
from itertools import combinations, pairwise

import msgspec
import pytest

from support.flat_floor import Floor, Segment, clearance
from zteam.behaviors import Behavior, View, load_behavior
from zteam.geometry import Pose2
from zteam.messages import RobotDriver, RobotStatus, Twist, Vector3
from zteam.messages.base import Base
from zteam.reasons import Reason
from zteam.robot.behaviors.line import NO_TURNS
from zteam.robot.behaviors.polyline import Polyline

GAP = 0.8
BEND = 0.6
"""Metres."""
CORNERS = (
    [(0.5, 0.0)] * 60 + [(0.5, 0.5 / BEND)] * 19 + [(0.5, 0.0)] * 40 + [(0.5, -0.5 / BEND)] * 19 + [(0.5, 0.0)] * 60
)
"""A bend to the left and one to the right."""


class Chain(Floor):
    """Robots that know each other's statuses, one tick old, and which of them are alive."""

    def __init__(self, poses: Sequence[Pose2], walls: Sequence[Segment] = (), seed: int = 1, delay: int = 0) -> None:
        super().__init__(poses, walls, seed, delay)
        self.gone: set[int] = set()
        self._statuses = {
            i: RobotStatus(
                robot_id=i, behavior="follow" if i else "path", driver=RobotDriver.BEHAVIOR, leader=i - 1, gap=0.8
            )
            for i in range(len(poses))
        }

    def step(self, behaviors: Sequence[Behavior]) -> None:
        """One tick; then each robot tells what it follows, and how often its line was turned."""
        super().step(behaviors)
        for i, behavior in enumerate(behaviors):
            follows, reason = -1 if behavior.follows is None else behavior.follows, Reason.of(self.commands[i][1])
            self._statuses[i] = msgspec.structs.replace(
                self._statuses[i],
                follows=follows,
                turns=behavior.turns,
                reason=str(reason),
                waits_for=reason.waits_for,
                blocked_by=reason.blocked_by,
            )

    def waits(self, robot_id: int, other: int) -> None:
        """A robot says that it waits for another one, heard in the next tick."""
        self._statuses[robot_id] = msgspec.structs.replace(self._statuses[robot_id], waits_for=other)

    def view(self, robot_id: int) -> View:
        """With the statuses of all robots; the bases of those that are gone stay known."""
        team = tuple(set(self._statuses) - self.gone)
        changes = {"inputs": {"statuses": dict(self._statuses)}, "team": team}
        return msgspec.structs.replace(super().view(robot_id), bases=dict.fromkeys(self._statuses, Base()), **changes)


class Commanded(Behavior):
    """A leader with a list of commands, one a tick; then it stands."""

    def __init__(self, commands: Sequence[tuple[float, float]]) -> None:
        super().__init__(None)
        self._commands = iter(commands)

    def step(self, view: View) -> Twist:
        """The next command."""
        speed, turn = next(self._commands, (0.0, 0.0))
        return Twist(Vector3(speed), Vector3(z=turn))


class Led(Behavior):
    """A robot of a line that drives by a list of commands while it leads, and else as its behaviour does."""

    def __init__(self, behavior: Behavior, commands: Sequence[tuple[float, float]]) -> None:
        super().__init__(None)
        self._inner, self._commands = behavior, Commanded(commands)
        self.leader, self.turns = behavior.leader, 0
        self.told = 0
        """`turns` that it tells: it hands over where that is raised."""

    def step(self, view: View) -> Twist:
        """The next command while it leads."""
        command = self._inner.step(view)
        self.uses_tf, self.follows, self.reason = self._inner.uses_tf, self._inner.follows, self._inner.reason
        self.turns = max(self._inner.turns, self.told)
        return self._commands.step(view) if self.follows is None else command


class Standing(Behavior):
    """It stands for a reason."""

    def __init__(self, reason: str) -> None:
        super().__init__(None)
        self.reason = reason

    def step(self, _view: View) -> Twist:
        """Zero."""
        return Twist()


def in_line(count: int) -> list[Pose2]:
    """A leader at the origin and the others behind it."""
    return [Pose2(-GAP * i, 0.0, 0.0) for i in range(count)]


def followers(count: int) -> list[Behavior]:
    """The robots behind robot 0."""
    return [load_behavior("follow", {"leader": i - 1, "gap": GAP}, i) for i in range(1, count)]


@pytest.mark.few(1)
@pytest.mark.parametrize(("delay", "most"), [(0, 0.06), (2, 0.08)])
def test_no_robot_cuts_corners(delay: int, most: float) -> None:
    """Two bends of 0.6 m at 0.5 m/s, poses up to 0.2 s old: the last of six keeps to the path of the first.

    In such bends the safety layer keeps each robot a few centimetres further behind the one ahead.
    """
    floor = Chain(in_line(6), [], delay=delay)
    team = [Commanded(CORNERS), *followers(6)]
    path = Polyline([(x, 0.0) for x in (-5.0, 0.0)])
    off: list[list[float]] = [[] for _ in team]
    errors: list[list[float]] = [[] for _ in team]
    for _ in CORNERS:
        floor.step(team)
        path.append(floor.poses[0].x, floor.poses[0].y)
        for i, pose in enumerate(floor.poses[1:], 1):
            place = path.project(pose.x, pose.y, path.end - GAP * i - 1.0)
            nearest = path.at(place)
            off[i].append(math.hypot(nearest.x - pose.x, nearest.y - pose.y))
            errors[i].append(path.end - GAP * i - place)
    assert max(map(max, off[1:])) < most
    rms = [math.sqrt(sum(error * error for error in each) / len(each)) for each in errors[1:]]
    assert rms[0] < 0.1
    assert max(rms) < 0.3


def room(poses: Sequence[Pose2]) -> float:
    """Metres between the two nearest robots, base to base."""
    return min(math.hypot(a.x - b.x, a.y - b.y) for a, b in combinations(poses, 2))


TURNING = {
    "backs up": [(0.5, 0.0)] * 60 + [(-0.5, 0.0)] * 120,
    "turns on the spot and comes back": [(0.5, 0.0)] * 60 + [(0.0, math.pi / 2)] * 20 + [(0.5, 0.0)] * 120,
    "drives a circle into its chain": [(0.5, 0.0)] * 20 + [(0.5, 0.5)] * 300,
    "stops and goes": ([(0.5, 0.0)] * 10 + [(0.0, 0.0)] * 7) * 8,
}


@pytest.mark.ci
@pytest.mark.parametrize("way", TURNING)
def test_no_robot_collides_whatever_the_leader_does(way: str) -> None:
    """Four robots of 0.35 m stay 0.42 m apart, base to base."""
    floor = Chain(in_line(4), [])
    team = [Commanded(TURNING[way]), *followers(4)]
    nearest = math.inf
    for _ in range(len(TURNING[way]) + 20):
        floor.step(team)
        nearest = min(nearest, room(floor.poses))
    assert nearest > 0.42
    assert floor.poses[0] != Pose2(0.0, 0.0, 0.0)


@pytest.mark.ci
def test_a_robot_that_comes_late_finds_its_place() -> None:
    """Robot 3 begins 3 m beside a chain that has driven 5 m: it ends 0.8 m behind robot 2 without contact."""
    floor = Chain([*in_line(3), Pose2(1.0, -3.0, 1.0)], [])
    team = [Commanded([(0.3, 0.0)] * 400), *followers(4)]
    late, team[3] = team[3], load_behavior("idle", {})
    nearest = math.inf
    for tick in range(550):
        if tick == 170:
            team[3] = late
        floor.step(team)
        nearest = min(nearest, room(floor.poses))
    assert nearest > 0.6
    assert [floor.poses[0].x - pose.x for pose in floor.poses[1:]] == pytest.approx([0.8, 1.6, 2.4], abs=0.1)
    assert floor.poses[3].y == pytest.approx(0.0, abs=0.02)


def test_the_place_counts_from_the_head_and_not_from_the_robot_in_front() -> None:
    """Where the robot in front hangs back, the next one does not: it stops for it alone when it comes near."""
    floor = Chain([Pose2(0.0, 0.0, 0.0), Pose2(-0.8, 0.0, 0.0), Pose2(-3.0, 0.0, 0.0)], [])
    team = [Commanded([]), load_behavior("idle", {}), followers(3)[1]]
    for _ in range(100):
        floor.step(team)
    assert floor.poses[2].x == pytest.approx(-1.6, abs=0.05)


def test_a_new_gap_and_a_new_law_hold_at_once() -> None:
    """`zteam param` changes both while the robot follows."""
    floor = Chain(in_line(2), [])
    team = [Commanded([(0.4, 0.0)] * 100), *followers(2)]
    for _ in range(60):
        floor.step(team)
    team[1].params = msgspec.structs.replace(team[1].params, gap=1.2)
    team[1].on_params()
    for _ in range(100):
        floor.step(team)
    assert floor.poses[0].x - floor.poses[1].x == pytest.approx(1.2, abs=0.05)
    team[1].params = msgspec.structs.replace(team[1].params, law="direct")
    team[1].on_params()
    for _ in range(60):
        floor.step(team)
    assert floor.poses[0].x - floor.poses[1].x == pytest.approx(0.8, abs=0.05)


@pytest.mark.ci
@pytest.mark.parametrize("turn", [math.pi / 2, -math.pi / 2])
def test_a_line_that_is_led_from_its_other_end_goes_back_over_its_own_way(turn: float) -> None:
    """In two bends the last of four begins to lead: the others turn round, keep to their way, and end in order."""
    first = CORNERS[:140]
    back = [(0.0, turn)] * 20 + [(0.0, 0.0)] * 20 + [(0.4, 0.0)] * 120
    floor = Chain(in_line(4))
    lead = Led(load_behavior("wander", {}, 0), first)
    team = [lead, *followers(3), Led(load_behavior("follow", {"leader": 2, "gap": GAP}, 3), back)]
    way = Polyline([(x, 0.0) for x in (-5.0, 0.0)])
    for _ in first:
        floor.step(team)
        way.append(*floor.poses[0][:2])
    lead.told = 1
    off, nearest = 0.0, math.inf
    new = Polyline([floor.poses[3][:2]])
    for _ in back:
        floor.step(team)
        new.append(*floor.poses[3][:2])
        nearest = min(nearest, room(floor.poses))
        for pose in floor.poses[:3]:
            at = (each.point(each.project(pose.x, pose.y)) for each in (way, new))
            off = max(off, min(math.dist(pose[:2], point) for point in at))
    assert [robot.follows for robot in team] == [1, 2, 3, None]
    assert off < 0.25
    assert nearest > 0.45
    assert math.dist(floor.poses[0][:2], floor.poses[3][:2]) == pytest.approx(3.0 * GAP, abs=0.3)


@pytest.mark.parametrize(("reason", "waits"), [("x", True), (Reason("x", waits_for=9), False)])
def test_it_waits_for_the_robot_behind_unless_that_one_stands_for_a_lost_one(reason: str, waits: bool) -> None:
    """2.4 m before the one behind it says how far that is and stands, though its leader drives away."""
    floor = Chain([Pose2(0.0, 0.0, 0.0), Pose2(-1.0, 0.0, 0.0), Pose2(-3.4, 0.0, 0.0)])
    team = [Commanded([(0.3, 0.0)] * 40), followers(2)[0], Standing(reason)]
    floor.step(team)
    floor.step(team)
    if waits:
        assert floor.commands[1] == (Twist(), "waits for robot_2 behind it")
    for _ in range(40):
        floor.step(team)
    assert (floor.poses[1].x < -0.9) is waits


class TakenAway(Behavior):
    """A follower that commands drive away after so many ticks, as by hand, and that then drives on by itself."""

    def __init__(self, behavior: Behavior, ticks: int, commands: Sequence[tuple[float, float]]) -> None:
        super().__init__(None)
        self._inner, self._commands, self._ticks = behavior, list(commands), ticks

    def step(self, view: View) -> Twist:
        """The command of its behaviour, or the next one by hand."""
        command = self._inner.step(view)
        self.uses_tf, self.follows, self.reason = True, self._inner.follows, self._inner.reason
        self._ticks -= 1
        if self._ticks >= 0 or not self._commands:
            return command
        speed, turn = self._commands.pop(0)
        return Twist(Vector3(speed), Vector3(z=turn))


@pytest.mark.ci
def test_a_robot_behind_a_wall_goes_back_over_its_own_way() -> None:
    """It was driven to the other side of a long wall beside its trail: it comes back round the wall to its place."""
    quarter = [(0.0, math.pi / 2)] * 10
    away = [*quarter, *[(0.5, 0.0)] * 22, *((0.0, -turn) for _, turn in quarter), *[(0.5, 0.0)] * 100]
    floor = Chain(in_line(2), [(2.0, 0.55, 40.0, 0.55)])
    team = [driven([(0.4, 0.0)] * 250), TakenAway(followers(2)[0], 50, away)]
    for _ in range(50 + len(away)):
        floor.step(team)
    assert floor.poses[1].x > 4.0
    assert floor.poses[1].y > 0.9
    for _ in range(400):
        floor.step(team)
        assert clearance(floor.poses[1], floor.walls) > 0.2
    assert floor.poses[0].x - floor.poses[1].x == pytest.approx(GAP, abs=0.1)
    assert floor.poses[1].y == pytest.approx(0.0, abs=0.1)


@pytest.mark.few(1)
@pytest.mark.parametrize("side", [0.0, 0.05, -0.05])
def test_it_passes_a_robot_that_is_gone(side: float) -> None:
    """The middle one of three is lost where it stands: the last one drives past it to its place, 0.8 m behind."""
    floor = Chain([Pose2(0.0, 0.0, 0.0), Pose2(-0.8, side, 0.0), Pose2(-1.6, 0.0, 0.0)])
    team = [Commanded([(0.3, 0.0)] * 100), Standing(""), followers(3)[1]]
    floor.step(team)
    floor.gone.add(1)
    nearest = math.inf
    for _ in range(220):
        floor.step(team)
        nearest = min(nearest, room(floor.poses))
    assert floor.poses[0].x - floor.poses[2].x == pytest.approx(GAP, abs=0.1)
    assert nearest > 0.4


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(1, 7))
@pytest.mark.parametrize("width", [1.2, 2.0])
def test_a_line_gets_out_of_a_dead_end(width: float, seed: int) -> None:
    """Three robots at the closed end are all outside within a minute, and no two come nearer than 0.4 m."""
    half = 0.5 * width
    walls: list[Segment] = [(0.0, -half, 4.0, -half), (0.0, half, 4.0, half), (4.0, -half, 4.0, half)]
    floor = Chain([Pose2(3.0 - GAP * i, 0.0, 0.0) for i in range(3)], walls, seed)
    team = [load_behavior("wander", {}, 0), *followers(3)]
    for _ in range(600):
        floor.step(team)
        assert room(floor.poses) > 0.4
        if all(pose.x < 0.0 for pose in floor.poses):
            assert team[0].turns > 0
            return
    pytest.fail(f"still inside at {floor.poses}")


def driven(commands: Sequence[tuple[float, float]]) -> Behavior:
    """A head that commands drive: it cannot follow, so it keeps its place."""
    head = Commanded(commands)
    head.turns = NO_TURNS
    return head


@pytest.mark.ci
def test_a_head_that_drives_back_past_its_line_is_followed_by_the_last_robot() -> None:
    """The head was set down behind its line and drives on: the last robot follows it, the others that one."""
    floor = Chain([Pose2(-3.6, 0.6, math.pi), *in_line(5)[1:]])
    team = [driven([(0.3, 0.0)] * 120), *followers(5)]
    for _ in range(300):
        floor.step(team)
        assert room(floor.poses) > 0.4
    assert [robot.follows for robot in team[1:]] == [2, 3, 4, 0]
    apart = [math.dist(floor.poses[a][:2], floor.poses[b][:2]) for a, b in pairwise((0, 4, 3, 2, 1))]
    assert apart == pytest.approx([GAP] * 4, abs=0.15)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "commands", [[(-0.2, 0.0)] * 150, [(0.0, 1.0)] * 31 + [(0.2, 0.0)] * 150], ids=["backs up", "turns round"]
)
def test_a_line_makes_room_for_a_head_that_comes_back(commands: list[tuple[float, float]]) -> None:
    """In a corridor in which no two robots pass, the robots drive back along their way, the last one first."""
    walls: list[Segment] = [(-12.0, -0.6, 3.0, -0.6), (-12.0, 0.6, 3.0, 0.6)]
    floor = Chain(in_line(4), walls)
    team, began = [driven(commands), *followers(4)], {}
    for tick in range(len(commands)):
        floor.step(team)
        assert room(floor.poses) > 0.4
        for robot in (1, 2, 3):
            if floor.poses[robot].x < -GAP * robot - 0.2:
                began.setdefault(robot, tick)
    assert floor.poses[0].x < -2.0
    assert floor.poses[3].x < -4.2
    assert began[3] <= began[2] + 5


def test_a_robot_does_not_wait_for_one_that_waits_itself() -> None:
    """Two that wait for each other would stand for good: the one ahead drives on."""
    floor = Chain(in_line(3))
    floor.place(2, Pose2(-4.0, 0.0, 0.0))
    team = [driven([(0.3, 0.0)] * 100), *followers(3)]
    team[2].step = lambda view: Twist()  # type: ignore[method-assign]
    for _ in range(30):
        floor.step(team)
    assert floor.poses[1].x == pytest.approx(-GAP, abs=0.1)
    for _ in range(70):
        floor.waits(2, 1)
        floor.step(team)
    assert floor.poses[0].x - floor.poses[1].x < 1.5


@pytest.mark.ci
def test_a_robot_that_was_passed_does_not_wait_for_the_one_that_passed_it() -> None:
    """The last of three has come past the second: the second passes it again, and the line drives on in its order."""
    floor = Chain(in_line(3))
    behaviors = [load_behavior("wander", {"speed": 0.4}, 0), *followers(3)]
    for _ in range(100):
        floor.step(behaviors)
    floor.place(1, floor.poses[2].compose(Pose2(-2.5, 0.0, 0.0)))
    for _ in range(200):
        floor.step(behaviors)
    assert [behavior.turns for behavior in behaviors] == [0, 0, 0]
    assert [math.dist(one[:2], other[:2]) for one, other in pairwise(floor.poses)] == pytest.approx([GAP] * 2, abs=0.1)
