"""Tokens that vanish: with their process, with the router, or for a moment."""

from zteam.node.tokens import GRACE, RETURN_GRACE, TokenLossFilter


def test_a_loss_is_told_once_after_the_grace() -> None:
    """Not at once, then exactly once, each token for itself."""
    losses = TokenLossFilter()
    losses.take_token("a", False, 10.0)
    losses.take_token("b", False, 10.0 + GRACE)
    assert losses.take_due(10.0 + GRACE / 2) == []
    assert losses.take_due(10.0 + GRACE * 1.5) == ["a"]
    assert losses.take_due(10.0 + GRACE * 2.5) == ["b"]
    assert losses.take_due(100.0) == []


def test_a_token_that_is_back_was_never_lost() -> None:
    """And when it goes again the grace begins anew; a second word of the same loss does not prolong it."""
    losses = TokenLossFilter()
    losses.take_token("a", False, 10.0)
    losses.take_token("a", True, 10.1)
    assert losses.take_due(20.0) == []
    losses.take_token("a", False, 20.0)
    losses.take_token("a", False, 20.0 + GRACE)
    assert losses.take_due(20.0 + GRACE / 2) == []
    assert losses.take_due(20.0 + GRACE * 1.5) == ["a"]


def test_nothing_is_lost_while_the_router_is_away() -> None:
    """Nor for a while after its return, whether tokens vanish before or after the link."""
    losses = TokenLossFilter()
    assert losses.trusted(0.0)
    losses.take_token("before", False, 10.0)
    losses.take_link(False, 10.001)
    for key in ("after", "dead"):
        losses.take_token(key, False, 10.002)
    assert not losses.trusted(50.0)
    assert losses.take_due(50.0) == []
    losses.take_link(True, 60.0)
    assert losses.take_due(60.0 + RETURN_GRACE / 2) == []
    for key in ("before", "after"):
        losses.take_token(key, True, 60.0 + RETURN_GRACE / 2)
    assert losses.trusted(60.0 + RETURN_GRACE)
    assert losses.take_due(60.0 + RETURN_GRACE) == ["dead"]
