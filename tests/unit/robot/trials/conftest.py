"""What all tests of trials need."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from zteam.robot.trials import check


@pytest.fixture(autouse=True)
def patient_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    """A crowded machine makes no step too slow."""
    monkeypatch.setattr(check, "TICK", 2.0)
    monkeypatch.setattr(check, "HANGS_AFTER", 30.0)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder in which the test stands and Python finds modules."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        if name.startswith("mine_"):
            del sys.modules[name]
