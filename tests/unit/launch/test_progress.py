"""GO and the end of a run, as the launcher hears them on the bus."""

import itertools
import threading
from contextlib import nullcontext
from typing import Any

import pytest

from support.limits import LIMIT
from support.lockstep_doubles import ScriptedMonitor
from zteam import names
from zteam.bus import NoRequest
from zteam.bus.memory import MemoryHub
from zteam.errors import ZteamError
from zteam.launch.progress import Progress, Watched
from zteam.messages import TeamState, TeamStatus
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import FinishReply, FinishRequest, SimStatus


class Runner:
    """The only process of a run; it ends after some looks at it."""

    def __init__(self, looks: int) -> None:
        self.looks = looks

    def watched(self) -> list[Watched]:
        """What the launcher sees of it now."""
        self.looks = max(0, self.looks - 1)
        return [Watched("robot_0", ended=self.looks == 0)]


def test_go_is_noted_once(hub: MemoryHub) -> None:
    """Waiting is not GO, and the time of the first GO stays."""
    moments = itertools.count(1.5)
    progress, team = Progress(hub.bus(), False, lambda: next(moments)), ScriptedMonitor(hub)
    team.say(TeamState.WAITING)
    assert progress.go_after is None
    team.give_go(stamp=100)
    assert progress.go_after == 1.5
    team.give_go(stamp=200)
    assert progress.go_after == 1.5


def test_an_earlier_go_counts(hub: MemoryHub) -> None:
    """GO is latched: a launcher that subscribes late gets it."""
    ScriptedMonitor(hub).give_go()
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
    ScriptedMonitor(hub).give_go()
    for _ in range(3):
        assert asked.acquire(timeout=LIMIT)
    assert progress.wall is None
    over.set()
    with progress.changed:
        assert progress.changed.wait_for(lambda: progress.wall is not None, LIMIT)
    assert progress.wall is not None and progress.go_after is not None
    assert progress.wall >= progress.go_after


@pytest.mark.parametrize("has_gone", [False, True])
def test_a_team_without_go_is_given_up(hub: MemoryHub, has_gone: bool) -> None:
    """After --go-timeout the run fails with the monitor's words for what is missing; after GO it goes on."""
    moments = itertools.count(0.1, 0.1)
    progress, stop = Progress(hub.bus(), False, lambda: next(moments)), Stop()
    hub.bus().publisher(names.TEAM_STATUS, TeamStatus).put(TeamStatus(waiting_for="robot_3: no process yet"))
    if has_gone:
        ScriptedMonitor(hub).give_go()
    robot = Runner(4)
    if has_gone:
        progress.watch(stop, robot.watched, str, 0.25)
        assert robot.looks == 0
    else:
        with pytest.raises(ZteamError, match=r"no GO within 0\.25 s: waiting for robot_3: no process yet"):
            progress.watch(stop, robot.watched, str, 0.25)


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
    moments = itertools.count(0.1, 0.1)
    progress, robot = Progress(hub.bus(), False, lambda: next(moments)), Runner(4)
    ScriptedMonitor(hub).give_go()
    if status:
        answer = SimStatus("arena", [0], 100_000_000, 1, 0, real_time_factor=1.0, **status)
        hub.bus().serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: answer)
    with pytest.raises(ZteamError, match=told) if told else nullcontext():
        progress.watch(Stop(), robot.watched, str, 0.25)
    assert (robot.looks == 0) == (not told)


def test_without_a_limit_the_simulator_is_not_asked(hub: MemoryHub) -> None:
    """A run without a time limit sends no request for its end."""
    asked = threading.Event()

    def finish(_: FinishRequest) -> FinishReply:
        asked.set()
        return FinishReply(True)

    hub.bus().serve(names.service_key(names.SIMULATOR, "finish"), FinishRequest, finish)
    progress = Progress(hub.bus(), False)
    ScriptedMonitor(hub).give_go()
    assert progress.wall is None
    assert not asked.is_set()
