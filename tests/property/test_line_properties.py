"""Lines under any order of turns, of robots that are killed and come back, and of numbers that a robot makes up."""

from collections.abc import Iterable

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from zteam.messages import RobotStatus
from zteam.robot.behaviors.line import Line, LineRole, OnLeaderLost
from zteam.testing import make_view

MOST = 7
VIEW = make_view()


@st.composite
def trees(draw: st.DrawFn) -> dict[int, int]:
    """The robots that 1, 2, … are to follow: each one with a lower number, renamed by chance."""
    count = draw(st.integers(1, MOST))
    ids = draw(st.permutations(range(count + 1)))
    return {ids[i]: ids[draw(st.integers(0, i - 1))] for i in range(1, count + 1)}


LINES = st.permutations(range(MOST)).map(lambda ids: dict(zip(ids[1:], ids, strict=False)))
EVENTS = st.lists(st.tuples(st.booleans(), st.integers(0, MOST)), max_size=20)
"""Whether a robot comes back or is killed, and which."""
POLICIES = st.sampled_from(["relink", "stop", "takeover"])


def look(leaders: dict[int, int], gone: set[int], on_lost: OnLeaderLost, turns: int) -> dict[int, LineRole]:
    """The places that the living robots find, each for itself."""
    robots = {*leaders, *leaders.values()}
    told = {robot: RobotStatus(robot_id=robot, leader=leaders.get(robot, -1), turns=turns, gap=0.8) for robot in robots}
    found = {}
    for robot in sorted(robots - gone):
        line, leader = Line(), leaders.get(robot)
        view = msgspec.structs.replace(VIEW, robot_id=robot, inputs={"statuses": told}, team=(*robots, *gone))
        line.find_gone(view)
        found[robot] = line.find_role(msgspec.structs.replace(view, team=tuple(robots - gone)), leader, on_lost)
    return found


@given(st.one_of(trees(), LINES), EVENTS, POLICIES, st.integers(0, 3))
def test_every_living_robot_has_its_place_and_all_agree(
    leaders: dict[int, int], events: list[tuple[bool, int]], on_lost: OnLeaderLost, turns: int
) -> None:
    """After each kill and each return: a robot follows a living one, leads, or stands and says why, in no circle.

    In a line the robot behind the one that a robot follows is that robot.
    """
    head = next(iter(set(leaders.values()) - leaders.keys()))
    is_line = len(set(leaders.values())) == len(leaders)
    gone: set[int] = set()
    for comes_back, robot in [(True, 0), *events]:
        (gone.discard if comes_back else gone.add)(robot)
        found = look(leaders, gone, on_lost, turns)
        assert {role.head for role in found.values() if not role.reason} <= {head}
        for own, role in found.items():
            assert role.ahead not in gone
            if role.reason:
                assert on_lost != "takeover" and (on_lost == "stop" or head in gone)
            elif role.ahead is not None and is_line and not found[role.ahead].reason:
                assert found[role.ahead].behind == own
            seen = {own}
            while role.ahead is not None and role.ahead in found:
                assert role.ahead not in seen
                seen.add(role.ahead)
                role = found[role.ahead]
        if is_line and on_lost == "takeover" and found:
            assert sum(role.ahead is None for role in found.values()) == 1


@given(st.one_of(trees(), LINES), POLICIES)
def test_a_whole_line_that_was_never_turned_is_as_it_was_named(leaders: dict[int, int], on_lost: OnLeaderLost) -> None:
    """Each robot follows its own leader."""
    found = look(leaders, set(), on_lost, 0)
    assert {robot: role.ahead for robot, role in found.items() if role.ahead is not None} == leaders


class TurningLine:
    """Robots 0 <- 1 <- 2 …, which hear each other's newest statuses; one of them may tell any number of turns."""

    def __init__(self, count: int, liar: int | None, start: int) -> None:
        self.count, self.liar = count, liar
        self.lines = [Line() for _ in range(count)]
        self.lie = start
        self.told = dict.fromkeys(range(count), start)

    def hear(self, robots: Iterable[int]) -> None:
        """These robots hear what all have told; then all tell what they know."""
        statuses = {i: RobotStatus(robot_id=i, leader=i - 1, turns=turns, gap=0.8) for i, turns in self.told.items()}
        for i in robots:
            team = tuple(range(self.count))
            view = msgspec.structs.replace(VIEW, robot_id=i, inputs={"statuses": statuses}, team=team)
            self.lines[i].find_role(view, i - 1 if i else None)
        for i, line in enumerate(self.lines):
            self.told[i] = self.lie if i == self.liar else line.turns

    def hand_over(self) -> None:
        """The robot that leads does."""
        leader = self.lines[0 if self.turns % 2 == 0 else -1]
        leader.turn_on()
        self.told[self.lines.index(leader)] = leader.turns

    @property
    def turns(self) -> int:
        """As the last robot that leads or hands over knows it."""
        ends = self.lines[0].turns, self.lines[-1].turns
        return max(ends) if max(ends) - min(ends) < 2**30 else min(ends)


NUMBERS = st.integers(0, 2**31 - 1) | st.sampled_from([0, 1, 2, 2**30, 2**31 - 2, 2**31 - 1])


@given(
    st.integers(4, MOST),
    NUMBERS,
    st.lists(st.tuples(st.booleans(), NUMBERS, st.sets(st.integers(0, MOST - 1))), max_size=12),
    st.data(),
)
def test_a_line_turns_by_the_robot_whose_turn_it_is(
    count: int, start: int, events: list[tuple[bool, int, set[int]]], data: st.DataObject
) -> None:
    """A robot in the middle tells any numbers, the others miss any messages: whenever all have heard each other, each
    of them knows how often the ends have handed over. The number goes on at 0 after the last one."""
    line = TurningLine(count, data.draw(st.integers(1, count - 2)), start)
    line.hear(range(count))
    expected = start
    assert {each.turns for each in line.lines} == {expected}
    for hands_over, lie, deaf in events:
        line.lie = lie
        line.hear(set(range(count)) - deaf)
        if hands_over:
            # Not before it has the lead itself, which takes what the others have told.
            line.hear(range(count))
            line.hand_over()
            expected = (expected + 1) % 2**31
        line.hear(set(range(count)) - deaf)
        for _ in range(2):
            line.hear(range(count))
        honest = {each.turns for i, each in enumerate(line.lines) if i != line.liar}
        assert honest == {expected}


@given(st.integers(3, MOST), st.integers(1, 20), st.data())
def test_a_robot_that_missed_turns_counts_on(count: int, turns: int, data: st.DataObject) -> None:
    """It was cut off, or was started again, while the others turned the line: it agrees when it hears them."""
    line, absent = TurningLine(count, None, 0), data.draw(st.integers(0, count - 1))
    line.hear(range(count))
    if data.draw(st.booleans()):
        line.lines[absent] = Line()
    for i, each in enumerate(line.lines):
        if i != absent:
            each.turns = line.told[i] = turns
    for _ in range(3):
        line.hear(range(count))
    assert {each.turns for each in line.lines} == {turns}
