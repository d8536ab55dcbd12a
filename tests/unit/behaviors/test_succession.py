"""succession: which robot a robot of a chain follows when others are gone, and which one leads then."""

import msgspec
import pytest

from zteam.behaviors.succession import OnLeaderLost, Presence, Role, chain_before, find_role
from zteam.testing import make_view

LINE = {1: 0, 2: 1, 3: 2}
"""0 <- 1 <- 2 <- 3."""


@pytest.mark.parametrize("on_lost", ["relink", "stop", "takeover"])
@pytest.mark.parametrize("own", [1, 2, 3])
def test_a_whole_chain_is_as_it_was_named(own: int, on_lost: OnLeaderLost) -> None:
    """While no robot is gone, each follows the robot that it was told to follow, under any policy."""
    assert find_role(own, LINE, frozenset(), on_lost) == Role(tuple(range(own - 1, -1, -1)))


def test_a_leader_of_which_nothing_is_known_is_the_head() -> None:
    """Before any status has come the named leader is all that there is."""
    assert find_role(3, {3: 2}, frozenset(), "relink") == Role((2,))


@pytest.mark.parametrize("on_lost", ["relink", "takeover"])
def test_those_behind_a_lost_middle_robot_move_up(on_lost: OnLeaderLost) -> None:
    """They follow the next living robot before it, one place further ahead."""
    assert [find_role(i, LINE, {2}, on_lost) for i in (1, 3)] == [Role((0,)), Role((1, 0))]
    assert find_role(3, LINE, {1, 2}, on_lost) == Role((0,))


@pytest.mark.parametrize("own", [1, 2, 3])
def test_without_its_head_the_whole_chain_stands(own: int) -> None:
    """With `relink` no robot is left to follow, and all name the lost robot at once."""
    assert find_role(own, LINE, {0}, "relink") == Role(reason="leader robot_0 is gone")


def test_stop_is_about_every_robot_before() -> None:
    """With `stop` the loss of a middle robot stops the robots behind it, and no others."""
    assert find_role(3, LINE, {1}, "stop") == Role(reason="leader robot_1 is gone")
    assert find_role(1, LINE, {2, 3}, "stop") == Role((0,))


def test_the_first_living_robot_takes_over() -> None:
    """It leads, the others follow it; if it is gone as well, the next one leads."""
    assert [find_role(i, LINE, {0}, "takeover") for i in LINE] == [Role(), Role((1,)), Role((2, 1))]
    assert [find_role(i, LINE, {0, 1}, "takeover") for i in (2, 3)] == [Role(), Role((2,))]


def test_of_two_branches_one_robot_takes_over() -> None:
    """Fewest robots before it, then the lowest id: the other branch goes behind it."""
    tree = {1: 0, 2: 1, 5: 0, 6: 5}
    heirs = set(tree)
    assert [find_role(i, tree, {0}, "takeover", heirs) for i in (1, 5, 6)] == [Role(), Role((1,)), Role((5, 1))]
    assert [find_role(i, tree, {0, 1}, "takeover", heirs) for i in (2, 5)] == [Role((5,)), Role()]


@pytest.mark.parametrize("leaders", [{1: 1}, {1: 2, 2: 1}, {1: 2, 2: 3, 3: 2}])
def test_a_circle_moves_nobody(leaders: dict[int, int]) -> None:
    """A chain that leads back to one of its robots has no head."""
    assert chain_before(1, leaders) is None
    assert find_role(1, leaders, frozenset(), "takeover") == Role(reason="the robots follow each other in a circle")


def test_gone_is_who_was_there_and_is_not() -> None:
    """A robot that never was alive is not gone; one that comes back is there again; without itself nothing is known."""
    presence, view = Presence(), make_view(robot_id=1)

    def gone(*team: int) -> set[int]:
        return set(presence.find_gone(msgspec.structs.replace(view, team=team)))

    assert gone() == set()
    assert gone(1) == set()
    assert gone(0, 1, 2) == set()
    assert gone(1) == {0, 2}
    assert gone() == set()
    assert gone(0, 1) == {2}
