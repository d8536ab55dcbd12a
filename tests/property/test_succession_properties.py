"""Chains under any order of robots that are killed and come back."""

from hypothesis import given
from hypothesis import strategies as st

from support.flat_floor import make_view
from zteam.behaviors.succession import OnLeaderLost, Presence, Role, find_role

MOST = 7


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


def look(leaders: dict[int, int], gone: set[int], on_lost: OnLeaderLost) -> dict[int, Role]:
    """The roles that the living followers find, each for itself."""
    alive = leaders.keys() - gone
    return {robot: find_role(robot, leaders, gone, on_lost, alive) for robot in sorted(alive)}


def check(leaders: dict[int, int], gone: set[int], on_lost: OnLeaderLost) -> None:
    """What holds at any time of a chain with one head."""
    head = next(iter(set(leaders.values()) - leaders.keys()))
    roles = look(leaders, gone, on_lost)
    for robot, role in roles.items():
        if role.reason:
            assert not role.before
            assert on_lost != "takeover"
            assert on_lost == "stop" or head in gone
        elif not role.before:
            assert on_lost == "takeover"
            assert head in gone
        else:
            assert robot not in role.before
            assert not gone.intersection(role.before)
            # One step up the chain is one robot less before it: so there are no circles.
            assert roles.get(role.before[0], Role()) == Role(role.before[1:])
    if on_lost == "takeover" and roles and head in gone:
        assert sum(not role.before for role in roles.values()) == 1


@given(st.one_of(trees(), LINES), EVENTS, POLICIES)
def test_every_living_robot_has_its_role_and_all_agree(
    leaders: dict[int, int], events: list[tuple[bool, int]], on_lost: OnLeaderLost
) -> None:
    """After each kill and each return: a robot follows a living one before it, leads, or stands and says why.

    No robot stands without need, one robot leads, and the chain has no circle.
    """
    gone: set[int] = set()
    for comes_back, robot in events:
        (gone.discard if comes_back else gone.add)(robot)
        check(leaders, gone, on_lost)


@given(st.one_of(trees(), LINES), EVENTS, POLICIES)
def test_a_chain_that_is_whole_again_is_as_before(
    leaders: dict[int, int], events: list[tuple[bool, int]], on_lost: OnLeaderLost
) -> None:
    """Each robot sees the others come and go from its own beginning on; when all are back, each follows its leader.

    Meanwhile no robot follows one that it has seen alive and that is gone.
    """
    robots = {*leaders, *leaders.values()}
    processes = {robot: Presence() for robot in robots}
    for comes_back, robot in [*events, *((True, robot) for robot in robots)]:
        if not comes_back:
            processes.pop(robot, None)
        elif robot in robots:
            processes.setdefault(robot, Presence())
        team = tuple(sorted(processes))
        gone = {each: presence.find_gone(make_view(robot_id=each, team=team)) for each, presence in processes.items()}
        roles = {each: find_role(each, leaders, gone[each], on_lost) for each in team if each in leaders}
        assert not any(gone[each].intersection(role.before) for each, role in roles.items())
    assert {robot: role.before[0] for robot, role in roles.items()} == leaders
