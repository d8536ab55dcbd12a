"""Fixtures of the runtime's tests."""

from collections.abc import Callable, Iterator

import pytest

from support.lockstep_doubles import ScriptedSimulator
from support.own_node import Own
from support.participant_desk import NAME, Desk
from zteam.bus import MemoryHub
from zteam.messages import Done


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
def make(hub: MemoryHub) -> Iterator[Callable[..., Own]]:
    """Makes nodes that end with the test."""
    made: list[Own] = []

    def start(*arguments: object) -> Own:
        made.append(Own(hub, *arguments))  # type: ignore[arg-type]
        return made[-1]

    yield start
    for own in made:
        own.close()
