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
def warm(monkeypatch: pytest.MonkeyPatch) -> Iterator[WarmParent]:
    """A warm parent that also forks the obedient child of these tests."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(TESTS), os.environ.get("PYTHONPATH")])))
    monkeypatch.setattr(warm_parent, "runs_zteam", lambda _command: True)
    with closing(WarmParent()) as parent:
        yield parent
