"""The simulator's half of lock-step with scripted participants: ticks, answers, processes that end, resets."""

import pytest

from support.lockstep_doubles import INTERVAL, HarnessFactory, ScriptedParticipant, make_team
from support.log_capture import captured_log
from support.transports import wait_until_true
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import monotonic
from zteam.messages import Done, Twist, Vector3, ns_from_time


@pytest.mark.usefixtures("patient")
def test_a_world_without_participants_does_not_wait(new_harness: HarnessFactory) -> None:
    """Without participants, expected processes and gate every tick is over at once."""
    harness = new_harness()
    for tick in range(1, 4):
        harness.open(tick)
        assert harness.wait()
    assert (harness.lockstep.tick.members, harness.lockstep.resends, harness.lockstep.waiting_for()) == (
        [],
        0,
        "",
    )


@pytest.mark.usefixtures("patient")
def test_a_tick_tells_what_it_is(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The message has its number, time, epoch, the robots in the world and the participants."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    harness.open(3, 0, 4)
    tick = robot.heard[-1]
    assert (tick.tick, ns_from_time(tick.stamp), tick.epoch) == (3, 3 * INTERVAL, 0)
    assert (tick.robots.tolist(), tick.participants) == ([0, 4], ["robot_0"])
    assert not harness.lockstep.tick.message.epoch


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
    assert harness.lockstep.waiting_for() == "tf"
    assert harness.holds
    last.answer()
    assert harness.end()


@pytest.mark.usefixtures("patient")
def test_a_new_process_receives_the_open_tick(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It joins although the world stands, and the simulator waits for it from the next tick on."""
    harness = new_harness()
    make_team(hub, harness, "robot_0")
    assert harness.wait()
    late = ScriptedParticipant(hub, "planner").appear()
    assert (harness.lockstep.tick.joining, harness.lockstep.tick.members) == ({"planner"}, ["robot_0"])
    assert harness.wait()
    late.awake = False
    harness.open(3)
    assert (harness.lockstep.tick.joining, harness.lockstep.tick.members) == (set(), ["planner", "robot_0"])
    harness.begin()
    assert harness.lockstep.waiting_for() == "planner"
    late.answer()
    assert harness.end()


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
    harness.open(4)
    assert harness.wait()
    assert robot.lists[-1] == ["robot_0"]


@pytest.mark.usefixtures("patient")
def test_a_restarted_process_goes_on_where_the_old_one_was(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """If the new token comes before the old one goes, the name stays, and its new holder receives the open tick."""
    harness = new_harness()
    (old,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    old.awake = False
    harness.open(3)
    harness.begin()
    new = ScriptedParticipant(hub, "robot_0").appear()
    assert harness.end()
    assert new.lists == [["robot_0"]]
    old.vanish()
    harness.open(4)
    assert (harness.wait(), harness.lockstep.tick.members) == (True, ["robot_0"])


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
    robot, other = make_team(hub, harness, "robot_0", "robot_1")
    robot.awake = False
    key = names.done_key("robot_0")
    forger = hub.bus()
    forged, borrowed = forger.publisher(key, Done), other.bus.publisher(key, Done)
    counters = harness.node.bus.counters
    with captured_log() as log:
        harness.open(3, 0)
        harness.begin()
        forged.put(Done(0, 3, True, Twist(Vector3(1.0))))
        borrowed.put(Done(0, 3, True, Twist(Vector3(1.0))))
        assert counters.snapshot()[key].dropped == 2
    assert log.count("dropped a message on robot_0/done: ") >= 1
    assert counters.snapshot()[key].last_drop_reason.endswith("does not hold the name robot_0")
    assert harness.holds
    assert 0 not in harness.answered
    robot.say(Done(0, 3, True, Twist(Vector3(0.1))))
    assert harness.end()
    assert harness.lockstep.take_commands({0: None}) == {0: Twist(Vector3(0.1))}


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
def test_commands_come_with_the_answers(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Only commands for the open tick count, of robots that are in the world, by id."""
    harness = new_harness()
    participants = [ScriptedParticipant(hub, f"robot_{i}", Twist(Vector3(0.1 * i))).appear() for i in (10, 2, 3)]
    ScriptedParticipant(hub, "tf").appear()
    ScriptedParticipant(hub, "robot_4").appear()
    harness.open(1)
    assert harness.lockstep.take_commands({2: None, 10: None}) == {}
    assert harness.wait()
    harness.open(2, 2, 4, 10)
    assert harness.wait()
    commands = harness.lockstep.take_commands({2: None, 4: None, 10: None})
    assert list(commands.items()) == [(2, Twist(Vector3(0.2))), (10, Twist(Vector3(1.0)))]
    assert {10, 2, 3} <= set(harness.answered)
    participants[0].awake = False
    harness.open(3, 2, 4, 10)
    participants[0].say(Done(0, 2, True, Twist(Vector3(9.0))))
    assert list(harness.lockstep.take_commands({2: None, 10: None})) == [2]


@pytest.mark.usefixtures("patient")
def test_after_a_reset_old_answers_count_no_more(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """A world that returns to the number of its open tick waits for new answers to it."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    robot.awake = False
    harness.lockstep.start_anew()
    assert harness.lockstep.take_commands({0: None}) == {}
    harness.open(2)
    harness.begin()
    assert harness.lockstep.waiting_for() == "robot_0"
    robot.answer()
    assert harness.end()


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
