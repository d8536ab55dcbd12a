"""`zteam sim` with a scripted simulator: its requests and its output."""

import json
from collections.abc import Iterator

import pytest

from support.commands import Run
from support.control_harness import TICK, ControlHarness
from support.limits import ASKED
from zteam.bus import MemoryHub
from zteam.cli import listening, sim
from zteam.node.live_line import ProgressLine
from zteam.simulator import client as simulator
from zteam.simulator.client import SimStatus, SimulatorClient
from zteam.simulator.process.pacing import Pacer


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[ControlHarness]:
    """A simulator with a world paused at its first tick; `zteam` commands find it."""
    desk = ControlHarness(Pacer(TICK, None, paused=True))
    desk.wait_for_tick(1)
    SimulatorClient(desk.bus).stand(ASKED)
    monkeypatch.setattr(listening, "connect", lambda *_, **__: desk.hub.bus())
    yield desk
    desk.close()


@pytest.mark.usefixtures("desk")
def test_each_verb_prints_its_result_on_one_line(run: Run) -> None:
    """The line has the time and tick, the pace, or the robots that are left; status and step print a table."""
    for words, told in {
        "pause": "paused at 0.001 s (tick 1)",
        "speed 2.5": "2.5 simulated seconds a second, after 'zteam sim resume': the world is paused",
        "reset": "reset, paused at 0.001 s (tick 1)",
        "spawn --pose 1.5 -2 -1e-1 --model box": "7",
        "move 0 -1.5 2 -0.3": "robot 0 is at x -1.5, y 2, yaw -0.3",
        "remove 0": "robot 0 is removed; robots left: -",
        "remove 4,0-2 7": "robots 0-2, 4, 7 are removed; robots left: -",
        "speed max": "as fast as possible, after 'zteam sim resume': the world is paused",
    }.items():
        assert run(f"zteam sim {words}").out == f"{told}\n"
    stepped = run("zteam sim step 3").out
    assert stepped == run("zteam sim status").out
    assert [line.split(maxsplit=1) for line in stepped.splitlines()[:3]] == [
        ["world", "scripted, seed 1"],
        ["time", "0.004 s"],
        ["tick", "4, 1 ms each"],
    ]
    assert run("zteam sim resume").out == "resumed at 0.004 s (tick 4), as fast as possible\n"


def test_requests(desk: ControlHarness, run: Run) -> None:
    """Numbers may be negative in any notation, force needs its flag, and robots are removed in the order given."""
    for words in ("move 0 -1e1 -.5 -2", "spawn --id 3 --pose -1.5e0 -2 -0", "move 0 1 2 0 --force"):
        run(f"zteam sim {words}")
    run("zteam sim spawn --pose 1 2 0 --force")
    run("zteam sim remove 4,0-1")
    asked = ["move 0", "spawn -1.5", "move 0 by force", "spawn 1 by force", "remove 4", "remove 0", "remove 1"]
    assert [what for what, _ in desk.world.made] == asked


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
def test_json_is_the_reply(run: Run) -> None:
    """With --json a verb prints the whole status, and `spawn` the id."""
    for words in ("pause", "resume", "step 2", "speed 3", "reset", "remove 1", "status", "move 7 0 0 0"):
        assert set(json.loads(run(f"zteam sim {words} --json").out)) == set(SimStatus.__struct_fields__)
    assert json.loads(run("zteam sim spawn --pose 0 0 0 --json").out) == {"id": 7}


@pytest.mark.usefixtures("desk")
def test_a_refusal_ends_with_one(run: Run) -> None:
    """It has the simulator's reason, and within a list the robots that are gone already."""
    assert run("zteam sim remove 9", 1).err == "zteam sim: no robot 9 in this world\n"
    assert run("zteam sim remove 3-9", 1).err == "zteam sim: no robot 9 in this world; removed before: 3-8\n"


def test_without_a_simulator(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """One line says how to start one."""
    monkeypatch.setattr(listening, "connect", lambda *_, **__: MemoryHub().bus())
    (line,) = run("zteam sim step 5", 1).err.splitlines()
    assert "start one with 'zteam-sim WORLD'" in line


def test_a_finished_run_does_not_resume(desk: ControlHarness, run: Run) -> None:
    """After the end of a run, `resume` and `step` report it and name `zteam sim reset`."""
    desk.last = 3
    assert "paused            run over" in run("zteam sim step 10").out
    over = "the run is over at 0.003 s (tick 3): 'zteam sim reset' starts it again\n"
    assert run("zteam sim resume").out == over
    assert "'zteam sim reset' starts it again" in run("zteam sim step", 1).err


def test_a_long_step_reports_its_progress(desk: ControlHarness, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """The progress goes to stderr and names Ctrl+C; standard output has only the reply."""
    monkeypatch.setattr(simulator, "LOOK", 0.01)
    desk.free.clear()
    show = ProgressLine.show

    def show_and_free(progress: ProgressLine, text: str) -> None:
        show(progress, text)
        if desk.world.tick > 1:
            desk.free.set()

    monkeypatch.setattr(ProgressLine, "show", show_and_free)
    said = run("zteam sim step 400 --json")
    assert json.loads(said.out)["tick"] == 401
    assert "at 0.001 s (tick 1), real-time factor 1 (Ctrl+C pauses)" in said.err.splitlines()[0]


def test_an_interrupted_step_pauses_the_world(desk: ControlHarness, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """Ctrl+C cancels the remaining ticks."""

    def interrupt(_progress: object, _text: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ProgressLine, "show", interrupt)
    assert "paused at" in run("zteam sim step 1000000000", 130).err
    status = SimulatorClient(desk.bus).stand(ASKED).status
    assert status.paused
    assert status.tick < 1000000000
