"""GO and the end of a run, as the launcher hears them on the bus."""

import itertools
import threading

import pytest

from support.monitor_voice import MonitorVoice
from zteam import names
from zteam.bus.memory import MemoryHub
from zteam.launch.progress import Progress
from zteam.messages import TeamState
from zteam.services.simulator import FinishReply, FinishRequest

LIMIT = 30.0


def test_go_is_noted_once(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Waiting is not GO, and the time of the first GO stays."""
    moments = itertools.count(1.5)
    monkeypatch.setattr("zteam.launch.progress.seconds_since_start", lambda: next(moments))
    progress, team = Progress(hub.bus(), False), MonitorVoice(hub.bus())
    team.status(TeamState.WAITING)
    assert progress.go_after is None
    team.status(TeamState.GO, 100)
    assert progress.go_after == 1.5
    team.status(TeamState.GO, 200)
    assert progress.go_after == 1.5


def test_an_earlier_go_counts(hub: MemoryHub) -> None:
    """GO is latched: a launcher that subscribes late gets it."""
    MonitorVoice(hub.bus()).status(TeamState.GO)
    assert Progress(hub.bus(), False).go_after is not None


def test_the_simulator_decides_the_end(hub: MemoryHub) -> None:
    """The run is over when the simulator answers that it is finished, and not before."""
    asked, over = threading.Semaphore(0), threading.Event()

    def finish(request: FinishRequest) -> FinishReply:
        asked.release()
        over.wait(min(request.timeout, 0.01))
        return FinishReply(over.is_set())

    hub.bus().serve(names.service_key(names.SIMULATOR, "finish"), FinishRequest, finish)
    progress = Progress(hub.bus(), True)
    MonitorVoice(hub.bus()).status(TeamState.GO)
    for _ in range(3):
        assert asked.acquire(timeout=LIMIT)
    assert progress.wall is None
    over.set()
    with progress.changed:
        assert progress.changed.wait_for(lambda: progress.wall is not None, LIMIT)
    assert progress.wall is not None and progress.go_after is not None
    assert progress.wall >= progress.go_after


def test_without_a_limit_the_simulator_is_not_asked(hub: MemoryHub) -> None:
    """A run without a time limit sends no request for its end."""
    asked = threading.Event()

    def finish(_: FinishRequest) -> FinishReply:
        asked.set()
        return FinishReply(True)

    hub.bus().serve(names.service_key(names.SIMULATOR, "finish"), FinishRequest, finish)
    progress = Progress(hub.bus(), False)
    MonitorVoice(hub.bus()).status(TeamState.GO)
    assert progress.wall is None
    assert not asked.is_set()
