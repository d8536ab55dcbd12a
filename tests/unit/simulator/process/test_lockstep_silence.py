"""Lock-step with lost messages and silent participants: they are repeated, named, dropped."""

from itertools import pairwise

import pytest

from support.cuttable_transport import cut_bus
from support.lockstep_doubles import (
    LIMIT,
    LONG,
    SHORT,
    HarnessFactory,
    ScriptedParticipant,
    lose,
    lose_first,
    lossy_bus,
    make_team,
)
from support.log_capture import captured_log
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import monotonic
from zteam.messages import Done
from zteam.simulator.process import lockstep


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("lost", [names.TICK, names.done_key("robot_0")])
def test_a_lost_message_costs_a_repeat(hub: MemoryHub, new_harness: HarnessFactory, lost: str) -> None:
    """Whether the tick or its answer does not arrive, the tick is sent again, and that is counted."""
    losing = [False]
    lose = lose_first(lost)
    bus = lossy_bus(hub, lambda key: losing[0] and lose(key))
    harness = new_harness(bus=bus if lost != names.TICK else None)
    robot = ScriptedParticipant(hub, "robot_0", bus=bus if lost == names.TICK else None).appear()
    harness.open(1)
    assert harness.wait()
    losing[0] = True
    harness.open(2)
    assert harness.wait()
    assert harness.lockstep.resends >= 1
    assert harness.resent == [["robot_0"]] * harness.lockstep.resends
    assert robot.heard[-1].tick == 2


@pytest.mark.usefixtures("hasty")
def test_inputs_are_sent_again_to_participants_that_have_not_answered(
    hub: MemoryHub, new_harness: HarnessFactory
) -> None:
    """The inputs of the others are not sent again; the tick itself is sent to all."""
    harness = new_harness()
    first, last = make_team(hub, harness, "robot_0", "robot_1")
    assert harness.wait()
    last.awake = False
    harness.open(3)
    before = len(first.heard)
    harness.on_resend = last.answer
    assert harness.wait()
    assert harness.resent == [["robot_1"]]
    assert [tick.tick for tick in first.heard[before:]] == [3]


def test_the_time_between_repeats_grows(
    hub: MemoryHub, new_harness: HarnessFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It doubles up to a limit, and starts again with the next tick."""
    monkeypatch.setattr(lockstep, "RESEND", 0.02)
    monkeypatch.setattr(lockstep, "MAX_RESEND", 0.06)
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    robot.awake = False
    for tick in (3, 4):
        times = [monotonic()]

        def note(times: list[float] = times) -> None:
            times.append(monotonic())
            harness.on_resend = note if len(times) < 5 else robot.answer

        harness.on_resend = note
        harness.open(tick)
        assert harness.wait()
        assert all(b - a >= least for (a, b), least in zip(pairwise(times), (0.019, 0.039, 0.059, 0.059), strict=True))
        assert times[1] - times[0] < LIMIT / 2
    assert harness.lockstep.resends == 10


@pytest.mark.gate
@pytest.mark.usefixtures("hasty")
def test_a_silent_participant_is_named_and_dropped(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It holds the world for the time-out; then the others go on without it."""
    harness = new_harness(timeout=50 * SHORT)
    robot, silent = make_team(hub, harness, "robot_0", "robot_1")
    assert harness.wait()
    silent.awake = False
    with captured_log() as log:
        harness.open(3)
        assert harness.wait()
    assert log.count("tick 3 waits for robot_1 for") == 1
    assert log.count("robot_1 did not answer tick 3") == 1
    assert harness.lockstep.tick.hung == ["robot_1"]
    assert robot.lists[-1] == ["robot_0"]
    assert robot.heard[-1].tick == 3


@pytest.mark.usefixtures("hasty")
def test_a_dropped_participant_comes_back_at_the_next_tick(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Any answer, even the late one itself, makes it join; it is listed from the next tick on."""
    harness = new_harness(timeout=2 * SHORT)
    robot, silent = make_team(hub, harness, "robot_0", "robot_1")
    assert harness.wait()
    silent.awake = silent.asks = False
    harness.open(3)
    assert harness.wait()
    harness.open(4)
    assert harness.wait()
    assert robot.lists[-1] == ["robot_0"]
    silent.say(Done(0, 3))
    assert harness.lockstep.tick.joining == {"robot_1"}
    silent.awake = True
    harness.open(5)
    assert harness.wait()
    assert harness.lockstep.tick.members == ["robot_0", "robot_1"]
    assert harness.lockstep.tick.hung == ["robot_1"]


@pytest.mark.usefixtures("hasty")
def test_only_the_aggregator_is_dropped_when_robots_wait_for_it(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Without transforms the robots cannot answer either: they stay, and receive the new list."""
    harness = new_harness(timeout=5 * SHORT)
    robot, aggregator = make_team(hub, harness, "robot_0", "tf")
    assert harness.wait()
    aggregator.awake = aggregator.asks = False
    robot.blocked_by = "tf"
    harness.open(3)
    assert harness.wait()
    assert robot.lists[-1] == ["robot_0"]
    assert harness.lockstep.tick.hung == ["tf"]
    assert harness.lockstep.tick.members == ["robot_0"]


@pytest.mark.usefixtures("hasty")
def test_after_a_drop_the_time_out_starts_again(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """After the aggregator is dropped, the robots have the whole time-out."""
    timeout = 10 * SHORT
    harness = new_harness(timeout=timeout)
    robot, aggregator = make_team(hub, harness, "robot_0", "tf")
    assert harness.wait()
    aggregator.awake = aggregator.asks = robot.awake = robot.asks = False
    begin = monotonic()
    harness.open(3)
    assert harness.wait()
    assert monotonic() - begin >= 2 * timeout
    assert harness.lockstep.tick.hung == ["tf", "robot_0"]


@pytest.mark.usefixtures("hasty")
def test_an_answer_that_comes_before_the_complaint_is_not_complained_of(
    hub: MemoryHub, new_harness: HarnessFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While participants are asked what they wait for, the last one answers the tick: the log names none."""
    monkeypatch.setattr(lockstep, "NAME_AFTER", 0.0)
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    robot.awake = False

    def answer(_node: object) -> dict[str, str]:
        robot.answer()
        return {}

    monkeypatch.setattr(lockstep, "_ask_lacking", answer)
    with captured_log() as log:
        harness.open(3)
        assert harness.wait()
    assert not any("waits for" in line for line in log.lines)


@pytest.mark.usefixtures("hasty")
def test_a_pause_of_the_simulator_is_no_silence_of_the_others(
    hub: MemoryHub, new_harness: HarnessFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two looks it was frozen for longer than the time-out: what then answers is not left behind."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    robot.awake = False
    frozen = [0.0]
    monkeypatch.setattr(lockstep, "monotonic", lambda: monotonic() + frozen[0])
    harness.open(3)

    def freeze() -> None:
        frozen[0] = 10 * LONG
        harness.on_resend = robot.answer

    harness.on_resend = freeze
    assert harness.wait()
    assert harness.lockstep.tick.hung == []


@pytest.mark.usefixtures("patient")
def test_a_participant_that_was_cut_off_is_reported(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Its own session's token comes back, so it had not ended; one that was started again has another session."""
    harness = new_harness()
    first, second = make_team(hub, harness, "robot_0", "robot_1")
    assert harness.wait()
    with captured_log() as log:
        lose(first, harness)
        ScriptedParticipant(hub, "robot_0").appear()
        assert harness.lockstep.tick.hung == []
        lose(second, harness)
        second.appear()
    assert harness.lockstep.tick.hung == ["robot_1"]
    assert log.count("robot_1 was cut off, or frozen for longer than its lease: it missed ticks") == 1
    second.vanish()
    second.appear()
    assert harness.lockstep.tick.hung == ["robot_1"], "it had not taken part again"


@pytest.mark.usefixtures("patient")
def test_without_the_router_the_world_waits(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Tokens that vanish with the link and come back with it are those of participants as before."""
    bus, link = cut_bus(hub)
    harness = new_harness(bus=bus)
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    robot.awake = False
    harness.open(3)
    robot.vanish()
    link.set_link(False)
    link.set_link(True)
    robot.appear()
    robot.answer()
    assert harness.wait()
    assert (harness.lockstep.tick.members, harness.lockstep.tick.hung) == (["robot_0"], [])
