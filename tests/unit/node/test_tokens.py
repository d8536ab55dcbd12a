"""Which processes hold their names, and which tokens are lost for good."""

from collections.abc import Callable
from itertools import permutations

import pytest

from support.cuttable_transport import cut_bus
from zteam import names
from zteam.bus import MemoryHub
from zteam.node import tokens as module
from zteam.node.tokens import GRACE, RETURN_GRACE, CertainTokens, TokenLossFilter, TokenSet


def test_a_name_lives_from_its_first_token_to_its_last() -> None:
    """Of two sessions under one name the first and the last change something; a token that is told twice counts once,
    and the loss of one that was never there is no loss."""
    tokens, robot = TokenSet(), "robot_1"
    steps = [("a", True), ("a", True), ("b", True), ("c", False), ("a", False), ("b", False), ("b", False)]
    assert [tokens.take(robot, *step) for step in steps] == [True, False, False, False, False, True, False]
    assert len(tokens) == 0
    for name, instance in ((robot, "a"), (robot, "b"), ("sim", "c")):
        tokens.take(name, instance, True)
    assert ([*tokens], tokens.instances(robot), tokens.instances("tf")) == ([robot, "sim"], {"a", "b"}, frozenset())
    assert (tokens.name_of("b"), tokens.name_of("c"), tokens.name_of("d")) == (robot, "sim", None)


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


def test_a_loss_is_due_once_after_the_grace() -> None:
    """Each token for itself; one that is back was never lost, and a second word of the same loss does not prolong the
    grace."""
    losses = TokenLossFilter()
    assert losses.due_in(10.0) is None
    losses.on_token("a", False, 10.0)
    losses.on_token("back", False, 10.0)
    losses.on_token("back", True, 10.1)
    losses.on_token("b", False, 10.0 + GRACE)
    losses.on_token("a", False, 10.0 + 0.9 * GRACE)
    assert losses.due_in(10.0) == GRACE
    assert losses.take_due(10.0 + 0.5 * GRACE) == []
    assert losses.take_due(10.0 + 1.5 * GRACE) == ["a"]
    assert losses.take_due(10.0 + 1.5 * GRACE, 0.0) == ["b"]
    assert losses.take_due(100.0) == []


def test_nothing_is_lost_while_the_router_is_away() -> None:
    """Nor for a while after its return, whether tokens vanish before or after the link."""
    losses = TokenLossFilter()
    assert losses.trusted(0.0)
    losses.on_token("before", False, 10.0)
    losses.on_link(False, 10.001)
    for key in ("after", "dead"):
        losses.on_token(key, False, 10.002)
    assert (losses.trusted(50.0), losses.take_due(50.0), losses.due_in(50.0)) == (False, [], None)
    losses.on_link(True, 60.0)
    assert (losses.take_due(60.0 + RETURN_GRACE / 2), losses.due_in(60.0)) == ([], RETURN_GRACE)
    for key in ("before", "after"):
        losses.on_token(key, True, 60.0 + RETURN_GRACE / 2)
    assert losses.trusted(60.0 + RETURN_GRACE)
    assert losses.take_due(60.0 + RETURN_GRACE) == ["dead"]


def test_a_loss_is_told_when_it_is_certain(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """A token that comes is told at once, and its loss a moment later, by one timer for all tokens. Of two that vanish
    with the link, only the one that does not come back is lost."""
    now, timers, told = 0.0, list[tuple[float, Callable[[], None]]](), list[tuple[str, bool]]()
    monkeypatch.setattr(module, "monotonic", lambda: now)
    monkeypatch.setattr(module, "later", lambda seconds, act, _: timers.append((now + seconds, act)))
    bus, link = cut_bus(hub)
    other = hub.bus()
    CertainTokens(bus, names.tokens_key("*"), lambda *news: told.append(news))
    keys = [names.token_key(f"robot_{i}", "a") for i in range(30)]
    tokens = [other.declare_token(key) for key in keys]
    assert told == [(key, True) for key in keys]
    for token in tokens[2:]:
        token.close()
    ((now, look),) = timers
    timers.clear()
    look()
    assert (told[30:], timers) == ([(key, False) for key in keys[2:]], [])
    for token in tokens[:2]:
        token.close()
    link.set_link(False)
    other.declare_token(keys[0])
    link.set_link(True)
    while timers:
        now, look = timers.pop()
        look()
    assert told[58:] == [(keys[0], True), (keys[1], False)]
    assert now == GRACE + RETURN_GRACE
