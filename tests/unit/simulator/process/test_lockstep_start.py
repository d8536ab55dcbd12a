"""The first tick of lock-step is held for all expected processes and for the monitor's GO."""

import threading

import pytest

import zteam
from support.lockstep_doubles import (
    LIMIT,
    SHORT,
    HarnessFactory,
    ScriptedMonitor,
    ScriptedParticipant,
    lose,
    lose_first,
    lossy_bus,
)
from support.log_capture import captured_log
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Odometry
from zteam.node.shutdown import Stop

NO_GO = "the monitor's GO"


@pytest.mark.usefixtures("patient")
def test_it_is_held_until_all_expected_processes_take_part(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """They all join the held tick, which ends with the last one."""
    harness = new_harness("robot_0", "tf")
    harness.open(1)
    harness.begin()
    robot = ScriptedParticipant(hub, "robot_0").appear()
    robot.wait_until_heard()
    assert "tf" in harness.lockstep.waiting_for()
    assert harness.holds
    aggregator = ScriptedParticipant(hub, "tf").appear()
    assert harness.end()
    for participant in (robot, aggregator):
        assert participant.lists[-1] == ["robot_0", "tf"]
        assert {tick.tick for tick in participant.heard} == {1}
    assert harness.lockstep.tick.members == ["robot_0", "tf"]


@pytest.mark.usefixtures("patient")
def test_processes_that_come_before_the_first_tick_take_part_in_it(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A team that is complete before the first tick loses no time."""
    harness = new_harness("robot_0", "tf")
    ScriptedParticipant(hub, "robot_0").appear()
    ScriptedParticipant(hub, "tf").appear()
    harness.open(1)
    assert harness.wait()
    assert harness.lockstep.tick.members == ["robot_0", "tf"]


@pytest.mark.usefixtures("patient")
def test_go_is_announced_when_all_expected_processes_take_part(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """An earlier GO is withheld, so that all receive it in the same tick."""
    harness = new_harness("robot_0", "tf", gate=True)
    harness.open(1)
    harness.begin()
    robot = ScriptedParticipant(hub, "robot_0").appear()
    robot.wait_until_heard()
    ScriptedMonitor(hub).give_go(5)
    aggregator = ScriptedParticipant(hub, "tf").appear()
    assert harness.end()
    assert harness.lockstep.tick.message.epoch
    for participant in (robot, aggregator):
        told = [tick.participants for tick in participant.heard if tick.epoch == 5]
        assert told[0] == ["robot_0", "tf"]
        assert {tick.epoch for tick in participant.heard} == {0, 5}


@pytest.mark.usefixtures("patient")
def test_go_ends_the_hold(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """When all take part the tick waits for GO; then all answer it again, under the new epoch."""
    harness = new_harness("robot_0", gate=True)
    robot = ScriptedParticipant(hub, "robot_0").appear()
    harness.open(1)
    harness.begin()
    robot.wait_for_list("robot_0")
    assert harness.lockstep.waiting_for().startswith(NO_GO)
    assert not harness.lockstep.tick.message.epoch
    robot.awake = False
    ScriptedMonitor(hub).give_go(2)
    robot.wait_for_epoch(2)
    assert harness.lockstep.waiting_for() == "robot_0"
    assert harness.holds
    robot.answer()
    assert harness.end()
    assert harness.lockstep.tick.message.epoch


@pytest.mark.usefixtures("patient")
def test_later_ticks_carry_go(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Every tick from that of GO on carries it, and the highest epoch counts."""
    monitor = ScriptedMonitor(hub)
    harness = new_harness("robot_0", gate=True)
    robot = ScriptedParticipant(hub, "robot_0").appear()
    harness.open(1)
    harness.begin()
    monitor.give_go(4)
    assert harness.end()
    monitor.give_go(3)
    for tick in (2, 3):
        harness.open(tick)
        assert harness.wait()
    monitor.give_go(7)
    harness.open(4)
    assert harness.wait()
    assert [(tick.tick, tick.epoch) for tick in robot.heard[-3:]] == [(2, 4), (3, 4), (4, 7)]


@pytest.mark.usefixtures("patient")
def test_without_the_gate_go_is_not_waited_for(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It is enough that all expected processes take part; a later GO is announced as well."""
    harness = new_harness("robot_0")
    harness.open(1)
    harness.begin()
    robot = ScriptedParticipant(hub, "robot_0").appear()
    assert harness.end()
    assert robot.heard[-1].epoch == 0
    ScriptedMonitor(hub).give_go(1)
    harness.open(2)
    assert harness.wait()
    assert robot.heard[-1].epoch == 1


@pytest.mark.usefixtures("patient")
def test_go_is_enough_without_expected_processes(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The processes that take part by then receive it."""
    harness = new_harness(gate=True)
    harness.open(1)
    harness.begin()
    robot = ScriptedParticipant(hub, "robot_3").appear()
    robot.wait_for_list("robot_3")
    ScriptedMonitor(hub).give_go(1)
    assert harness.end()
    assert robot.heard[-1].epoch == 1


@pytest.mark.usefixtures("patient")
def test_an_unexpected_process_may_take_part_in_the_held_tick(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It joins at once, and the tick waits for it too."""
    harness = new_harness("robot_0", "tf")
    harness.open(1)
    harness.begin()
    planner = ScriptedParticipant(hub, "planner")
    planner.awake = False
    planner.appear().wait_until_heard()
    ScriptedParticipant(hub, "robot_0").appear().wait_until_heard()
    aggregator = ScriptedParticipant(hub, "tf").appear()
    aggregator.wait_for_list("planner", "robot_0", "tf")
    assert harness.lockstep.waiting_for() == "planner"
    planner.answer()
    assert harness.end()


@pytest.mark.usefixtures("patient")
def test_a_process_that_ends_while_the_tick_is_held_is_expected_again(
    hub: MemoryHub, new_harness: HarnessFactory
) -> None:
    """GO is withheld until the name is back, so that no tick announces it to half a team."""
    harness = new_harness("robot_0", "tf", gate=True)
    harness.open(1)
    harness.begin()
    robot = ScriptedParticipant(hub, "robot_0").appear()
    robot.wait_until_heard()
    aggregator = ScriptedParticipant(hub, "tf").appear()
    robot.wait_for_list("robot_0", "tf")
    lose(aggregator, harness)
    ScriptedMonitor(hub).give_go(1)
    assert "tf" in harness.lockstep.waiting_for()
    assert harness.holds
    ScriptedParticipant(hub, "tf").appear()
    assert harness.end()
    assert {tuple(tick.participants) for tick in robot.heard if tick.epoch} == {("robot_0", "tf")}


@pytest.mark.usefixtures("patient")
def test_only_the_first_tick_is_held(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Later the world goes on without an expected process that has ended, after a reset too."""
    harness = new_harness("robot_0", "tf")
    ScriptedParticipant(hub, "robot_0").appear()
    aggregator = ScriptedParticipant(hub, "tf").appear()
    harness.open(1)
    assert harness.wait()
    aggregator.vanish()
    harness.open(2)
    assert harness.wait()
    harness.lockstep.start_anew()
    harness.open(1)
    assert harness.wait()
    assert harness.lockstep.tick.members == ["robot_0"]


@pytest.mark.usefixtures("hasty")
def test_the_log_names_what_holds_it(new_harness: HarnessFactory) -> None:
    """The log names absent processes and GO from time to time, and says how to begin without GO."""
    harness = new_harness("robot_1", "robot_0", gate=True)
    with captured_log() as log:
        harness.open(1)
        harness.begin()
        log.wait_for("the first tick is held: waiting for robot_0, robot_1, the monitor's GO")
        assert harness.lockstep.waiting_for().startswith("robot_0, robot_1, " + NO_GO)
        assert "--no-gate" in harness.lockstep.waiting_for()
        harness.stop.request("test")
        assert harness.end() is False


@pytest.mark.usefixtures("hasty")
def test_no_participant_is_dropped_while_it_is_held(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A start may take any time: the time-out counts in later ticks only."""
    harness = new_harness("robot_0", timeout=0.5 * SHORT)
    robot = ScriptedParticipant(hub, "robot_0").appear()
    robot.awake = False
    repeats: list[int] = []

    def count() -> None:
        repeats.append(1)
        harness.on_resend = count if len(repeats) < 5 else robot.answer

    harness.on_resend = count
    harness.open(1)
    assert harness.wait()
    assert (harness.lockstep.tick.hung, harness.lockstep.tick.members) == ([], ["robot_0"])


@pytest.mark.gate
@pytest.mark.usefixtures("hasty")
def test_with_go_the_first_tick_has_a_time_out(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The start is over: a robot whose first step does not return is left behind, as in any later tick."""
    harness = new_harness("robot_0", "tf", gate=True, timeout=50 * SHORT)
    robot = ScriptedParticipant(hub, "robot_0").appear()
    ScriptedParticipant(hub, "tf").appear()
    harness.open(1)
    harness.begin()
    robot.wait_for_list("robot_0", "tf")
    robot.awake = False
    ScriptedMonitor(hub).give_go(1)
    assert harness.end()
    assert (harness.lockstep.tick.hung, harness.lockstep.tick.members) == (["robot_0"], ["tf"])


@pytest.mark.usefixtures("patient")
def test_an_earlier_go_is_withheld_too(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A monitor may have given GO before the first tick: it is announced when all take part."""
    ScriptedMonitor(hub).give_go(3)
    harness = new_harness("robot_0", "tf", gate=True)
    harness.open(1)
    harness.begin()
    robot = ScriptedParticipant(hub, "robot_0").appear()
    robot.wait_until_heard()
    ScriptedParticipant(hub, "tf").appear()
    assert harness.end()
    assert {tuple(tick.participants) for tick in robot.heard if tick.epoch} == {("robot_0", "tf")}


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("lost", [names.TICK, names.done_key("robot_0")])
def test_a_lost_message_does_not_hold_it_for_ever(hub: MemoryHub, new_harness: HarnessFactory, lost: str) -> None:
    """If a process misses the held tick, or its answer is lost, the tick is repeated until the process has joined."""
    # Two ticks are sent without a repeat: with the token, and when the held tick is opened again.
    bus = lossy_bus(hub, lose_first(lost, 4))
    harness = new_harness("robot_0", bus=None if lost == names.TICK else bus)
    harness.open(1)
    ScriptedParticipant(hub, "robot_0", bus=bus if lost == names.TICK else None).appear()
    assert harness.wait()


@pytest.mark.usefixtures("hasty")
def test_repeated_requests_to_join_do_not_repeat_the_tick(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """While a process is absent, the held tick is repeated on schedule, not with every answer of the others."""
    harness = new_harness("robot_0", "tf")
    harness.open(1)
    robot = ScriptedParticipant(hub, "robot_0").appear()
    with captured_log() as log:
        harness.begin()
        log.wait_for("the first tick is held")
        heard = len(robot.heard)
    # Besides repeats, a few ticks come at once.
    assert heard < harness.lockstep.resends + 6
    ScriptedParticipant(hub, "tf").appear()
    assert harness.end()


@pytest.mark.ci
@pytest.mark.usefixtures("hasty")
def test_the_log_names_the_input_that_does_not_come(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A user's node that waits for a message of the tick is named together with the key of that message."""
    stop = Stop()
    node = zteam.Node("planner", hub.bus(), stop)
    node.subscribe("robot_0/sonar_7", Odometry, lambda key, odom: None, every_tick=True)
    thread = threading.Thread(target=lambda: node.run(lambda now: None))
    harness = new_harness("planner")
    with captured_log() as log:
        thread.start()
        harness.open(1)
        harness.begin()
        log.wait_for("the first tick is held: waiting for planner, which waits for robot_0/sonar_7")
        assert harness.lockstep.waiting_for() == "planner"
        harness.stop.request("test")
        assert harness.end() is False
    stop.request("test")
    thread.join(LIMIT)
    node.close()
