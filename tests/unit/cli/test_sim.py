"""`zteam sim`: what it asks and what it prints, with a simulator by script."""

import io
import json
import sys
from collections.abc import Callable, Iterator

import pytest

from support.control_harness import TICK, ControlHarness
from support.lockstep_doubles import LIMIT
from zteam.bus import MemoryHub
from zteam.cli import main as zteam
from zteam.cli import sim
from zteam.nodes.simulator.pacing import Pacer
from zteam.services import simulator_client
from zteam.services.simulator import SimStatus, StepRequest
from zteam.services.simulator_client import SimulatorClient

Output = Callable[..., str]


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[ControlHarness]:
    """A simulator whose world stands at its first tick; `zteam` commands find it."""
    desk = ControlHarness(Pacer(TICK, None, paused=True))
    desk.wait_for_tick(1)
    SimulatorClient(desk.bus).stand(LIMIT)
    monkeypatch.setattr(sim, "open_bus", lambda _options: desk.bus)
    yield desk
    desk.close()


@pytest.fixture
def output(capsys: pytest.CaptureFixture[str]) -> Output:
    """Runs `zteam sim WORDS`, which has to end well; what it prints."""

    def run(*words: str) -> str:
        assert zteam.main(["sim", *words]) == 0
        return capsys.readouterr().out.rstrip("\n")

    return run


@pytest.mark.usefixtures("desk")
def test_each_verb_says_on_one_line_what_came_of_it(output: Output) -> None:
    """Time and tick where they are, the pace, the robots that are left."""
    assert output("pause") == "paused at 0.001 s (tick 1)"
    assert output("speed", "2.5") == "2.5 simulated seconds a second, once the world goes on: it is paused"
    assert output("reset") == "everything as at the start, paused at 0.001 s (tick 1)"
    assert output("spawn", "--pose", "1.5", "-2", "-1e-1", "--model", "box") == "7"
    assert output("move", "0", "-1.5", "2", "-0.3") == "robot 0 stands at x -1.5, y 2, yaw -0.3"
    assert output("remove", "0") == "robot 0 is gone; the world has -"
    assert output("speed", "max") == "as fast as possible, once the world goes on: it is paused"
    assert output("resume") == "goes on at 0.001 s (tick 1), as fast as possible"


def test_negative_numbers_arrive(desk: ControlHarness, output: Output) -> None:
    """In any notation, as positions and as an option's values."""
    output("move", "0", "-1e1", "-.5", "-2")
    output("spawn", "--id", "3", "--pose", "-1.5e0", "-2", "-0", "--json")
    assert [what for what, _ in desk.world.made] == ["move 0", "spawn -1.5"]


def test_force_is_asked_for_by_flag(desk: ControlHarness, output: Output) -> None:
    """Without the flag the simulator may refuse a place."""
    for force in ([], ["--force"]):
        output("move", "0", "1", "2", "0", *force)
        output("spawn", "--pose", "1", "2", "0", *force)
    assert [what for what, _ in desk.world.made] == ["move 0", "spawn 1", "move 0 by force", "spawn 1 by force"]


@pytest.mark.usefixtures("desk")
def test_status_is_a_table(output: Output) -> None:
    """One line for each thing to know; a step ends with it."""
    table = [
        "world             scripted, seed 1",
        "time              0.001 s",
        "tick              1, 1 ms each",
        "speed             as fast as possible",
        "real-time factor  1",
        "paused            yes",
        "lock-step         no",
        "robots            -",
    ]
    assert output("status").splitlines() == table
    stepped = output("step", "3").splitlines()
    assert stepped[:3] == [table[0], "time              0.004 s", "tick              4, 1 ms each"]
    assert [line.split()[0] for line in stepped] == [line.split()[0] for line in table]


def test_status_names_who_holds_a_lock_step() -> None:
    """Participants, newcomers, who is waited for, and who was left behind."""
    status = SimStatus("arena", [0, 1], 100_000_000, 1, 200_000_000, 2, 9.87654, 2.0, False, True)
    status.participants, status.joining = ["robot_0", "tf"], ["robot_1"]
    status.waiting_for, status.hung, status.finished = "robot_0", ["planner"], True
    assert sim.format_status(status).splitlines()[3:] == [
        "speed             2 simulated seconds a second",
        "real-time factor  9.88",
        "paused            run over",
        "lock-step         yes",
        "  participants    robot_0, tf",
        "  joining         robot_1",
        "  waiting for     robot_0",
        "  hung            planner",
        "robots            0, 1",
    ]


@pytest.mark.usefixtures("desk")
@pytest.mark.parametrize(
    "words", [("pause",), ("resume",), ("step", "2"), ("speed", "3"), ("reset",), ("remove", "1"), ("status",)]
)
def test_json_is_the_reply(words: tuple[str, ...], output: Output) -> None:
    """The whole status, whatever was asked."""
    reply = json.loads(output(*words, "--json"))
    assert set(reply) == set(SimStatus.__struct_fields__)


@pytest.mark.usefixtures("desk")
def test_json_of_the_rest(output: Output) -> None:
    """A new robot's id; the status after a move."""
    assert json.loads(output("spawn", "--pose", "0", "0", "0", "--json")) == {"id": 7}
    assert json.loads(output("move", "7", "0", "0", "0", "--json"))["tick"] == 1


@pytest.mark.usefixtures("desk")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("step", "0"), "give a number of ticks from 1 to"),
        (("step", "-3"), "step '-3': give a number of ticks"),
        (("step", "1.5"), "give a number of ticks"),
        (("step", "9" * 30), "give a number of ticks"),
        (("speed", "fast"), "give simulated seconds a second"),
        (("speed", "nan"), "give simulated seconds a second"),
        (("speed", "1e-11"), "speed '1e-11': give simulated seconds a second from 1e-06 to 1e+06, or max"),
        (("move", "0", "1e308", "2", "0"), "pose '1e308 2 0': give X Y YAW in metres and radians from -1e+06 to 1e+06"),
        (("spawn", "--pose", "0", "0", "1e7"), "pose '0 0 1e7': give X Y YAW"),
        (("move", "0", "1", "2", "nan"), "pose '1 2 nan': give X Y YAW in metres and radians"),
        (("move", "0", "-inf", "2", "0"), "pose '-inf 2 0': give X Y YAW"),
        (("move", "-1", "1", "2", "3"), "robot id '-1' is not a whole number"),
        (("remove", "robot_0"), "robot id 'robot_0' is not a whole number"),
        (("spawn", "--pose", "a", "0", "0"), "pose 'a 0 0': give X Y YAW"),
        (("spawn", "--id", "10000", "--pose", "0", "0", "0"), "robot id '10000' is not"),
    ],
)
def test_mistakes_end_with_two(words: tuple[str, ...], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One line that names the way out, before anybody is asked."""
    assert zteam.main(["sim", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert text in said.err


@pytest.mark.usefixtures("desk")
def test_a_refusal_ends_with_one(capsys: pytest.CaptureFixture[str]) -> None:
    """One line with the simulator's reason."""
    assert zteam.main(["sim", "remove", "9"]) == 1
    assert capsys.readouterr().err == "zteam sim: no robot 9 in this world\n"


def test_without_a_simulator(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """One line with the way out, and 1."""
    monkeypatch.setattr(sim, "open_bus", lambda _options: MemoryHub().bus())
    assert zteam.main(["sim", "step", "5"]) == 1
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "start one with 'zteam-sim WORLD'" in said


def test_a_run_that_is_over_does_not_go_on(
    desk: ControlHarness, output: Output, capsys: pytest.CaptureFixture[str]
) -> None:
    """`resume` and `step` say so, and how to start again."""
    desk.last = 3
    assert "paused            run over" in output("step", "10")
    assert output("resume") == "the run is over at 0.003 s (tick 3): 'zteam sim reset' starts it again"
    assert zteam.main(["sim", "step"]) == 1
    assert "'zteam sim reset' starts it again" in capsys.readouterr().err


def test_a_long_step_says_how_it_gets_on(
    desk: ControlHarness, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On stderr, so that the output stays the reply; and who waits is told how to give up."""
    monkeypatch.setattr(simulator_client, "LOOK", 0.01)
    monkeypatch.setattr(sim, "PATIENCE", 0.0)
    desk.free.clear()
    tell = sim._Progress.tell

    def tell_and_free(progress: sim._Progress, status: SimStatus) -> None:
        tell(progress, status)
        if desk.world.tick > 1:
            desk.free.set()

    monkeypatch.setattr(sim._Progress, "tell", tell_and_free)
    assert zteam.main(["sim", "step", "400", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["tick"] == 401
    assert "of 400 ticks, now at 0.001 s (tick 1), real-time factor 1 (Ctrl+C pauses)" in said.err.splitlines()[0]


def test_a_step_that_is_given_up_pauses_the_world(
    desk: ControlHarness, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl+C leaves no steps behind that nobody waits for."""

    def interrupt(_progress: object, _status: SimStatus) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(sim._Progress, "tell", interrupt)
    assert zteam.main(["sim", "step", "1000000000"]) == 130
    assert "paused at" in capsys.readouterr().err
    status = SimulatorClient(desk.bus).stand(LIMIT).status
    assert status.paused
    assert status.tick < 1000000000


class Listener(io.StringIO):
    """An output that does something when it is written to."""

    def __init__(self, heard: Callable[[], None]) -> None:
        super().__init__()
        self._heard = heard

    def write(self, text: str) -> int:
        self._heard()
        return super().write(text)


def test_a_change_that_takes_long_says_what_it_waits_for(desk: ControlHarness, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody may hold the tick at hand: after a while the user hears who can tell."""
    desk.free.clear()
    desk.ask_aside("step", SimStatus, StepRequest(1))
    desk.wait_for_tick(2)
    listener = Listener(desk.free.set)
    monkeypatch.setattr(sys, "stderr", listener)
    assert zteam.main(["sim", "remove", "3"]) == 0
    assert listener.getvalue() == (
        "waiting for the tick at hand to end; 'zteam sim status' says who holds it (Ctrl+C to give up)\n"
    )
    assert desk.world.made == [("remove 3", 2)]
