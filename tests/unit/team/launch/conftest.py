"""Fixtures of children."""

import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from zteam.team.launch import warm_parent
from zteam.team.launch.warm_parent import WarmParent

TESTS = Path(__file__).parents[3]


@pytest.fixture
def lifeline() -> Iterator[int]:
    """The read end of a pipe as the supervisor hands it to children."""
    reader, writer = os.pipe()
    yield reader
    os.close(reader)
    os.close(writer)


@pytest.fixture
def warm(monkeypatch: pytest.MonkeyPatch) -> Iterator[WarmParent]:
    """A warm parent that also forks the obedient child of these tests."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(TESTS), os.environ.get("PYTHONPATH")])))
    monkeypatch.setattr(warm_parent, "_is_own", lambda _command: True)
    with closing(WarmParent()) as parent:
        yield parent
