"""GO and the end of a run, as the launcher hears them on the bus."""

import threading
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import pytest

from support.limits import LIMIT
from support.lockstep_doubles import ScriptedMonitor
from zteam import names
from zteam.bus import NoRequest
from zteam.bus.memory import MemoryHub
from zteam.clock import monotonic, pause
from zteam.errors import ZteamError
from zteam.messages import TeamState, TeamStatus
from zteam.monitor.observer import TeamObserver
from zteam.simulator.client import FinishReply, SimStatus, WaitRequest
from zteam.team.launch.progress import Progress


def make_progress(hub: MemoryHub, on_end: Callable[[], None] | None = None) -> Progress:
    """The progress of a run on this hub, which began 1.5 s before the host's clock did; with `on_end` it has an end."""
    on_end, has_end = on_end or (lambda: None), on_end is not None
    return Progress(TeamObserver(hub.bus()), has_end, on_end, lambda: monotonic() + 1.5)


def test_go_is_noted_once(hub: MemoryHub) -> None:
    """Waiting is not GO, and the time of the first GO stays."""
    progress, team = make_progress(hub), ScriptedMonitor(hub)
    team.say(TeamState.WAITING)
    assert progress.go_after is None
    before = monotonic()
    team.give_go(stamp=100)
    after = monotonic()
    pause(0.05)
    team.give_go(stamp=200)
    assert progress.go_after is not None
    assert before - 1e-3 <= progress.go_after - 1.5 <= after + 1e-3


def test_an_earlier_go_counts(hub: MemoryHub) -> None:
    """GO is latched: a launcher that subscribes late gets it."""
    ScriptedMonitor(hub).give_go()
    assert make_progress(hub).go_after is not None


def test_the_simulator_decides_the_end(hub: MemoryHub) -> None:
    """The run is over when the simulator answers that it is finished, and not before."""
    asked, over = threading.Semaphore(0), threading.Event()

    def finish(request: WaitRequest) -> FinishReply:
        asked.release()
        over.wait(min(request.timeout, 0.01))
        return FinishReply(over.is_set())

    hub.bus().serve(names.service_key(names.SIMULATOR, "finish"), WaitRequest, finish)
    ended = threading.Event()
    progress = make_progress(hub, ended.set)
    ScriptedMonitor(hub).give_go()
    for _ in range(3):
        assert asked.acquire(timeout=LIMIT)
    assert progress.wall is None
    over.set()
    assert ended.wait(LIMIT)
    assert progress.wall is not None and progress.go_after is not None
    assert progress.wall >= progress.go_after


@pytest.mark.parametrize("has_gone", [False, True])
def test_a_team_without_go_is_given_up(hub: MemoryHub, has_gone: bool) -> None:
    """After --go-timeout the run fails with the monitor's words for what is missing; after GO it goes on."""
    progress = make_progress(hub)
    hub.bus().publisher(names.TEAM_STATUS, TeamStatus).put(TeamStatus(waiting_for="robot_3: no process yet"))
    if has_gone:
        ScriptedMonitor(hub).give_go()
    refused = pytest.raises(ZteamError, match=r"no GO within 0\.25 s: waiting for robot_3: no process yet")
    with nullcontext() if has_gone else refused:
        progress.check_begun(0.25)


@pytest.mark.parametrize(
    ("status", "told"),
    [
        (
            {"lockstep": True, "tick": 1, "waiting_for": "planner"},
            "the first tick is held for 0.25 s: waiting for planner",
        ),
        ({"lockstep": True, "tick": 2, "waiting_for": "planner"}, ""),
        ({"lockstep": True, "tick": 1, "waiting_for": ""}, ""),
        ({"lockstep": False, "tick": 1, "waiting_for": ""}, ""),
        ({}, ""),
    ],
)
def test_a_held_first_tick_is_given_up_too(hub: MemoryHub, status: dict[str, Any], told: str) -> None:
    """GO is out when the robots are ready; lock-step may wait for a node that never comes. Anything else goes on."""
    progress = make_progress(hub)
    ScriptedMonitor(hub).give_go()
    if status:
        answer = SimStatus("arena", [0], 100_000_000, 1, 0, real_time_factor=1.0, **status)
        hub.bus().serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: answer)
    with pytest.raises(ZteamError, match=told) if told else nullcontext():
        progress.check_begun(0.25)


def test_without_a_limit_the_simulator_is_not_asked(hub: MemoryHub) -> None:
    """A run without a time limit sends no request for its end."""
    asked = threading.Event()

    def finish(_: WaitRequest) -> FinishReply:
        asked.set()
        return FinishReply(True)

    hub.bus().serve(names.service_key(names.SIMULATOR, "finish"), WaitRequest, finish)
    progress = make_progress(hub)
    ScriptedMonitor(hub).give_go()
    assert progress.wall is None
    assert not asked.is_set()
