"""`zteam sim` with a scripted simulator: its requests and its output."""

import io
import json
import sys
from collections.abc import Callable, Iterator

import pytest

from support.control_harness import TICK, ControlHarness
from support.limits import ASKED
from zteam.bus import MemoryHub
from zteam.cli import main as zteam
from zteam.cli import sim
from zteam.cli.live_line import ProgressLine
from zteam.simulator import client as simulator
from zteam.simulator.client import SimStatus, SimulatorClient, StepRequest
from zteam.simulator.process.pacing import Pacer

Output = Callable[..., str]


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[ControlHarness]:
    """A simulator with a world paused at its first tick; `zteam` commands find it."""
    desk = ControlHarness(Pacer(TICK, None, paused=True))
    desk.wait_for_tick(1)
    SimulatorClient(desk.bus).stand(ASKED)
    monkeypatch.setattr(sim, "open_bus", lambda _options: desk.hub.bus())
    yield desk
    desk.close()


@pytest.fixture
def output(capsys: pytest.CaptureFixture[str]) -> Output:
    """Runs `zteam sim WORDS`, checks for exit code 0, and returns the output."""

    def run(*words: str) -> str:
        assert zteam.main(["sim", *words]) == 0
        return capsys.readouterr().out.rstrip("\n")

    return run


@pytest.mark.usefixtures("desk")
def test_each_verb_prints_its_result_on_one_line(output: Output) -> None:
    """The line has the time and tick, the pace, or the robots that are left."""
    assert output("pause") == "paused at 0.001 s (tick 1)"
    assert output("speed", "2.5") == "2.5 simulated seconds a second, after 'zteam sim resume': the world is paused"
    assert output("reset") == "reset, paused at 0.001 s (tick 1)"
    assert output("spawn", "--pose", "1.5", "-2", "-1e-1", "--model", "box") == "7"
    assert output("move", "0", "-1.5", "2", "-0.3") == "robot 0 is at x -1.5, y 2, yaw -0.3"
    assert output("remove", "0") == "robot 0 is removed; robots left: -"
    assert output("speed", "max") == "as fast as possible, after 'zteam sim resume': the world is paused"
    assert output("resume") == "resumed at 0.001 s (tick 1), as fast as possible"


def test_negative_numbers_are_values(desk: ControlHarness, output: Output) -> None:
    """A negative number in any notation is a value, as a positional argument and for an option."""
    output("move", "0", "-1e1", "-.5", "-2")
    output("spawn", "--id", "3", "--pose", "-1.5e0", "-2", "-0", "--json")
    assert [what for what, _ in desk.world.made] == ["move 0", "spawn -1.5"]


def test_force_is_sent_only_with_its_flag(desk: ControlHarness, output: Output) -> None:
    """`move` and `spawn` ask for force with --force, and not without."""
    for force in ([], ["--force"]):
        output("move", "0", "1", "2", "0", *force)
        output("spawn", "--pose", "1", "2", "0", *force)
    assert [what for what, _ in desk.world.made] == ["move 0", "spawn 1", "move 0 by force", "spawn 1 by force"]


@pytest.mark.usefixtures("desk")
def test_status_is_a_table(output: Output) -> None:
    """The status has one line per value."""
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


@pytest.mark.usefixtures("desk")
def test_a_step_prints_the_new_status(output: Output) -> None:
    """After a step of three ticks the output is the table of `status` at that tick."""
    stepped = output("step", "3").splitlines()
    assert stepped[1:3] == ["time              0.004 s", "tick              4, 1 ms each"]
    assert stepped == output("status").splitlines()


def test_status_names_the_participants_of_a_lock_step() -> None:
    """In lock-step the status names participants, joining ones, the one waited for, and hung ones."""
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
    """With --json a verb prints the whole status."""
    reply = json.loads(output(*words, "--json"))
    assert set(reply) == set(SimStatus.__struct_fields__)


@pytest.mark.usefixtures("desk")
def test_json_of_spawn_is_the_new_id(output: Output) -> None:
    """With --json `spawn` prints the id, and a later `move` of that robot the status."""
    assert json.loads(output("spawn", "--pose", "0", "0", "0", "--json")) == {"id": 7}
    assert json.loads(output("move", "7", "0", "0", "0", "--json"))["tick"] == 1


@pytest.mark.usefixtures("desk")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("step", "0"), "give a number of ticks from 1 to"),
        (("step", "-3"), "'-3': give a number of ticks"),
        (("step", "1.5"), "give a number of ticks"),
        (("step", "9" * 30), "give a number of ticks"),
        (("speed", "fast"), "give simulated seconds a second"),
        (("speed", "nan"), "give simulated seconds a second"),
        (("speed", "1e-11"), "speed '1e-11': give simulated seconds a second from 1e-06 to 1e+06, or max"),
        (("move", "0", "1e308", "2", "0"), "pose '1e308 2 0': give X Y YAW in metres and radians from -1e+06 to 1e+06"),
        (("spawn", "--pose", "0", "0", "1e7"), "pose '0 0 1e7': give X Y YAW"),
        (("move", "0", "1", "2", "90"), "YAW 90 is more than a full turn; angles are radians (90 degrees are 1.5708)"),
        (("remove", "robot_3"), "remove: 'robot_3': give robot ids"),
        (("move", "robot_3", "1", "2", "0"), "robot id 'robot_3' is not a whole number from 0 to 9999; give 3"),
        (("move", "0", "1", "2", "nan"), "pose '1 2 nan': give X Y YAW in metres and radians"),
        (("move", "0", "-inf", "2", "0"), "pose '-inf 2 0': give X Y YAW"),
        (("move", "-1", "1", "2", "3"), "robot id '-1' is not a whole number"),
        (("remove", "robot_0"), "remove: 'robot_0': give robot ids from 0 to 9999"),
        (("remove", "3-1"), "remove: '3-1': the first id is above the last"),
        (("spawn", "--pose", "a", "0", "0"), "pose 'a 0 0': give X Y YAW"),
        (("spawn", "--id", "10000", "--pose", "0", "0", "0"), "robot id '10000' is not"),
    ],
)
def test_mistakes_end_with_two(words: tuple[str, ...], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A wrong command line ends with 2 and one line with the fix and the verb's usage, without a request."""
    with pytest.raises(SystemExit) as end:
        zteam.main(["sim", *words])
    assert end.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert said.err.startswith(f"zteam sim {words[0]}: ")
    assert text in said.err
    assert f"; usage: zteam sim {words[0]} " in said.err


def test_several_robots_are_removed(desk: ControlHarness, output: Output) -> None:
    """Ids and ranges name the robots, which are removed in this order."""
    assert output("remove", "4,0-2", "7") == "robots 0-2, 4, 7 are removed; robots left: -"
    assert [what for what, _ in desk.world.made] == [f"remove {i}" for i in (4, 0, 1, 2, 7)]


@pytest.mark.usefixtures("desk")
def test_a_refusal_within_a_list_tells_what_was_removed(capsys: pytest.CaptureFixture[str]) -> None:
    """The robots before the one that is refused are gone, and the error names them."""
    assert zteam.main(["sim", "remove", "3-9"]) == 1
    assert capsys.readouterr().err == "zteam sim: no robot 9 in this world; removed before: 3-8\n"


@pytest.mark.usefixtures("desk")
def test_a_refusal_ends_with_one(capsys: pytest.CaptureFixture[str]) -> None:
    """A refused request ends with 1 and one line with the simulator's reason."""
    assert zteam.main(["sim", "remove", "9"]) == 1
    assert capsys.readouterr().err == "zteam sim: no robot 9 in this world\n"


def test_without_a_simulator(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a simulator a verb ends with 1 and one line that says how to start one."""
    monkeypatch.setattr(sim, "open_bus", lambda _options: MemoryHub().bus())
    assert zteam.main(["sim", "step", "5"]) == 1
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "start one with 'zteam-sim WORLD'" in said


def test_a_finished_run_does_not_resume(
    desk: ControlHarness, output: Output, capsys: pytest.CaptureFixture[str]
) -> None:
    """After the end of a run, `resume` and `step` report it and name `zteam sim reset`."""
    desk.last = 3
    assert "paused            run over" in output("step", "10")
    assert output("resume") == "the run is over at 0.003 s (tick 3): 'zteam sim reset' starts it again"
    assert zteam.main(["sim", "step"]) == 1
    assert "'zteam sim reset' starts it again" in capsys.readouterr().err


def test_a_long_step_reports_its_progress(
    desk: ControlHarness, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The progress goes to stderr and names Ctrl+C; standard output has only the reply."""
    monkeypatch.setattr(simulator, "LOOK", 0.01)
    monkeypatch.setattr(sim, "PATIENCE", 0.0)
    desk.free.clear()
    show = ProgressLine.show

    def show_and_free(progress: ProgressLine, text: str) -> None:
        show(progress, text)
        if desk.world.tick > 1:
            desk.free.set()

    monkeypatch.setattr(ProgressLine, "show", show_and_free)
    assert zteam.main(["sim", "step", "400", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["tick"] == 401
    assert "of 400 ticks, now at 0.001 s (tick 1), real-time factor 1 (Ctrl+C pauses)" in said.err.splitlines()[0]


def test_an_interrupted_step_pauses_the_world(
    desk: ControlHarness, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl+C cancels the remaining ticks."""

    def interrupt(_progress: object, _text: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(sim, "PATIENCE", 0.0)
    monkeypatch.setattr(ProgressLine, "show", interrupt)
    assert zteam.main(["sim", "step", "1000000000"]) == 130
    assert "paused at" in capsys.readouterr().err
    status = SimulatorClient(desk.bus).stand(ASKED).status
    assert status.paused
    assert status.tick < 1000000000


class CallbackOutput(io.StringIO):
    """An output stream that calls a function at each write."""

    def __init__(self, on_write: Callable[[], None]) -> None:
        super().__init__()
        self._on_write = on_write

    def write(self, text: str) -> int:
        self._on_write()
        return super().write(text)


@pytest.mark.ci
def test_a_long_change_reports_what_it_waits_for(desk: ControlHarness, monkeypatch: pytest.MonkeyPatch) -> None:
    """A change that waits for the end of a tick names the command that shows the reason."""
    desk.free.clear()
    desk.ask_aside("step", SimStatus, StepRequest(1))
    desk.wait_for_tick(2)
    stderr = CallbackOutput(desk.free.set)
    monkeypatch.setattr(sys, "stderr", stderr)
    assert zteam.main(["sim", "remove", "3"]) == 0
    assert stderr.getvalue() == (
        "waiting for the current tick to end; 'zteam sim status' names what it waits for (Ctrl+C to give up)\n"
    )
    assert desk.world.made == [("remove 3", 2)]
