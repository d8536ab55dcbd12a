"""head: the robot that leads looks before it turns, keeps its line together, and hands over where it is stuck."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import pytest

from support.flat_floor import LASER, Floor, Segment, cast, clearance, make_odometry, make_scan, make_view
from zteam.behaviors import Behavior, View
from zteam.clock import to_ns
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.robot.behaviors.behavior import NoParams
from zteam.robot.behaviors.evasion import BoxedIn, Head
from zteam.robot.behaviors.line import LineRole
from zteam.robot.trials.situations import lookup_in
from zteam.robot.view import own_pose

START = Pose2(0.0, 0.0, 0.0)
SPEED = 0.4
NO_MATES: Mapping[int, tuple[float, float]] = {}


def box(left: float, right: float, ahead: float, back: float) -> list[Segment]:
    """Walls so many metres from the origin."""
    corners = [(-back, -right), (ahead, -right), (ahead, left), (-back, left)]
    return [(*corners[i - 1], *corners[i]) for i in range(4)]


OPEN, SHUT = box(20.0, 20.0, 20.0, 20.0), box(0.7, 0.7, 0.6, 0.7)


def look(
    own: Pose2,
    walls: Sequence[Segment],
    seconds: float,
    mates: Mapping[int, tuple[float, float]] = NO_MATES,
) -> View:
    """What a robot sees at `own` of walls and of the others, whose places are in its own base frame."""
    at = {0: own, **{robot: own.compose(Pose2(x, y, 0.0)) for robot, (x, y) in mates.items()}}

    scan = make_scan(cast(own.compose(LASER), walls), to_ns(seconds))
    return make_view(scan, now=to_ns(seconds), odom=make_odometry(own), lookup=lookup_in(at, 0), team=(0, *mates))


def lead(
    head: Head, view: View, own: Pose2 = START, behind: int | None = None, *, after: tuple[int, ...] = ()
) -> tuple[Twist | None, str]:
    """One step of a head that may drive 0.4 m/s and turn 1 rad/s."""
    return head.step(view, own, LineRole(behind=behind, after=after, may_turn=True), SPEED, 1.0)


@pytest.mark.parametrize(("ahead", "straight"), [(0.85, True), (0.7, False)])
def test_it_drives_straight_on_while_there_is_room(ahead: float, straight: bool) -> None:
    """It turns only where less than 0.75 m is free ahead of its laser."""
    command, reason = lead(Head(), look(START, box(20.0, 20.0, ahead, 20.0), 1.0))
    assert command is not None
    assert ((command.linear.x, command.angular.z) == (SPEED, 0.0)) is straight
    assert not reason


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("less", "behind"), [(0.95, 4), (0.8, 5)])
def test_it_turns_only_to_where_there_is_room(side: float, less: float, behind: int) -> None:
    """A wall ahead, too little room on one side and 1.8 m on the other: it turns to the other. With five robots behind
    it less room will do."""
    left, right = (1.8, less) if side > 0.0 else (less, 1.8)
    command, _ = lead(Head(), look(START, box(left, right, 0.6, 20.0), 1.0), after=tuple(range(1, 1 + behind)))
    assert command is not None
    assert command.linear.x == 0.0
    assert command.angular.z * side > 0.0


RING = {1: (-0.8, 0.0), 2: (-1.6, 0.0), 3: (-1.6, -1.9), 4: (-0.8, -1.9), 5: (0.0, -1.9), 6: (0.8, -1.9)}


@pytest.mark.parametrize(("left", "turns"), [(1.8, 1.0), (0.7, None)])
def test_the_head_of_a_long_line_keeps_out_of_its_own_ring(left: float, turns: float | None) -> None:
    """It turns to the side where its line is not, and hands over where there is no room on that side."""
    head = Head()
    for tick in range(31):
        lead(head, look(START, OPEN, 1.0 + 0.1 * tick), after=tuple(RING))
    command, _ = lead(head, look(START, box(left, 20.0, 0.6, 20.0), 4.1, RING), after=tuple(RING))
    assert (None if command is None else command.angular.z) == turns


def test_it_hands_over_where_it_does_not_get_on() -> None:
    """The way is free, and yet it has not come 0.4 m in 6 s; one that has come so far goes on."""
    stuck, moving = Head(), Head()
    for tick in range(10, 71):
        on = Pose2(0.01 * (tick - 10), 0.0, 0.0)
        assert lead(stuck, look(START, OPEN, 0.1 * tick))[0] is not None
        assert lead(moving, look(on, OPEN, 0.1 * tick), on)[0] is not None
    assert lead(stuck, look(START, OPEN, 7.1))[0] is None
    assert lead(moving, look(Pose2(0.61, 0.0, 0.0), OPEN, 7.1), Pose2(0.61, 0.0, 0.0))[0] is not None


@pytest.mark.parametrize(("metres", "hands_over"), [(1.9, True), (2.1, False)])
def test_it_hands_over_where_it_does_not_come_two_metres_away(metres: float, hands_over: bool) -> None:
    """For 40 s it has driven to and fro; the other end of the line may find a way on."""
    head = Head()
    given = []
    for tick in range(402):
        own = Pose2(metres * abs(1.0 - 0.02 * (tick % 100)), 0.0, 0.0)
        given.append(lead(head, look(own, OPEN, 1.0 + 0.1 * tick), own)[0])
    assert all(given[:-1])
    assert (given[-1] is None) is hands_over


@pytest.mark.parametrize(("ticks", "hands_over"), [(29, False), (31, True)])
def test_a_new_head_has_three_seconds_to_find_a_heading(ticks: int, hands_over: bool) -> None:
    """Shut in later than that it hands over at once; before, its own line may be what shuts it in."""
    head = Head()
    for tick in range(ticks):
        lead(head, look(START, OPEN, 1.0 + 0.1 * tick))
    command, _ = lead(head, look(START, SHUT, 1.0 + 0.1 * ticks, {1: (-0.6, 0.4), 2: (-0.6, -0.4)}))
    assert (command is None) is hands_over


@pytest.mark.parametrize(("apart", "share"), [(0.8, 1.0), (1.6, 1.0), (1.95, 0.5), (2.4, 0.0)])
def test_it_slows_down_for_the_robot_behind(apart: float, share: float) -> None:
    """From 1.6 m on, and at 2.3 m it stands and says so."""
    command, reason = lead(Head(), look(START, OPEN, 1.0, {1: (-apart, 0.0)}), behind=1)
    assert command is not None
    assert command.linear.x == pytest.approx(SPEED * share)
    assert reason == ("" if share else "waits for robot_1 behind it")


def test_it_stands_while_its_line_is_not_there() -> None:
    """In front of a wall it looks for no way until the robot behind it has come; after 40 s it hands over."""
    head = Head()
    for tick in range(1, 401):
        command, reason = lead(head, look(START, SHUT, 0.1 * tick, {1: (-2.5, 0.0)}), behind=1)
        assert (command, reason) == (Twist(), "waits for robot_1 behind it")
    assert lead(head, look(START, SHUT, 40.3, {1: (-2.5, 0.0)}), behind=1)[0] is None


@pytest.mark.parametrize("y", [0.3, -0.3])
def test_a_new_head_turns_away_from_the_robot_behind_it(y: float) -> None:
    """By the shorter way: it looked along the line that it followed."""
    command, _ = lead(Head(), look(START, OPEN, 1.0, {1: (0.8, y)}), after=(1,))
    assert command is not None
    assert command.linear.x == 0.0
    assert command.angular.z * y < 0.0


@pytest.mark.parametrize(("ahead", "drives_on"), [(0.65, True), (0.5, False)])
def test_it_looks_round_a_corner_from_near_the_wall(ahead: float, drives_on: bool) -> None:
    """A metre before a wall it may see no way to the side where there is one."""
    command, _ = lead(Head(), look(START, box(0.5, 0.5, 0.05 + ahead, 20.0), 1.0))
    assert command is not None
    assert (command.linear.x > 0.0) is drives_on


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_turns_to_the_same_side_as_last_time(side: float) -> None:
    """Where a turn to the other side would be a little smaller: so it goes round a room."""
    head = Head()
    slanted: list[Segment] = [(0.6 + 0.9 * side, -9.0, 0.6 - 0.9 * side, 9.0)]
    other, _ = lead(Head(), look(START, slanted, 1.0))
    first, _ = lead(head, look(START, box(20.0 if side > 0.0 else 0.3, 0.3 if side > 0.0 else 20.0, 0.6, 20.0), 1.0))
    head.rest()
    again, _ = lead(head, look(START, slanted, 2.0))
    assert [command and command.angular.z * side > 0.0 for command in (other, first, again)] == [False, True, True]


class Leader(Behavior):
    """The head of a line that has just turned; where it hands over, the other end of its line hands back at once."""

    uses_tf = True

    def __init__(self) -> None:
        super().__init__(NoParams())
        self.head, self.handed_over = Head(), 0

    def step(self, view: View) -> Twist:
        own = own_pose(view)
        assert own is not None
        command, _ = self.head.step(view, own, LineRole(may_turn=True, turns=1), SPEED, 1.0)
        if command is None:
            self.handed_over += 1
            self.head.rest()
        return command or Twist()


@pytest.mark.parametrize("turned_away", [False, True])
@pytest.mark.parametrize("side", [1, -1])
def test_it_drives_on_through_the_bends_of_a_narrow_corridor(side: int, turned_away: bool) -> None:
    """0.95 m wide, with a bend each 1.15 m: nowhere is there a metre of room straight on. It may look back at
    first: then its line turns while it turns round."""
    corners = [(0.0, 0.0), (2.1, 0.0), (2.1, 1.15), (3.25, 1.15), (3.25, 5.0)]
    inner = [(0.0, 0.95), (1.15, 0.95), (1.15, 2.1), (2.3, 2.1), (2.3, 5.0)]
    ends = [(corners[0], inner[0]), (corners[-1], inner[-1])]
    pairs = [*pairwise(corners), *pairwise(inner), *ends]
    walls = [(x0, side * y0, x1, side * y1) for (x0, y0), (x1, y1) in pairs]
    floor, leader, track = Floor([Pose2(0.6, side * 0.475, 3.1 if turned_away else 0.0)], walls), Leader(), []
    while len(track) < 600 and side * floor.poses[0].y < 2.6:
        floor.step([leader])
        track.append(floor.poses[0])
    assert side * track[-1].y > 2.6
    assert leader.handed_over < (6 if turned_away else 2)
    assert min(clearance(pose, walls) for pose in track) > 0.12


def test_a_leader_is_boxed_in_until_it_has_come_half_a_metre_away() -> None:
    """One that turned by more than a radian on a place for 2.5 s; the robots that made room do not come back before."""
    boxed_in = BoxedIn()
    places = [(0.0, 0.0, 0.1), (0.05, 1.2, 1.0), (0.05, 1.2, 3.0), (0.4, 1.2, 4.0), (0.6, 1.2, 5.0), (0.6, 3.0, 6.0)]
    told = [boxed_in.look(to_ns(seconds), Pose2(x, 0.0, yaw)) for x, yaw, seconds in places]
    assert told == [False, False, True, True, False, False]
