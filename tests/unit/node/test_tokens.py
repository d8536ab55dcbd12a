"""Which processes hold their names."""

from itertools import permutations

import pytest

from zteam.node.tokens import TokenSet


def test_a_name_lives_from_its_first_token_to_its_last() -> None:
    """Only the first and the last of two sessions under one name change anything."""
    tokens = TokenSet()
    assert tokens.take("robot_1", "a", True)
    assert not tokens.take("robot_1", "b", True)
    assert not tokens.take("robot_1", "a", False)
    assert "robot_1" in tokens
    assert tokens.take("robot_1", "b", False)
    assert "robot_1" not in tokens


def test_repeated_and_unknown_tokens_change_nothing() -> None:
    """A token told twice counts once, and the loss of a token that was never there is no loss."""
    tokens = TokenSet()
    tokens.take("robot_1", "a", True)
    assert not tokens.take("robot_1", "a", True)
    assert not tokens.take("robot_1", "b", False)
    assert not tokens.take("robot_2", "a", False)
    assert [*tokens] == ["robot_1"]
    assert tokens.take("robot_1", "a", False)
    assert len(tokens) == 0


def test_holders_are_known_both_ways() -> None:
    """The sessions of a name, and the name of a session."""
    tokens = TokenSet()
    tokens.take("robot_1", "a", True)
    tokens.take("robot_1", "b", True)
    tokens.take("sim", "c", True)
    assert tokens.instances("robot_1") == {"a", "b"}
    assert tokens.instances("tf") == frozenset()
    assert (tokens.name_of("b"), tokens.name_of("c"), tokens.name_of("d")) == ("robot_1", "sim", None)


@pytest.mark.parametrize("order", [*permutations(("nav_2", "nav_0", "nav_1"))])
def test_a_session_may_hold_several_names(order: tuple[str, ...]) -> None:
    """Whatever the order in which their tokens come and go, all are known, and people read the first one."""
    tokens = TokenSet()
    for name in order:
        tokens.take(name, "a", True)
    assert (tokens.names_of("a"), tokens.name_of("a")) == ({*order}, "nav_0")
    for count, name in enumerate(order, 1):
        tokens.take(name, "a", False)
        assert tokens.names_of("a") == {*order[count:]}
