"""Losses of tokens that are told once they are certain."""

import threading

import pytest

from support.cuttable_transport import cut_bus
from support.limits import LIMIT
from support.lockstep_doubles import SHORT
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.node import tokens
from zteam.node.tokens import CertainTokens

KEY = names.token_key("robot_1", "a")


class Told:
    """What was told, in its order."""

    def __init__(self) -> None:
        self.told: list[tuple[str, bool]] = []
        self.changed = threading.Condition()

    def take(self, key: str, alive: bool) -> None:
        with self.changed:
            self.told.append((key, alive))
            self.changed.notify_all()

    def wait_for(self, *expected: tuple[str, bool]) -> None:
        with self.changed:
            assert wait_until(self.changed, lambda: self.told == [*expected], LIMIT), self.told


def test_a_loss_with_the_link_up_is_told(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """A token that comes is told at once, and its loss a moment later."""
    monkeypatch.setattr(tokens, "GRACE", SHORT)
    told = Told()
    CertainTokens(hub.bus(), names.tokens_key(), told.take)
    token = hub.bus().declare_token(KEY)
    assert told.told == [(KEY, True)]
    token.close()
    told.wait_for((KEY, True), (KEY, False))


def test_one_timer_serves_all_losses(hub: MemoryHub) -> None:
    """A router that goes takes the tokens of a thousand robots along; each has its own moment."""
    told, other = Told(), hub.bus()
    keys = [names.token_key(f"robot_{i}", "a") for i in range(30)]
    CertainTokens(hub.bus(), names.tokens_key(), told.take)
    tokens = [other.declare_token(key) for key in keys]
    for token in tokens:
        token.close()
    assert sum(thread.name == "tokens" for thread in threading.enumerate()) <= 1
    told.wait_for(*[(key, True) for key in keys], *[(key, False) for key in keys])


def test_a_loss_with_the_link_is_told_only_if_the_token_stays_away(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two tokens that vanish with the link, only the one that does not come back is lost."""
    monkeypatch.setattr("zteam.node.tokens.RETURN_GRACE", SHORT)
    bus, link = cut_bus(hub)
    told, other, gone = Told(), hub.bus(), names.token_key("robot_2", "b")
    CertainTokens(bus, names.tokens_key(), told.take)
    tokens = [other.declare_token(key) for key in (KEY, gone)]
    for token in tokens:
        token.close()
    link.set_link(False)
    other.declare_token(KEY)
    link.set_link(True)
    told.wait_for((KEY, True), (gone, True), (KEY, True), (gone, False))
