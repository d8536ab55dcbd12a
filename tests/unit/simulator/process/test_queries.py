"""The simulator's queries with a scripted simulation, and what it tells views of the world."""

import threading
from collections.abc import Callable, Iterator

import pytest

from support.control_harness import TICK, ControlHarness
from support.limits import ASKED, LIMIT
from support.small_worlds import make_box, make_robot, make_world
from zteam.bus import Bus, Change, MemoryHub, NoRequest
from zteam.clock import wait_until
from zteam.errors import BusError
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import Engine
from zteam.simulator.client import (
    FinishReply,
    MoveRequest,
    ObstaclesReply,
    RemoveRequest,
    ShapesReply,
    SimReport,
    SimStatus,
    SpawnReply,
    SpawnRequest,
    SpeedRequest,
    StandReply,
    StepRequest,
    WaitRequest,
)
from zteam.simulator.process.pacing import Pacer
from zteam.simulator.process.queries import serve_shapes

Make = Callable[..., ControlHarness]


@pytest.fixture
def make() -> Iterator[Make]:
    """Makes harnesses that end with the test."""
    made: list[ControlHarness] = []

    def make_harness(speed: float | None = None, *, paused: bool = True) -> ControlHarness:
        made.append(ControlHarness(Pacer(TICK, speed, paused=paused)))
        return made[-1]

    yield make_harness
    for harness in made:
        harness.close()


def test_steps_are_answered_when_the_world_stands_again(make: Make) -> None:
    """After the first tick, which is sent in any case, it goes exactly as far as it is told."""
    harness = make()
    for ticks, reached in ((1, 2), (3, 5), (100, 105)):
        status = harness.ask("step", SimStatus, StepRequest(ticks))
        assert (status.tick, status.paused) == (reached, True)
        assert not harness.world.ticking
    assert harness.ask("status").tick == 105


def test_a_step_is_not_answered_before_its_tick_is_over(make: Make) -> None:
    """The open tick, which a participant may hold, belongs to the step."""
    harness = make()
    harness.ask("step", SimStatus, StepRequest(1))
    harness.free.clear()
    answers = harness.ask_aside("step", SimStatus, StepRequest(2))
    harness.wait_for_tick(3)
    assert answers == []
    harness.free.set()
    harness.join()
    assert [status.tick for status in answers] == [4]


def test_steps_of_several_askers_add_up(make: Make) -> None:
    """Each is answered when the world stands, which is when all their ticks are done."""
    harness = make()
    harness.ask("step", SimStatus, StepRequest(1))
    harness.free.clear()
    first = harness.ask_aside("step", SimStatus, StepRequest(10))
    harness.wait_for_tick(3)
    second = harness.ask_aside("step", SimStatus, StepRequest(20))
    with harness.node.changed:
        assert wait_until(harness.node.changed, lambda: harness.pacer.steps == 29, LIMIT)
    assert (first, second) == ([], [])
    harness.free.set()
    harness.join()
    assert (first[0].tick, second[0].tick) == (32, 32)


def test_a_step_stops_a_running_world(make: Make) -> None:
    """It takes so many more ticks and then stands still, without a pause request."""
    harness = make(paused=False)
    harness.wait_for_tick(10)
    harness.free.clear()
    with harness.world.changed:
        assert wait_until(harness.world.changed, lambda: harness.world.ticking, LIMIT)
    before = harness.world.tick
    answers = harness.ask_aside("step", SimStatus, StepRequest(5))
    with harness.node.changed:
        assert wait_until(harness.node.changed, lambda: harness.pacer.paused, LIMIT)
    harness.free.set()
    harness.join()
    assert answers[0].paused
    assert before + 5 <= answers[0].tick <= before + 6
    assert harness.ask("status").tick == answers[0].tick


def test_pause_and_resume(make: Make) -> None:
    """A running world stands still after the open tick, and resumes; each answer has the new state."""
    harness = make(paused=False)
    harness.wait_for_tick(5)
    assert harness.ask("pause").paused
    stood = harness.ask("step", SimStatus, StepRequest(1)).tick
    assert harness.ask("status").tick == stood
    assert not harness.ask("resume").paused
    harness.wait_for_tick(stood + 5)


def test_the_next_tick_may_be_due_in_centuries(make: Make) -> None:
    """No wait overflows, and another speed ends it."""
    harness = make(speed=1e-300, paused=False)
    harness.wait_for_tick(1)
    assert not harness.ask("stand", StandReply, WaitRequest(0.1)).stands
    harness.ask("speed", SimStatus, SpeedRequest(1000.0))
    harness.wait_for_tick(5)


@pytest.mark.parametrize(
    ("service", "request_"),
    [
        ("speed", SpeedRequest(1e-11)),
        ("speed", SpeedRequest(1e300)),
        ("move", MoveRequest(0, 1e308, 0.0)),
        ("move", MoveRequest(0, 0.0, 0.0, -1e7)),
        ("spawn", SpawnRequest(0.0, -1e308)),
    ],
)
def test_numbers_without_bounds_are_refused(make: Make, service: str, request_: Change) -> None:
    """The error names the bound, also for clients other than zteam's; nothing is changed."""
    harness = make()
    with pytest.raises(BusError, match="bad request: Expected `float`"):
        harness.ask(service, SimStatus, request_)
    assert harness.world.made == []
    assert harness.pacer.speed is None


def test_a_status_tells_the_instance(make: Make) -> None:
    """Requests for changes have to carry this id."""
    harness = make()
    assert harness.ask("status").instance == harness.node.bus.instance


def test_a_new_speed_is_taken_at_once(make: Make) -> None:
    """A world that waits long for its next tick does not wait for that first."""
    harness = make(speed=1e-9, paused=False)
    harness.wait_for_tick(1)
    assert harness.ask("speed", SimStatus, SpeedRequest(1000.0)).speed == 1000.0
    harness.wait_for_tick(20)
    assert harness.ask("speed", SimStatus, SpeedRequest(None)).speed is None
    harness.wait_for_tick(harness.world.tick + 20)


def test_status_and_report_do_not_wait_for_the_open_tick(make: Make) -> None:
    """They are answered while a participant holds the world."""
    harness = make()
    harness.free.clear()
    harness.ask_aside("step", SimStatus, StepRequest(1))
    harness.wait_for_tick(2)
    assert harness.ask("status").tick == 2
    assert harness.ask("report", SimReport).ticks == 2


def test_changes_are_made_between_two_ticks(make: Make) -> None:
    """They wait for the end of the open tick; the main loop makes them in the order of the requests."""
    harness = make()
    harness.free.clear()
    step = harness.ask_aside("step", SimStatus, StepRequest(1))
    harness.wait_for_tick(2)
    spawned = harness.ask_aside("spawn", SpawnReply, SpawnRequest(1.5, 2.0))
    with harness.node.changed:
        assert wait_until(harness.node.changed, lambda: bool(harness.boundary._changes), LIMIT)
    assert harness.world.made == []
    harness.free.set()
    harness.join()
    assert step[0].tick == 2
    assert spawned == [SpawnReply(7)]
    for service, request in (("move", MoveRequest(3, 0.0, 0.0)), ("remove", RemoveRequest(3))):
        assert harness.ask(service, SimStatus, request).tick == 2
    assert harness.ask("repeat").tick == 2
    assert harness.world.made == [("spawn 1.5", 2), ("move 3", 2), ("remove 3", 2), ("repeat", 2)]
    assert harness.world.places == {(harness.thread.ident, False)}


def test_a_running_world_is_changed_too(make: Make) -> None:
    """Changes do not need a paused world."""
    harness = make(paused=False)
    for i in range(20):
        harness.ask("spawn", SpawnReply, SpawnRequest(float(i), 0.0))
    assert [what for what, _ in harness.world.made] == [f"spawn {i}" for i in range(20)]
    assert harness.world.places == {(harness.thread.ident, False)}


def test_what_cannot_be_done_comes_back_as_text(make: Make) -> None:
    """The error says why, and the world goes on."""
    harness = make()
    with pytest.raises(BusError, match="no robot 9 in this world"):
        harness.ask("remove", SimStatus, RemoveRequest(9))
    with pytest.raises(BusError, match="bad request"):
        harness.ask("step", SimStatus, StepRequest(0))
    with pytest.raises(BusError, match="bad request"):
        harness.ask("speed", SimStatus, SpeedRequest(-1.0))
    assert harness.ask("step", SimStatus, StepRequest(2)).tick == 3


def test_a_change_does_not_wait_for_ever(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """When the open tick does not end, the error names the command that shows why."""
    monkeypatch.setattr("zteam.simulator.client.BOUNDARY_LIMIT", 0.05)
    harness = make()
    harness.free.clear()
    harness.ask_aside("step", SimStatus, StepRequest(1))
    harness.wait_for_tick(2)
    with pytest.raises(BusError, match=r"did not end within 0\.05 s: see 'zteam sim status'"):
        harness.ask("spawn", SpawnReply, SpawnRequest(0.0, 0.0))


def test_finish_waits_for_the_end_of_the_run(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """It answers False after its time-out, and True as soon as the run is over."""
    harness = make()
    assert harness.ask("finish", FinishReply, WaitRequest(0.0)) == FinishReply(False)
    assert harness.ask("finish", FinishReply, WaitRequest(0.05)) == FinishReply(False)
    harness.last = 10
    waits, wait = threading.Event(), harness.boundary.wait_until_finished

    def note(timeout: float) -> bool:
        waits.set()
        return wait(timeout)

    monkeypatch.setattr(harness.boundary, "wait_until_finished", note)
    waiting = harness.ask_aside("finish", FinishReply, WaitRequest(ASKED))
    assert waits.wait(LIMIT)
    assert harness.ask("step", SimStatus, StepRequest(8)).tick == 9
    assert waiting == []
    harness.ask("step", SimStatus, StepRequest(1))
    harness.join()
    assert waiting == [FinishReply(True)]
    assert harness.ask("finish", FinishReply, WaitRequest(0.0)) == FinishReply(True)


def test_a_finished_world_stands_still(make: Make) -> None:
    """Steps beyond the end are answered at the end; further steps are refused, with the way out."""
    harness = make()
    harness.last = 10
    assert harness.ask("step", SimStatus, StepRequest(50)).tick == 10
    with pytest.raises(BusError, match="the run is over: 'zteam sim reset'"):
        harness.ask("step", SimStatus, StepRequest(1))
    harness.ask("resume")
    harness.ask("remove", SimStatus, RemoveRequest(1))
    assert harness.ask("status").tick == 10


def test_a_reset_sends_the_first_tick_even_while_paused(make: Make) -> None:
    """Otherwise no process would learn of the reset. After that tick the world stands still again."""
    harness = make()
    assert harness.ask("step", SimStatus, StepRequest(4)).tick == 5
    status = harness.ask("reset")
    assert (status.tick, status.paused) == (0, True)
    harness.wait_for_tick(1)
    assert harness.ask("repeat").tick == 1
    assert harness.ask("step", SimStatus, StepRequest(4)).tick == 5
    assert harness.world.made[0] == ("reset", 5)


def test_a_reset_lets_a_finished_world_run_again(make: Make) -> None:
    """The run is not over any more, and ends again."""
    harness = make()
    harness.last = 10
    harness.ask("resume")
    assert harness.ask("finish", FinishReply, WaitRequest(ASKED)).finished
    harness.last = 15
    harness.ask("reset")
    assert harness.ask("finish", FinishReply, WaitRequest(ASKED)).finished
    assert harness.ask("status").tick == 15
    assert harness.world.made == [("reset", 10)]


def test_steps_that_the_end_cut_off_are_not_made_up_for(make: Make) -> None:
    """After a reset a paused world stands at its first tick, whatever was asked of the run before."""
    harness = make()
    harness.last = 10
    harness.ask("step", SimStatus, StepRequest(50))
    harness.last = 30
    harness.ask("reset")
    harness.wait_for_tick(1)
    assert harness.ask("step", SimStatus, StepRequest(1)).tick == 2


def test_a_stop_request_ends_the_main_loop(make: Make) -> None:
    """Also while the world stands still."""
    harness = make()
    harness.wait_for_tick(1)
    harness.stop.request("test")
    harness.thread.join(LIMIT)
    assert not harness.thread.is_alive()


@pytest.fixture
def bus() -> Iterator[Bus]:
    """A bus in memory."""
    bus = MemoryHub().bus()
    yield bus
    bus.close()


def test_robots_have_their_outlines_and_models_their_names(bus: Bus) -> None:
    """`erratic` is known in every world; a robot that leaves is told no more."""
    world = make_world(make_robot())
    engine = Engine(world)
    serve_shapes(bus, world, engine)
    reply = bus.ask("sim/shapes", ShapesReply, NoRequest())
    assert (sorted(reply.robots), reply.models) == ([0], ["erratic"])
    assert all(len(polygon) >= 3 for polygon in reply.robots[0].outline)
    engine.remove(0)
    assert bus.ask("sim/shapes", ShapesReply, NoRequest()).robots == {}


def test_an_obstacle_that_is_pushed_is_told_where_it_is(bus: Bus) -> None:
    """A robot drives into a light box: its pose changes, that of the heavy one does not."""
    light, heavy = make_box("light", 0.6, 0.0, mass=0.5), make_box("heavy", 2.0, 2.0)
    world = make_world(make_robot(), others=(light, heavy))
    engine = Engine(world)
    serve_shapes(bus, world, engine)
    before = {each.name: each for each in bus.ask("sim/obstacles", ObstaclesReply, NoRequest()).obstacles}
    assert (before["light"].movable, before["heavy"].movable) == (True, False)
    for _ in range(20):
        engine.step({0: Twist(Vector3(0.5))})
    after = {each.name: each for each in bus.ask("sim/obstacles", ObstaclesReply, NoRequest()).obstacles}
    assert after["light"].x > before["light"].x + 0.1
    assert Pose2(after["heavy"].x, after["heavy"].y, 0.0) == Pose2(2.0, 2.0, 0.0)
