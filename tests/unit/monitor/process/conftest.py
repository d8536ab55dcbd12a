"""Fixtures of the monitor's tests."""

from collections.abc import Iterator

import pytest

from support.limits import LIMIT
from support.monitor_desk import Desk, HostTime, Open
from zteam.bus import MemoryHub
from zteam.monitor.process import display, watch
from zteam.monitor.process.display import Lines
from zteam.node import process_node
from zteam.node.process_options import MonitorOptions


@pytest.fixture
def open_desk(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> Iterator[Open]:
    """Starts monitors that wait for `ids` or `team_size` robots."""
    time, desks = HostTime(), list[Desk]()
    for module in (display, watch):
        monkeypatch.setattr(module, "monotonic", time)
    # Whoever is there answers, however crowded the machine is.
    monkeypatch.setattr(process_node, "ANSWER_LIMIT", LIMIT)
    monkeypatch.setattr(watch, "_ANSWER_LIMIT", LIMIT)

    def make(
        *ids: int,
        team_size: int = 0,
        exit_on_go: bool = False,
        go_timeout: float | None = None,
        output: Lines | None = None,
        in_world: bool = False,
    ) -> Desk:
        options = MonitorOptions(
            team_size or len(ids), ids or None, exit_on_go=exit_on_go, go_timeout=go_timeout, in_world=in_world
        )
        desks.append(Desk(hub, time, options, output))
        return desks[-1]

    yield make
    for desk in desks:
        desk.end()
