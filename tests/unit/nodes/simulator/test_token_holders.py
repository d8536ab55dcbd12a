"""Which processes hold which names."""

from zteam.nodes.simulator.token_holders import TokenHolders


def test_a_name_is_held_from_its_first_token_to_its_last() -> None:
    """A restarted process shows the new token before the old one goes: the name stays held."""
    holders = TokenHolders()
    assert "tf" not in holders
    holders.take("tf", "old", True)
    holders.take("tf", "new", True)
    assert holders.instances("tf") == {"old", "new"}
    holders.take("tf", "old", False)
    assert "tf" in holders
    holders.take("tf", "new", False)
    assert ("tf" in holders, holders.instances("tf")) == (False, frozenset())


def test_the_loss_of_an_unknown_token_changes_nothing() -> None:
    """Neither for a name without a holder nor for a session that does not hold it."""
    holders = TokenHolders()
    holders.take("tf", "a", False)
    assert holders.names() == []
    holders.take("tf", "a", True)
    holders.take("tf", "b", False)
    assert holders.instances("tf") == {"a"}


def test_names_are_sorted() -> None:
    """Whatever the order of the tokens."""
    holders = TokenHolders()
    for name in ("tf", "robot_1", "robot_0"):
        holders.take(name, "a", True)
    assert holders.names() == ["robot_0", "robot_1", "tf"]
