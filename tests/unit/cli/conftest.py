"""Runs commands in the test's own process, on the bus of the test."""

import pytest

from support.commands import Printed, Run, run_here
from zteam.bus import MemoryHub, graph
from zteam.cli import listening, tf


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs a command such as `zteam topic list`, which must end with `code`; what it has printed."""

    def run(command: str, code: int = 0) -> Printed:
        found = run_here(command)
        printed = Printed(*capsys.readouterr())
        assert found == code, printed
        return printed

    return run


@pytest.fixture
def tools(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> MemoryHub:
    """Tools find the bus of the test. Surveys are short: what is there was published before."""
    monkeypatch.setattr(listening, "connect", lambda *_, **__: hub.bus())
    for module in (graph, listening, tf):
        monkeypatch.setattr(module, "SURVEY", 0.02)
    return hub
