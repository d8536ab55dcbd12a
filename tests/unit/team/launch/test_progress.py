"""What the launcher notices of its team: GO and the end of a run, processes that are back, and the team at a glance."""

import threading
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

from support.cuttable_transport import cut_bus
from support.limits import LIMIT
from support.lockstep_doubles import ScriptedMonitor
from support.log_capture import captured_log
from zteam import names
from zteam.bus import NoRequest
from zteam.bus.memory import MemoryHub
from zteam.clock import monotonic, pause
from zteam.errors import ZteamError
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus
from zteam.monitor.observer import TeamObserver
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Restarted, restarts_text
from zteam.simulator.client import FinishReply, SimStatus, WaitRequest
from zteam.team.launch import progress as module
from zteam.team.launch.progress import Progress, TeamOverview


def make_progress(hub: MemoryHub) -> Progress:
    """The progress of a run on this hub, which began 1.5 s before the host's clock did."""
    return Progress(TeamObserver(hub.bus()), lambda: monotonic() + 1.5, dict)


def serve_status(hub: MemoryHub, status: SimStatus) -> list[None]:
    """Answer `sim/status`; one item for each question."""
    asked: list[None] = []
    key = names.service_key(names.SIMULATOR, "status")
    hub.bus().serve(key, NoRequest, lambda _: (asked.append(None), status)[1])
    return asked


def put_status(hub: MemoryHub, robot_id: int, **values: Any) -> None:
    """A robot's status."""
    publisher = hub.bus().publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)
    publisher.put(RobotStatus(robot_id=robot_id, **values))


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
    # GO is latched: a launcher that subscribes late gets it.
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
    progress = make_progress(hub)
    progress.watch_end(ended.set)
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
    with nullcontext() if has_gone else pytest.raises(ZteamError, match="robot_3: no process yet"):
        progress.check_begun(0.25)


@pytest.mark.parametrize(
    ("status", "is_held"),
    [
        ({"lockstep": True, "tick": 1, "waiting_for": "planner"}, True),
        ({"lockstep": True, "tick": 2, "waiting_for": "planner"}, False),
        ({"lockstep": True, "tick": 1, "waiting_for": ""}, False),
        ({"lockstep": False, "tick": 1, "waiting_for": ""}, False),
        ({}, False),
    ],
)
def test_a_held_first_tick_is_given_up_too(hub: MemoryHub, status: dict[str, Any], is_held: bool) -> None:
    """GO is out when the robots are ready; lock-step may wait for a node that never comes. Anything else goes on."""
    progress = make_progress(hub)
    ScriptedMonitor(hub).give_go()
    if status:
        serve_status(hub, SimStatus("arena", [0], 100_000_000, 1, 0, real_time_factor=1.0, **status))
    with pytest.raises(ZteamError, match="planner") if is_held else nullcontext():
        progress.check_begun(0.25)


class Watched:
    """The progress of a team whose processes, link and host clock are the test's."""

    def __init__(self, hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr(module, "monotonic", lambda: self.now)
        self.counts: dict[str, int] = {}
        bus, self.link = cut_bus(hub)
        self.progress = Progress(TeamObserver(bus), lambda: 0.0, lambda: self.counts)
        self._hub = hub

    def fail(self, name: str) -> None:
        """The process fails now, and is started again."""
        self.counts[name] = self.counts.get(name, 0) + 1
        self.progress.note_failure(name)

    def come(self, name: str, after: float) -> None:
        """Its token comes `after` host seconds."""
        self.now += after
        bus = self._hub.bus()
        bus.declare_token(names.token_key(name, bus.instance))


@pytest.fixture
def watched(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> Watched:
    """A team in which nothing has failed yet."""
    return Watched(hub, monkeypatch)


def test_a_process_is_back_with_its_token(watched: Watched) -> None:
    """It is told once; the longest time is kept; a process that never failed is not told of. With another simulator the
    world is not where it was."""
    with captured_log() as log:
        watched.come(names.MONITOR, 0.0)
        for name, after in ((names.AGGREGATOR, 0.25), (names.AGGREGATOR, 1.25), (names.SIMULATOR, 0.5)):
            watched.fail(name)
            watched.come(name, after)
        watched.come(names.AGGREGATOR, 5.0)
    assert [line.split()[0] for line in log.lines] == ["tf", "tf", "sim"]
    assert "stands at its start" in log.lines[-1] and "stands" not in log.lines[0]
    assert watched.progress.restarted() == {names.AGGREGATOR: Restarted(2, 1.25), names.SIMULATOR: Restarted(1, 0.5)}


def test_a_robot_is_back_when_it_is_ready(hub: MemoryHub, watched: Watched) -> None:
    """Not with its token, and not with what its dead process has sent before. If it fails before that, it is away from
    the first failure on: the user waits for it all that time."""
    watched.fail("robot_1")
    put_status(hub, 1, is_ready=True)
    watched.come("robot_1", 0.25)
    put_status(hub, 1, is_ready=False)
    watched.fail("robot_1")
    watched.come("robot_1", 0.25)
    assert watched.progress.away == {}
    watched.now += 0.5
    put_status(hub, 1, is_ready=True)
    assert watched.progress.away == {"robot_1": 1.0}


def test_the_router_is_back_with_the_link(watched: Watched) -> None:
    """A link that is lost and back while the router lives is no recovery of it."""
    watched.link.set_link(False)
    watched.link.set_link(True)
    watched.fail(ROUTER)
    watched.now += 0.5
    watched.link.set_link(True)
    assert watched.progress.restarted() == {ROUTER: Restarted(1, 0.5)}


def test_restarts_are_told_in_one_line() -> None:
    """With the time that each was away, if it came back; nothing without any."""
    assert restarts_text({}) == ""
    text = restarts_text({"tf": Restarted(2, 1.25), "camera": Restarted(1)})
    assert text == "started again: camera 1 time, tf 2 times (back after 1.2 s)"


def test_a_robot_drives_if_it_runs_without_a_reason_to_stand(hub: MemoryHub) -> None:
    """Robots that are ready, that stand, that are lost and that are not of the team do not count."""
    watch = TeamOverview(TeamObserver(hub.bus()), range(5), is_simulated=False)
    put_status(hub, 0, state=RobotState.READY)
    put_status(hub, 2, state=RobotState.RUNNING, reason="obstacle 0.3 m ahead")
    for i in (1, 3, 7):
        put_status(hub, i, state=RobotState.RUNNING)
    assert (watch.look().driving, watch.look().robots) == (2, 5)
    hub.bus().publisher(names.TEAM_STATUS, TeamStatus, latched=True).put(TeamStatus(lost=np.array([3], np.int32)))
    assert watch.look().driving == 1


def test_the_time_counts_from_go(hub: MemoryHub) -> None:
    """It is unknown before GO and without a simulator."""
    watch, voice = TeamOverview(TeamObserver(hub.bus()), [0], is_simulated=True), ScriptedMonitor(hub)
    assert (watch.look().begun, watch.look().elapsed) == (False, None)
    voice.say(TeamState.WAITING)
    assert not watch.look().begun
    voice.give_go(stamp=500_000_000)
    assert (watch.look().begun, watch.look().elapsed) == (True, None)
    serve_status(hub, SimStatus("w", [0], 100_000_000, 1, 2_000_000_000, 20, 1.0))
    assert watch.look().elapsed == 1.5


def test_a_tick_that_is_open_at_two_looks_is_held(hub: MemoryHub) -> None:
    """Every tick waits for participants; it is held if it is still the same one at the next look, and not paused. A
    simulator that is not the team's is not asked."""
    status = SimStatus("w", [0], 100_000_000, 1, 0, 5, 1.0, lockstep=True, waiting_for="robot_1")
    asked = serve_status(hub, status)
    assert TeamOverview(TeamObserver(hub.bus()), [0], is_simulated=False).look().simulator is None
    assert asked == []
    watch = TeamOverview(TeamObserver(hub.bus()), [0], is_simulated=True)
    assert [watch.look().held_by for _ in range(2)] == ["", "robot_1"]
    status.paused = True
    assert watch.look().held_by == ""
    status.paused, status.tick = False, 6
    assert watch.look().held_by == ""
