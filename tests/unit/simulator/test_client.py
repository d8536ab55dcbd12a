"""The client against a scripted simulator: long steps, pauses that hold, changes, refusals."""

from collections.abc import Callable, Iterator

import pytest

from support.control_harness import TICK, ControlHarness
from support.limits import ASKED
from zteam import names
from zteam.bus import Change, MemoryHub
from zteam.bus.transport import TIMED_OUT
from zteam.errors import BusError, UsageError
from zteam.simulator import client as simulator
from zteam.simulator.client import SimStatus, SimulatorClient, StepRequest
from zteam.simulator.process.pacing import Pacer

Make = Callable[..., tuple[ControlHarness, SimulatorClient]]


@pytest.fixture
def make() -> Iterator[Make]:
    """Makes scripted simulators that end with the test, each with a client."""
    made: list[ControlHarness] = []

    def make_desk(speed: float | None = None, *, paused: bool = True) -> tuple[ControlHarness, SimulatorClient]:
        desk = ControlHarness(Pacer(TICK, speed, paused=paused))
        made.append(desk)
        desk.wait_for_tick(1)
        return desk, SimulatorClient(desk.bus)

    yield make_desk
    for desk in made:
        desk.close()


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long steps are looked at all the time."""
    monkeypatch.setattr(simulator, "LOOK", 0.01)


def test_a_step_is_exact(make: Make) -> None:
    """The world stands so many ticks further on, and not one more."""
    _, client = make()
    assert client.stand(ASKED).stands
    for ticks, reached in ((1, 2), (3, 5), (1000, 1005)):
        status = client.step(ticks)
        assert (status.tick, status.paused) == (reached, True)
    assert client.status().tick == 1005


@pytest.mark.usefixtures("often")
def test_a_step_outlasts_any_query(make: Make) -> None:
    """However long a tick takes it is waited for, with a word now and then; no query waits longer than LOOK."""
    desk, client = make()
    client.step()
    desk.free.clear()
    heard: list[int] = []

    def on_progress(status: SimStatus) -> None:
        heard.append(status.tick)
        if len(heard) == 5:
            desk.free.set()

    assert client.step(10, on_progress=on_progress).tick == 12
    assert heard[1:5] == [3, 3, 3, 3]


@pytest.mark.usefixtures("often")
def test_a_step_ends_when_somebody_else_sets_the_pace(make: Make) -> None:
    """A pause or a resume ends the steps of other clients, which would never be done."""
    desk, client = make()
    other = SimulatorClient(desk.bus)

    def pause(_status: SimStatus) -> None:
        desk.bus.ask(names.service_key(names.SIMULATOR, "pause"), SimStatus, Change())
        desk.free.set()

    def resume(_status: SimStatus) -> None:
        other.resume()
        desk.free.set()

    for _ in range(20):
        desk.free.clear()
        status = client.step(1_000_000_000, on_progress=pause)
        assert status.paused
        assert status.tick < 1_000_000_000
    desk.free.clear()
    assert not client.step(1_000_000_000, on_progress=resume).paused


def test_a_step_ends_with_the_run(make: Make) -> None:
    """Where `--for` is over it stands, and says so; a further step is refused with the way out."""
    desk, client = make()
    desk.last = 10
    status = client.step(50)
    assert (status.tick, status.finished) == (10, True)
    with pytest.raises(BusError, match=r"^the run is over: 'zteam sim reset' starts it again$"):
        client.step()


@pytest.mark.parametrize("ticks", [0, -1, 10**13])
def test_a_step_needs_ticks(make: Make, ticks: int) -> None:
    """A wrong number of ticks is refused before the simulator is asked."""
    _, client = make()
    with pytest.raises(UsageError, match="give a number of ticks"):
        client.step(ticks)


def test_a_paused_world_stands(make: Make) -> None:
    """When `pause` has returned no further tick comes, until a client asks for one."""
    desk, client = make(paused=False)
    desk.wait_for_tick(10)
    status = client.pause()
    assert status.paused
    # A change goes through the main loop, which would tick before.
    assert client.remove(3).tick == status.tick
    assert client.status().tick == status.tick
    assert not client.resume().paused
    desk.wait_for_tick(status.tick + 10)


def test_a_paused_world_stands_at_once(make: Make) -> None:
    """A slow world does not wait for its next tick to be due before it says that it stands."""
    _, client = make(speed=1e-9, paused=False)
    assert not client.stand(0.0).stands
    client.pause()
    assert client.stand(0.0).stands


def test_a_pause_does_not_wait_for_who_holds_the_tick(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """In lock-step the tick at hand may never end: the answer comes all the same."""
    monkeypatch.setattr(simulator, "SETTLE", 0.05)
    desk, client = make()
    assert client.stand(ASKED).stands
    desk.free.clear()
    desk.ask_aside("step", SimStatus, StepRequest(5))
    desk.wait_for_tick(2)
    assert client.pause().paused
    assert not client.stand(0.0).stands


def test_whether_the_world_stands_is_never_old_news(make: Make) -> None:
    """Right after it was let go on it does not stand, whatever its main loop has seen of that."""
    _, client = make()
    for _ in range(50):
        client.resume()
        assert not client.stand(0.0).stands
        client.pause()
        assert client.stand(0.0).stands


def test_the_pace_is_asked_for(make: Make) -> None:
    """A factor, or as fast as possible."""
    desk, client = make(speed=1e-9, paused=False)
    assert client.set_speed(1000.0).speed == 1000.0
    desk.wait_for_tick(20)
    assert client.set_speed(None).speed is None


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf"), 1e7])
def test_a_speed_is_a_number(make: Make, speed: float) -> None:
    """NaN and the like would arrive as something else, so they are refused here."""
    _, client = make()
    with pytest.raises(UsageError, match="give simulated seconds a second"):
        client.set_speed(speed)
    assert client.status().speed is None


def test_a_reset_world_stands_at_its_first_tick(make: Make) -> None:
    """Paused, it is there when `reset` returns, so that steps count from there; running, it goes on."""
    desk, client = make()
    for _ in range(20):
        client.step(3)
        assert client.reset().tick == 1
        assert client.step(3).tick == 4
    client.resume()
    assert not client.reset().paused
    desk.wait_for_tick(5)


def test_robots_come_and_go(make: Make) -> None:
    """The world is told what was asked, and the new robot's id comes back."""
    desk, client = make()
    assert client.spawn(1.5, -2.0, 0.3, model="box", robot_id=7) == 7
    assert client.move(7, 0.0, 1.0).tick == 1
    assert client.remove(7).tick == 1
    assert [what for what, _ in desk.world.made] == ["spawn 1.5", "move 7", "remove 7"]


def test_a_pose_is_finite(make: Make) -> None:
    """NaN and infinity are refused before the simulator is asked."""
    desk, client = make()
    with pytest.raises(UsageError, match="finite"):
        client.spawn(float("nan"), 0.0)
    with pytest.raises(UsageError, match="finite"):
        client.move(0, 0.0, 0.0, float("-inf"))
    assert desk.world.made == []


def test_a_refusal_is_the_simulators_own_text(make: Make) -> None:
    """No key in front of it."""
    _, client = make()
    with pytest.raises(BusError, match=r"^no robot 9 in this world$"):
        client.remove(9)


def test_the_report_is_asked_for(make: Make) -> None:
    """It comes as it is."""
    _, client = make()
    client.step(4)
    assert client.report().ticks == 5


def test_without_a_simulator_there_is_a_way_out() -> None:
    """Whatever was asked."""
    client = SimulatorClient(MemoryHub().bus())
    for ask in (client.status, client.pause, client.step, client.reset):
        with pytest.raises(BusError, match="no simulator is there: start one with 'zteam-sim WORLD'"):
            ask()


def test_a_simulator_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A time-out becomes a sentence with the next step."""
    bus = MemoryHub().bus()
    monkeypatch.setattr(bus.transport, "get", lambda *_: [TIMED_OUT])
    with pytest.raises(BusError, match="the simulator does not answer within 10 s: see 'zteam doctor'"):
        SimulatorClient(bus).status()
