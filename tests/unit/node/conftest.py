"""Fixtures of the runtime's tests."""

from collections.abc import Callable, Iterator

import pytest

import zteam
from zteam.bus import MemoryHub
from zteam.node.shutdown import Stop


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
