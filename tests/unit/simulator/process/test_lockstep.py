"""The simulator's half of lock-step on the bus: what ticks carry, whose answers count, repeats, silence, the start.

The rules by which a tick ends are those of `OpenTick`, and have tests of their own.
"""

import threading
from collections.abc import Callable

import pytest

import zteam
from support.lockstep_doubles import (
    INTERVAL,
    LIMIT,
    SHORT,
    HarnessFactory,
    ScriptedMonitor,
    ScriptedParticipant,
    lose,
    lose_first,
    lossy_bus,
    make_team,
)
from support.log_capture import captured_log
from support.transports import wait_until_true
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import monotonic
from zteam.messages import Done, Odometry, String, TeamState, Twist, Vector3, ns_from_time
from zteam.node.shutdown import Stop


@pytest.mark.usefixtures("patient")
def test_a_tick_tells_what_it_is(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The message has its number, time, epoch, the robots in the world and the participants."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    harness.open(3, 0, 4)
    tick = robot.heard[-1]
    assert (tick.tick, ns_from_time(tick.stamp), tick.epoch) == (3, 3 * INTERVAL, 0)
    assert (tick.robots.tolist(), tick.participants) == ([0, 4], ["robot_0"])


@pytest.mark.usefixtures("patient")
def test_a_tick_ends_with_the_last_answer(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The wait is over as soon as the last participant answers, and not before."""
    harness = new_harness()
    first, last = make_team(hub, harness, "robot_0", "tf")
    assert harness.wait()
    first.awake = last.awake = False
    harness.open(3)
    harness.begin()
    first.answer()
    assert (harness.lockstep.tick.waiting_for(), harness.lockstep.tick.silent()) == ("tf", ["tf"])
    assert harness.holds
    last.answer()
    assert harness.end()
    assert not harness.lockstep.was_held


@pytest.mark.usefixtures("patient")
def test_a_new_process_receives_the_open_tick(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It joins although the world stands, and takes part from the next tick on."""
    harness = new_harness()
    make_team(hub, harness, "robot_0")
    assert harness.wait()
    ScriptedParticipant(hub, "planner").appear()
    assert (harness.lockstep.tick.joining, harness.lockstep.tick.members) == ({"planner"}, ["robot_0"])
    harness.open(3)
    assert harness.lockstep.tick.members == ["planner", "robot_0"]


@pytest.mark.usefixtures("patient")
def test_a_token_sends_no_tick_before_its_data(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A tick that is open and waits for the bodies to move is sent once, with what the simulator has published."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    before = len(robot.heard)
    harness.lockstep.open(3 * INTERVAL, 3, [0])
    ScriptedParticipant(hub, "planner").appear()
    assert len(robot.heard) == before
    harness.node.bus.publisher("word", String).put(String())
    harness.lockstep.send()
    assert [(tick.tick, tick.sent) for tick in robot.heard[before:]] == [(3, 1)]


@pytest.mark.usefixtures("patient")
def test_the_first_tick_of_a_process_has_what_is_latched_outside(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It is let in when all of that has come; what it asks once more is no answer to the tick that lists it."""
    harness, waiting, ask = new_harness("planner"), list[Callable[[], object]](), Done(0, 1, reads=["motto?latched"])
    harness.node.bus.transport.when_caught_up = waiting.append  # type: ignore[method-assign]
    planner = ScriptedParticipant(hub, "planner")
    planner.asks = planner.awake = False
    harness.open(1)
    planner.appear()
    planner.say(ask)
    planner.say(ask)
    hub.bus().publisher("motto", String, latched=True).put(String("go"))
    assert (harness.lockstep.tick.joining, len(waiting)) == (set(), 1)
    waiting.pop()()
    planner.say(ask)
    harness.begin()
    planner.wait_for_list("planner")
    waiting.pop()()
    assert [each.key for each in planner.heard[-1].inputs] == ["motto"]
    assert harness.lockstep.tick.missing() == ["planner"]


@pytest.mark.usefixtures("patient")
def test_the_end_of_a_process_ends_the_wait_for_it(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The other participants receive the new list of participants."""
    harness = new_harness()
    robot, aggregator = make_team(hub, harness, "robot_0", "tf")
    assert harness.wait()
    aggregator.awake = False
    harness.open(3)
    harness.begin()
    assert harness.holds
    aggregator.vanish()
    assert harness.end()
    assert robot.lists[-2:] == [["robot_0", "tf"], ["robot_0"]]
    assert robot.heard[-1].tick == 3
    assert (harness.lockstep.tick.hung, harness.lockstep.resends) == ([], 0)


@pytest.mark.usefixtures("patient")
def test_a_stop_request_ends_the_wait(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The process may stop while a participant holds the world: `wait` returns False."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    robot.awake = False
    harness.open(3)
    harness.begin()
    assert harness.holds
    harness.stop.request("test")
    assert harness.end() is False


@pytest.mark.usefixtures("patient")
def test_an_answer_without_a_token_is_refused(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It is counted and named at once, and the robot's own answer is not replaced."""
    harness = new_harness()
    robot, other = make_team(hub, harness, "robot_0", "tf")
    robot.awake = False
    key = names.done_key("robot_0")
    forged, borrowed = hub.bus().publisher(key, Done), other.bus.publisher(key, Done)
    counters = harness.node.bus.counters
    with captured_log() as log:
        harness.open(3, 0)
        harness.begin()
        forged.put(Done(0, 3, True, Twist(Vector3(1.0))))
        borrowed.put(Done(0, 3, True, Twist(Vector3(1.0))))
        assert counters.snapshot()[key].dropped == 2
    assert log.count("dropped a message on robot_0/done: ") >= 1
    assert "tf (session" in counters.snapshot()[key].last_drop_reason
    assert harness.holds
    assert harness.answered == []
    robot.say(Done(0, 3, True, Twist(Vector3(0.1))))
    assert harness.end()
    assert harness.answered == [0]
    assert harness.lockstep.tick.commands({0: None}) == {0: Twist(Vector3(0.1))}


@pytest.mark.usefixtures("patient")
def test_an_answer_that_overtakes_its_token_counts(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """With the token the open tick is sent again, and so is the answer; the first one is not counted as refused."""
    harness = new_harness()
    robot = ScriptedParticipant(hub, "robot_0")
    robot.asks = False
    harness.open(1)
    robot.say(Done(0, 1))
    assert harness.lockstep.tick.joining == set()
    robot.asks = True
    robot.appear()
    assert harness.lockstep.tick.joining == {"robot_0"}
    assert not any(count.dropped for count in harness.node.bus.counters.snapshot().values())


@pytest.mark.usefixtures("patient")
def test_after_a_reset_old_answers_count_no_more(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A world that returns to the number of its open tick waits for new answers to it."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    robot.awake = False
    harness.lockstep.tick.start_anew()
    assert harness.lockstep.tick.commands({0: None}) == {}
    harness.open(2)
    assert (harness.lockstep.tick.waiting_for(), harness.lockstep.tick.held) == ("robot_0", False)


@pytest.mark.gate
def test_a_flood_of_tokens_sends_no_flood_of_ticks(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Any program may hold tokens: two thousand let the open tick be sent again a few hundred times a second, and once
    more a second later, for a process that may have come among them."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    strangers = hub.bus()
    before, begin = len(robot.heard), monotonic()
    for number in range(2000):
        strangers.declare_token(names.token_key("robot_0", f"z{number}"))
    wait_until_true(lambda: len(robot.heard) >= before + 257)
    assert len(robot.heard) <= before + 257 * (1 + int(monotonic() - begin))


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("lost", [names.TICK, names.done_key("robot_0")])
def test_a_lost_message_costs_a_repeat(hub: MemoryHub, new_harness: HarnessFactory, lost: str) -> None:
    """Whether the tick or its answer does not arrive, the tick is sent again, and that is counted. The first tick is
    sent again to all, until the process has joined."""
    # Two ticks are sent without a repeat: with the token, and when the held tick is opened again.
    loses = [lose_first(lost, 4)]
    bus = lossy_bus(hub, lambda key: loses[-1](key))
    harness = new_harness("robot_0", bus=bus if lost != names.TICK else None)
    harness.open(1)
    robot = ScriptedParticipant(hub, "robot_0", bus=bus if lost == names.TICK else None).appear()
    assert harness.wait()
    loses.append(lose_first(lost))
    harness.resent.clear()
    before = harness.lockstep.resends
    harness.open(2)
    assert harness.wait()
    assert harness.lockstep.resends > before
    assert harness.resent == [["robot_0"]] * (harness.lockstep.resends - before)
    assert robot.heard[-1].tick == 2


@pytest.mark.usefixtures("hasty")
def test_inputs_are_sent_again_to_participants_that_have_not_answered(
    hub: MemoryHub, new_harness: HarnessFactory
) -> None:
    """The inputs of the others are not sent again; the tick itself is sent to all, after longer and longer times."""
    harness = new_harness()
    first, last = make_team(hub, harness, "robot_0", "robot_1")
    assert harness.wait()
    last.awake = False
    harness.open(3)
    before, begin = len(first.heard), monotonic()

    def answer_the_tenth() -> None:
        harness.on_resend = answer_the_tenth if len(harness.resent) < 9 else last.answer

    harness.on_resend = answer_the_tenth
    assert harness.wait()
    assert harness.resent == [["robot_1"]] * 10
    assert [tick.tick for tick in first.heard[before:]] == [3] * 10
    assert monotonic() - begin > 9 * SHORT


@pytest.mark.usefixtures("hasty")
def test_silent_participants_are_named_and_dropped(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """First the aggregator, for which robots wait; they then have the whole time-out again. The others go on."""
    timeout = 10 * SHORT
    harness = new_harness(timeout=timeout)
    robot, silent, aggregator = make_team(hub, harness, "robot_0", "robot_1", "tf")
    assert harness.wait()
    aggregator.awake = aggregator.asks = silent.awake = silent.asks = False
    begin = monotonic()
    with captured_log() as log:
        harness.open(3)
        assert harness.wait()
    assert monotonic() - begin >= 2 * timeout
    assert log.count("tick 3 waits for tf for") == 1
    assert log.count("tf did not answer tick 3") == log.count("robot_1 did not answer tick 3") == 1
    assert harness.lockstep.tick.hung == ["tf", "robot_1"]
    assert (robot.lists[-1], robot.heard[-1].tick) == (["robot_0"], 3)


@pytest.mark.usefixtures("patient")
def test_a_participant_that_was_cut_off_is_reported(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Its own session's token comes back, so it had not ended; one that was started again has another session."""
    harness = new_harness()
    first, second = make_team(hub, harness, "robot_0", "robot_1")
    assert harness.wait()
    with captured_log() as log:
        lose(first, harness)
        ScriptedParticipant(hub, "robot_0").appear()
        lose(second, harness)
        second.appear()
    assert harness.lockstep.tick.hung == ["robot_1"]
    assert log.count("robot_1 was cut off, or frozen for longer than its lease: it missed ticks") == 1


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("is_early", [True, False])
def test_all_expected_processes_receive_go_in_the_same_tick(
    hub: MemoryHub, new_harness: HarnessFactory, is_early: bool
) -> None:
    """The first tick is held until all take part, and then carries the GO that came before it or while it was held."""
    monitor = ScriptedMonitor(hub)
    if is_early:
        monitor.give_go(5)
    harness = new_harness("robot_0", "tf", gate=True)
    harness.open(1)
    harness.begin()
    robot = ScriptedParticipant(hub, "robot_0").appear()
    robot.wait_until_heard()
    if not is_early:
        monitor.give_go(5)
    assert "tf" in harness.lockstep.tick.waiting_for()
    assert harness.holds
    aggregator = ScriptedParticipant(hub, "tf").appear()
    assert harness.end()
    for participant in (robot, aggregator):
        assert {tuple(tick.participants) for tick in participant.heard if tick.epoch} == {("robot_0", "tf")}
        assert {(tick.tick, tick.epoch) for tick in participant.heard} == {(1, 0), (1, 5)}


@pytest.mark.usefixtures("patient")
def test_go_ends_the_hold(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """When all take part the tick waits for GO; then all answer it again, under the new epoch."""
    harness = new_harness("robot_0", gate=True)
    robot = ScriptedParticipant(hub, "robot_0").appear()
    harness.open(1)
    harness.begin()
    robot.wait_for_list("robot_0")
    robot.awake = False
    monitor = ScriptedMonitor(hub)
    monitor.say(TeamState.WAITING, 1)
    assert harness.lockstep.tick.waiting_for().startswith("the monitor's GO")
    monitor.give_go(2)
    robot.wait_for_epoch(2)
    assert harness.lockstep.tick.waiting_for() == "robot_0"
    assert harness.holds
    robot.answer()
    assert harness.end()


@pytest.mark.usefixtures("hasty")
def test_the_log_names_what_holds_the_first_tick(new_harness: HarnessFactory) -> None:
    """It names absent processes and GO, and says how to begin without GO."""
    harness = new_harness("robot_1", "robot_0", gate=True)
    with captured_log() as log:
        harness.open(1)
        harness.begin()
        log.wait_for("the first tick is held: waiting for robot_0, robot_1, the monitor's GO")
        assert "--no-gate" in harness.lockstep.tick.waiting_for()
        assert harness.lockstep.was_held
        harness.stop.request("test")
        assert harness.end() is False


@pytest.mark.usefixtures("hasty")
def test_no_participant_is_dropped_before_go(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A start may take any time, and with GO the time-out begins: a robot that does not return is left behind."""
    timeout = 5 * SHORT
    harness = new_harness("robot_0", "tf", gate=True, timeout=timeout)
    robot = ScriptedParticipant(hub, "robot_0").appear()
    ScriptedParticipant(hub, "tf").appear()
    robot.awake = False
    given: list[float] = []

    def give_go() -> None:
        harness.on_resend = give_go
        if monotonic() - begin > 2 * timeout and not given:
            given.append(monotonic())
            ScriptedMonitor(hub).give_go(1)

    harness.on_resend = give_go
    begin = monotonic()
    harness.open(1)
    assert harness.wait()
    assert monotonic() - given[0] >= timeout
    assert (harness.lockstep.tick.hung, harness.lockstep.tick.members) == (["robot_0"], ["tf"])


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
        assert harness.lockstep.tick.waiting_for() == "planner"
        harness.stop.request("test")
        assert harness.end() is False
    stop.request("test")
    thread.join(LIMIT)
    node.close()
