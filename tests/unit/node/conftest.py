"""Fixtures of the runtime's tests."""

from collections.abc import Callable, Iterator

import pytest

import zteam
from support.lockstep_doubles import ScriptedSimulator
from support.participant_desk import NAME, Desk
from zteam.bus import MemoryHub
from zteam.messages import Done
from zteam.node.shutdown import Stop


@pytest.fixture
def script(hub: MemoryHub) -> ScriptedSimulator:
    """A simulator with its token."""
    script = ScriptedSimulator(hub, NAME)
    script.appear()
    return script


@pytest.fixture
def desk(hub: MemoryHub, script: ScriptedSimulator) -> Iterator[Desk]:
    """A present process that has just asked to be let in, and heard that it is (ticks from 2 on are for it)."""
    desk = Desk(hub.bus())
    desk.node.become_present()
    script.tick(1)
    assert script.take() == [Done(1, 1)]
    yield desk
    desk.node.close()


@pytest.fixture
def make(hub: MemoryHub) -> Iterator[Callable[..., zteam.Node]]:
    """Makes a user's nodes that end with the test."""
    made: list[zteam.Node] = []

    def make_node(name: str = "planner") -> zteam.Node:
        made.append(zteam.Node(name, hub.bus(), Stop()))
        return made[-1]

    yield make_node
    for node in made:
        node.close()
