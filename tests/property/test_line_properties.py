"""Lines under any order of turns, and of robots that are killed and come back."""

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from zteam.messages import RobotStatus
from zteam.robot.behaviors.line import Line, OnLeaderLost, Place
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


def look(leaders: dict[int, int], gone: set[int], on_lost: OnLeaderLost, turns: int) -> dict[int, Place]:
    """The places that the living robots find, each for itself."""
    robots = {*leaders, *leaders.values()}
    told = {robot: RobotStatus(robot_id=robot, leader=leaders.get(robot, -1), turns=turns, gap=0.8) for robot in robots}
    found = {}
    for robot in sorted(robots - gone):
        line, leader = Line(), leaders.get(robot)
        view = msgspec.structs.replace(VIEW, robot_id=robot, inputs={"statuses": told}, team=(*robots, *gone))
        line.find_gone(view)
        found[robot] = line.find_place(msgspec.structs.replace(view, team=tuple(robots - gone)), leader, on_lost)
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
        assert {place.head for place in found.values() if not place.reason} <= {head}
        for own, place in found.items():
            assert place.ahead not in gone
            if place.reason:
                assert on_lost != "takeover" and (on_lost == "stop" or head in gone)
            elif place.ahead is not None and is_line and not found[place.ahead].reason:
                assert found[place.ahead].behind == own
            seen = {own}
            while place.ahead is not None and place.ahead in found:
                assert place.ahead not in seen
                seen.add(place.ahead)
                place = found[place.ahead]
        if is_line and on_lost == "takeover" and found:
            assert sum(place.ahead is None for place in found.values()) == 1


@given(st.one_of(trees(), LINES), POLICIES)
def test_a_whole_line_that_was_never_turned_is_as_it_was_named(leaders: dict[int, int], on_lost: OnLeaderLost) -> None:
    """Each robot follows its own leader."""
    found = look(leaders, set(), on_lost, 0)
    assert {robot: place.ahead for robot, place in found.items() if place.ahead is not None} == leaders
