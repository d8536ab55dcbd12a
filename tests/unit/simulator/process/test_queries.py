"""The simulator's queries, asked by its client of a scripted simulation, and what it tells views of the world."""

import math
from collections.abc import Callable, Iterator
from unittest.mock import Mock

import pytest

from support.control_harness import TICK, ControlHarness
from support.limits import ASKED, LIMIT
from support.small_worlds import make_box, make_robot, make_world
from zteam.bus import Change, MemoryHub, NoRequest
from zteam.bus.transport import TIMED_OUT
from zteam.clock import wait_until
from zteam.errors import BusError, UsageError
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import Engine
from zteam.simulator import client as simulator
from zteam.simulator.client import (
    FinishReply,
    MoveRequest,
    ObstaclesReply,
    RemoveRequest,
    ShapesReply,
    SimStatus,
    SimulatorClient,
    SpawnReply,
    SpawnRequest,
    SpeedRequest,
    StepRequest,
    WaitRequest,
)
from zteam.simulator.process.node import serve_shapes
from zteam.simulator.process.pacing import Pacer

Make = Callable[..., tuple[ControlHarness, SimulatorClient]]


@pytest.fixture
def make() -> Iterator[Make]:
    """Makes scripted simulators that end with the test, each with a client."""
    made: list[ControlHarness] = []

    def make_harness(speed: float | None = None, *, paused: bool = True) -> tuple[ControlHarness, SimulatorClient]:
        harness = ControlHarness(Pacer(TICK, speed, paused=paused))
        made.append(harness)
        harness.wait_for_tick(1)
        return harness, SimulatorClient(harness.bus)

    yield make_harness
    for harness in made:
        harness.close()


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long steps are looked at all the time."""
    monkeypatch.setattr(simulator, "LOOK", 0.01)


def test_a_step_is_exact(make: Make) -> None:
    """After the first tick, which is sent in any case, the world goes exactly as far as it is told, and stands."""
    harness, client = make()
    for ticks, reached in ((1, 2), (3, 5), (100, 105)):
        status = client.step(ticks)
        assert (status.tick, status.paused) == (reached, True)
        assert not harness.world.ticking
    assert (client.status().tick, client.report().ticks) == (105, 105)


def test_a_step_is_not_answered_before_its_tick_is_over(make: Make) -> None:
    """The open tick, which a participant may hold, belongs to the step; status and report do not wait for it."""
    harness, client = make()
    client.step()
    harness.free.clear()
    answers = harness.ask_aside("step", SimStatus, StepRequest(2))
    harness.wait_for_tick(3)
    assert (client.status().tick, client.report().ticks, answers) == (3, 3, [])
    harness.free.set()
    harness.join()
    assert [status.tick for status in answers] == [4]


def test_a_step_is_waited_for_however_long_it_takes(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """A request to answer when the world stands is answered then, also after hours."""
    harness, _ = make()
    waits = Mock(wraps=harness.node.changed.wait_until)
    monkeypatch.setattr(harness.node.changed, "wait_until", waits)
    harness.ask("step", SimStatus, StepRequest(100))
    assert min(timeout for (_, timeout), _ in waits.call_args_list) > 1e6


@pytest.mark.usefixtures("often")
def test_a_step_outlasts_any_query(make: Make) -> None:
    """However long a tick takes it is waited for, with a word now and then; no query waits longer than LOOK."""
    harness, client = make()
    client.step()
    harness.free.clear()
    heard: list[int] = []

    def on_progress(status: SimStatus) -> None:
        heard.append(status.tick)
        if len(heard) == 5:
            harness.free.set()

    assert client.step(10, on_progress=on_progress).tick == 12
    assert heard[1:5] == [3, 3, 3, 3]


@pytest.mark.usefixtures("often")
@pytest.mark.parametrize("service", ["pause", "resume"])
def test_a_step_ends_when_somebody_else_sets_the_pace(make: Make, service: str) -> None:
    """A pause or a resume ends the steps of other clients, which would never be done."""
    harness, client = make()

    def set_pace(_status: SimStatus) -> None:
        harness.ask(service)
        harness.free.set()

    harness.free.clear()
    status = client.step(1_000_000_000, on_progress=set_pace)
    assert (status.paused, status.tick < 1_000_000_000) == (service == "pause", True)


def test_a_world_stands_where_the_run_ends(make: Make) -> None:
    """Steps beyond the end are answered there, and further ones refused; after a reset, which ends the steps that were
    still to go, the world runs again."""
    harness, client = make()
    harness.last = 10
    status = client.step(50)
    assert (status.tick, status.finished) == (10, True)
    with pytest.raises(BusError, match=r"^the run is over: 'zteam sim reset'"):
        client.step()
    client.resume()
    assert client.remove(1).tick == 10
    harness.last = 15
    client.pause()
    assert client.reset().tick == 1
    assert client.step().tick == 2
    client.resume()
    assert harness.ask("finish", FinishReply, WaitRequest(ASKED)).finished
    assert client.status().tick == 15


def test_finish_waits_for_the_end_of_the_run(make: Make) -> None:
    """It answers False after its time-out, and True as soon as the run is over."""
    harness, client = make()
    assert harness.ask("finish", FinishReply, WaitRequest(0.05)) == FinishReply(False)
    harness.last = 10
    waiting = harness.ask_aside("finish", FinishReply, WaitRequest(ASKED))
    client.step(8)
    assert waiting == []
    client.step()
    harness.join()
    assert waiting == [FinishReply(True)]


def test_a_paused_world_stands(make: Make) -> None:
    """When `pause` has returned no further tick comes, until a client asks for one."""
    harness, client = make(paused=False)
    harness.wait_for_tick(10)
    status = client.pause()
    assert status.paused
    # A change goes through the main loop, which would tick before.
    assert client.remove(3).tick == status.tick
    assert client.status().tick == status.tick
    assert not client.resume().paused
    harness.wait_for_tick(status.tick + 10)


def test_a_pause_does_not_wait_for_who_holds_the_tick(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """In lock-step the tick at hand may never end: the answer comes all the same."""
    monkeypatch.setattr(simulator, "SETTLE", 0.05)
    harness, client = make()
    assert client.stand(ASKED).stands
    harness.free.clear()
    harness.ask_aside("step", SimStatus, StepRequest(5))
    harness.wait_for_tick(2)
    assert client.pause().paused
    assert not client.stand(0.0).stands


def test_whether_the_world_stands_is_never_old_news(make: Make) -> None:
    """Right after it was let go on it does not stand, whatever its main loop has seen of that."""
    _, client = make()
    for _ in range(10):
        client.resume()
        assert not client.stand(0.0).stands
        client.pause()
        assert client.stand(0.0).stands


def test_another_pace_is_taken_at_once(make: Make) -> None:
    """The next tick may be due in centuries: no wait overflows, and another speed ends it."""
    harness, client = make(speed=1e-300, paused=False)
    assert not client.stand(0.1).stands
    assert client.set_speed(1000.0).speed == 1000.0
    harness.wait_for_tick(20)
    assert client.set_speed(None).speed is None
    harness.wait_for_tick(harness.world.tick + 20)


def test_changes_are_made_between_two_ticks(make: Make) -> None:
    """They wait for the end of the open tick; the main loop makes them in the order of the requests."""
    harness, client = make()
    harness.free.clear()
    step = harness.ask_aside("step", SimStatus, StepRequest(1))
    harness.wait_for_tick(2)
    spawned = harness.ask_aside("spawn", SpawnReply, SpawnRequest(1.5, 2.0))
    with harness.node.changed:
        assert wait_until(harness.node.changed, lambda: bool(harness.boundary._changes), LIMIT)
    assert harness.world.made == []
    harness.free.set()
    harness.join()
    assert (step[0].tick, spawned) == (2, [SpawnReply(7)])
    assert client.spawn(-1.5, -2.0, 0.3, model="box", robot_id=7, force=True) == 7
    assert client.move(3, 0.0, 1.0, force=True).tick == client.remove(3).tick == client.repeat().tick == 2
    assert harness.world.made == [
        (made, 2) for made in ("spawn 1.5", "spawn -1.5 by force", "move 3 by force", "remove 3", "repeat")
    ]
    assert harness.world.places == {(harness.thread.ident, False)}


def test_a_change_does_not_wait_for_ever(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """When the open tick does not end, the error names the command that shows why."""
    monkeypatch.setattr("zteam.simulator.client.BOUNDARY_LIMIT", 0.05)
    harness, client = make()
    harness.free.clear()
    harness.ask_aside("step", SimStatus, StepRequest(1))
    harness.wait_for_tick(2)
    with pytest.raises(BusError, match="zteam sim status"):
        client.spawn(0.0, 0.0)


@pytest.mark.parametrize(
    ("service", "request_", "why"),
    [
        ("remove", RemoveRequest(9), "no robot 9 in this world$"),
        ("step", StepRequest(0), "bad request"),
        ("speed", SpeedRequest(-1.0), "bad request"),
        ("speed", SpeedRequest(1e-11), "bad request"),
        ("speed", SpeedRequest(1e300), "bad request"),
        ("move", MoveRequest(0, 1e308, 0.0), "bad request"),
        ("move", MoveRequest(0, 0.0, 0.0, -1e9), "bad request"),
        ("spawn", SpawnRequest(0.0, -1e308), "bad request"),
    ],
)
def test_what_cannot_be_done_is_refused(make: Make, service: str, request_: Change, why: str) -> None:
    """Also for clients other than zteam's; nothing is changed, and the world goes on."""
    harness, client = make()
    with pytest.raises(BusError, match=why):
        harness.ask(service, SimStatus, request_)
    assert (harness.world.made, harness.pacer.speed) == ([], None)
    assert client.step().tick == 2


@pytest.mark.parametrize(
    ("ask", "why"),
    [
        *((lambda client, ticks=ticks: client.step(ticks), "step: ticks") for ticks in (0, -1, 10**13)),
        *(
            (lambda client, speed=speed: client.set_speed(speed), "speed: speed")
            for speed in (0.0, -1.0, math.nan, math.inf, 1e7)
        ),
        (lambda client: client.spawn(math.nan, 0.0), "spawn: x: a number of at least"),
        (lambda client: client.move(0, 0.0, 0.0, -math.inf), "move: yaw"),
    ],
)
def test_numbers_are_refused_before_they_are_sent(
    make: Make, ask: Callable[[SimulatorClient], object], why: str
) -> None:
    """NaN and the like would arrive as something else; the error names the number in plain words."""
    harness, client = make()
    with pytest.raises(UsageError, match=f"^sim/{why}.* is expected, not "):
        ask(client)
    assert (harness.world.made, client.status().speed, client.status().tick) == ([], None, 1)


def test_a_reset_world_stands_at_its_first_tick(make: Make) -> None:
    """Paused, that tick is sent, or no process would learn of the reset, and steps count from there; running, the world
    goes on."""
    harness, client = make()
    client.step(3)
    assert client.reset().tick == 1
    assert client.step(3).tick == 4
    assert harness.world.made == [("reset", 4)]
    client.resume()
    assert not client.reset().paused
    harness.wait_for_tick(5)


def test_a_simulator_that_is_not_there_or_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the next step in both cases."""
    bus = MemoryHub().bus()
    with pytest.raises(BusError, match="no simulator is there"):
        SimulatorClient(bus).pause()
    monkeypatch.setattr(bus.transport, "get", lambda *_: [TIMED_OUT])
    with pytest.raises(BusError, match="does not answer within 10 s"):
        SimulatorClient(bus).status()


def test_robots_have_their_outlines_and_models_their_names(hub: MemoryHub) -> None:
    """`erratic` is known in every world; a robot that leaves is told no more."""
    world, bus = make_world(make_robot()), hub.bus()
    engine = Engine(world)
    serve_shapes(bus, world, engine)
    reply = bus.ask("sim/shapes", ShapesReply, NoRequest())
    assert (sorted(reply.robots), reply.models) == ([0], ["erratic"])
    assert all(len(polygon) >= 3 for polygon in reply.robots[0].outline)
    engine.remove(0)
    assert bus.ask("sim/shapes", ShapesReply, NoRequest()).robots == {}


def test_an_obstacle_that_is_pushed_is_told_where_it_is(hub: MemoryHub) -> None:
    """A robot drives into a light box: its pose changes, that of the heavy one does not."""
    light, heavy = make_box("light", 0.6, 0.0, mass=0.5), make_box("heavy", 2.0, 2.0)
    world, bus = make_world(make_robot(), others=(light, heavy)), hub.bus()
    engine = Engine(world)
    serve_shapes(bus, world, engine)
    before = {each.name: each for each in bus.ask("sim/obstacles", ObstaclesReply, NoRequest()).obstacles}
    assert (before["light"].movable, before["heavy"].movable) == (True, False)
    for _ in range(20):
        engine.step({0: Twist(Vector3(0.5))})
    after = {each.name: each for each in bus.ask("sim/obstacles", ObstaclesReply, NoRequest()).obstacles}
    assert after["light"].x > before["light"].x + 0.1
    assert Pose2(after["heavy"].x, after["heavy"].y, 0.0) == Pose2(2.0, 2.0, 0.0)
