"""The rules by which a tick begins and ends, without a bus; those of a tick that is not held are a property as well."""

import pytest

from zteam.messages import Done, Twist, Vector3
from zteam.simulator.process.open_tick import OpenTick
from zteam.simulator.recorded_ticks import RecordedTick


def join(tick: OpenTick, *names: str) -> None:
    """Let processes take these names and ask to join."""
    for name in names:
        tick.on_token(name, f"session-{name}", True)
        assert tick.on_done(name, f"session-{name}", Done())


def answer(tick: OpenTick, *names: str) -> None:
    """Answer the open tick."""
    for name in names:
        assert tick.on_done(name, f"session-{name}", Done(tick.message.epoch, tick.message.tick))


def begun(*names: str) -> OpenTick:
    """Tick 2 is open, and these take part."""
    tick = OpenTick(gate=False)
    join(tick, *names)
    tick.open(0, 1, [])
    tick.end()
    tick.open(0, 2, [])
    return tick


def test_a_process_takes_part_from_the_tick_after_its_first_answer() -> None:
    """A process joins with its first answer; the tick waits for it from the next tick on."""
    tick = begun()
    tick.on_token("robot_0", "session-robot_0", True)
    assert tick.on_done("robot_0", "session-robot_0", Done(0, 2))
    assert (tick.joining, tick.members, tick.missing()) == ({"robot_0"}, [], [])
    assert tick.open(0, 3, []).participants == ["robot_0"]
    assert (tick.joining, tick.missing()) == (set(), ["robot_0"])


def test_a_process_that_a_fault_keeps_out_joins_when_it_is_over() -> None:
    """The tick goes on without it, whether it asks to be let in or not, and lists it again as soon as it may."""
    tick, out = begun("robot_0", "robot_1", "tf"), frozenset({"robot_1"})
    assert tick.open(0, 3, [], out).participants == ["robot_0", "tf"]
    assert tick.on_done("robot_1", "session-robot_1", Done(0, 3, True, Twist(Vector3(1.0))))
    assert tick.open(0, 4, [], out).participants == ["robot_0", "tf"]
    assert tick.commands({0, 1}) == {}
    assert tick.open(0, 5, []).participants == ["robot_0", "robot_1", "tf"]
    tick.on_token("robot_1", "session-robot_1", False)
    assert tick.open(0, 6, [], out).participants == ["robot_0", "tf"]
    assert tick.open(0, 7, []).participants == ["robot_0", "tf"], "it has ended meanwhile"


def test_a_participant_that_comes_back_with_its_session_had_not_ended() -> None:
    """It was frozen, or had no link: once for each time that it took part. Another session is another process."""
    tick = begun("robot_0", "tf")
    for name in ("robot_0", "tf"):
        tick.on_token(name, f"session-{name}", False)
    assert not tick.note_return("robot_0", "another")
    assert tick.note_return("tf", "session-tf")
    assert not tick.note_return("tf", "session-tf")
    assert tick.hung == ["tf"]


def test_a_tick_is_over_with_the_last_answer() -> None:
    """And not before."""
    tick = begun("robot_0", "tf")
    answer(tick, "tf")
    assert (tick.is_over, tick.waiting_for()) == (False, "robot_0")
    answer(tick, "robot_0")
    assert (tick.is_over, tick.waiting_for()) == (True, "")


def test_a_process_that_ends_between_two_ticks_ends_in_the_second() -> None:
    """Its command of the first one is taken already. A process of its name that comes meanwhile is another one, and no
    other token waits."""
    tick = begun("robot_0", "robot_1", "tf")
    answer(tick, "robot_0", "robot_1", "tf")
    assert not tick.defers("robot_0", "session-robot_0", False)
    tick.take_commands({0, 1})
    assert tick.defers("robot_1", "session-robot_1", False)
    assert tick.defers("robot_1", "another", True)
    assert not tick.defers("planner", "session-planner", True)
    assert tick.open(0, 3, []).participants == ["robot_0", "robot_1", "tf"]
    late = tick.go_on()
    assert late == [("robot_1", "session-robot_1", False), ("robot_1", "another", True)]
    assert [tick.on_token(*each) for each in late] == [True, True]
    assert tick.refreshed().participants == ["robot_0", "tf"]
    assert not tick.defers("tf", "session-tf", False)


def test_a_recorded_tick_has_the_participants_that_it_had() -> None:
    """One that comes earlier than it did waits. One that ended is waited for until it ends, and what does not come is
    given up."""
    tick = begun("robot_0", "tf")
    join(tick, "robot_1", "robot_2")
    listed = frozenset({"robot_0", "robot_1", "tf"})
    tick.end()
    tick.recorded = RecordedTick([], listed | {"robot_3"}, frozenset({"robot_1"}))
    assert tick.lacks_recorded() == ["robot_3"]
    tick.given_up.add("robot_3")
    assert tick.lacks_recorded() == []
    assert tick.open(0, 3, []).participants == sorted(listed)
    assert tick.joining == {"robot_2"}
    answer(tick, *listed)
    assert (tick.is_over, tick.missing()) == (False, ["robot_1"])
    tick.on_token("robot_1", "session-robot_1", False)
    assert tick.is_over


def test_a_held_tick_admits_no_process_before_all_expected_are_there() -> None:
    """The participants are then the same whatever the order in which they came."""
    tick = OpenTick(["robot_0", "tf"], gate=False)
    join(tick, "robot_0")
    assert tick.open(0, 1, []).participants == []
    assert not tick.is_over
    join(tick, "tf")
    assert tick.must_reopen
    assert tick.reopen().participants == ["robot_0", "tf"]
    answer(tick, "robot_0", "tf")
    assert tick.is_over


def test_a_held_tick_carries_no_go_before_all_expected_are_there() -> None:
    """GO is announced to all in the same tick, and the highest epoch counts."""
    tick = OpenTick(["robot_0"])
    tick.on_go(3)
    tick.on_go(2)
    assert tick.open(0, 1, []).epoch == 0
    join(tick, "robot_0")
    assert (tick.reopen().epoch, tick.message.participants) == (3, ["robot_0"])


def test_the_gate_holds_the_first_tick_until_go() -> None:
    """Without the gate it is over at once."""
    held, free = OpenTick(gate=True), OpenTick(gate=False)
    for tick in (held, free):
        tick.open(0, 1, [])
    assert (held.is_over, free.is_over) == (False, True)
    assert held.waiting_for().startswith("the monitor's GO")
    held.on_go(1)
    held.reopen()
    assert held.is_over


def test_only_a_held_tick_is_opened_again() -> None:
    """Later a process that joins waits for the next tick."""
    tick = begun("tf")
    join(tick, "robot_0")
    assert not tick.must_reopen
    assert tick.open(0, 3, []).participants == ["robot_0", "tf"]


def test_asking_to_join_again_is_no_news() -> None:
    """Otherwise every answer of a process that waits to be let in would repeat the held tick."""
    tick = OpenTick(["robot_0", "tf"], gate=False)
    join(tick, "robot_0")
    tick.open(0, 1, [])
    answer(tick, "robot_0")
    assert not tick.must_reopen


@pytest.mark.parametrize(
    ("name", "alive", "repeats"), [("new", True, True), ("tf", False, True), ("new", False, False)]
)
def test_a_token_repeats_the_tick_for_those_that_must_know(name: str, alive: bool, repeats: bool) -> None:
    """A new process must hear it to join; participants must hear that another one has left."""
    assert begun("robot_0", "tf").on_token(name, f"session-{name}", alive) is repeats


def test_no_token_repeats_a_tick_that_was_never_opened() -> None:
    """Before the first tick there is nothing to send."""
    assert not OpenTick().on_token("tf", "a", True)


@pytest.mark.parametrize(
    ("missing", "dropped"), [(["robot_0", "tf"], ["tf"]), (["robot_0", "robot_1"], ["robot_0", "robot_1"])]
)
def test_a_silent_aggregator_is_dropped_before_the_robots(missing: list[str], dropped: list[str]) -> None:
    """Robots wait for its transforms, so that their silence may follow from its silence."""
    tick = begun("robot_0", "robot_1", "tf")
    assert tick.drop_silent(missing) == dropped
    assert tick.refreshed().participants == sorted({"robot_0", "robot_1", "tf"} - {*dropped})


def test_commands_are_those_of_robots_in_the_world() -> None:
    """By id; an answer without a command gives none."""
    tick = begun("robot_10", "robot_2", "robot_3", "tf")
    for robot_id in (10, 2):
        tick.on_done(f"robot_{robot_id}", f"session-robot_{robot_id}", Done(0, 2, True, Twist(Vector3(0.1 * robot_id))))
    answer(tick, "robot_3", "tf")
    assert list(tick.commands({2, 3, 10}).items()) == [(2, Twist(Vector3(0.2))), (10, Twist(Vector3(1.0)))]
    assert list(tick.commands({10})) == [10]


def test_an_answer_to_another_tick_is_not_the_answer() -> None:
    """Answers to older or newer ticks, or to the same number under another epoch, have no effect."""
    tick = begun("robot_0", "tf")
    for stray in (Done(0, 1), Done(0, 3), Done(1, 2)):
        assert tick.on_done("tf", "session-tf", stray)
    assert (tick.missing(), tick.answers) == (["robot_0", "tf"], {})


def test_go_opens_the_held_tick_anew() -> None:
    """The same tick under another epoch is another tick: all have to answer it."""
    tick = OpenTick(["robot_0"])
    join(tick, "robot_0")
    tick.open(0, 1, [0])
    answer(tick, "robot_0")
    tick.on_go(1)
    assert tick.reopen().epoch == 1
    assert tick.missing() == ["robot_0"]


def test_a_robot_that_leaves_stops() -> None:
    """Whether it has answered the open tick or not; with the next tick that rule has done its work."""
    tick = begun("robot_0", "robot_1", "tf")
    tick.on_done("robot_0", "session-robot_0", Done(0, 2, True, Twist(Vector3(0.3))))
    for name in ("robot_0", "robot_1"):
        tick.on_token(name, f"session-{name}", False)
    answer(tick, "tf")
    assert tick.is_over
    assert tick.commands({0, 1}) == {0: Twist(), 1: Twist()}
    tick.open(0, 3, [])
    assert tick.commands({0, 1}) == {}


def test_a_robot_that_comes_back_within_the_held_tick_has_its_say() -> None:
    """What the new process answers counts, not that the old one left."""
    tick = OpenTick(["robot_0"], gate=False)
    join(tick, "robot_0")
    tick.open(0, 1, [])
    tick.on_token("robot_0", "session-robot_0", False)
    join(tick, "robot_0")
    tick.reopen()
    tick.on_done("robot_0", "session-robot_0", Done(0, 1, True, Twist(Vector3(0.3))))
    assert tick.commands({0}) == {0: Twist(Vector3(0.3))}


def test_after_a_restart_of_the_world_old_answers_do_not_count() -> None:
    """The tick of the same number has to be answered again."""
    tick = begun("tf")
    answer(tick, "tf")
    tick.start_anew()
    tick.open(0, 2, [])
    assert not tick.is_over


def test_a_process_that_ends_in_the_held_tick_after_go_is_not_waited_for() -> None:
    """Once all expected processes have the tick with GO, an end in it counts as in any later tick."""
    tick = OpenTick(["robot_0", "robot_1"])
    join(tick, "robot_0", "robot_1")
    tick.on_go(1)
    assert tick.open(0, 1, [0, 1]).epoch == 1
    answer(tick, "robot_1")
    assert tick.on_token("robot_0", "session-robot_0", False)
    assert tick.must_reopen
    assert tick.reopen().participants == ["robot_1"]
    answer(tick, "robot_1")
    assert (tick.is_over, tick.waiting_for()) == (True, "")


def test_a_process_that_ends_in_the_held_tick_before_go_is_waited_for() -> None:
    """Without it the team is not complete."""
    tick = OpenTick(["robot_0", "robot_1"])
    join(tick, "robot_0", "robot_1")
    tick.open(0, 1, [0, 1])
    tick.on_token("robot_0", "session-robot_0", False)
    tick.on_go(1)
    assert tick.reopen().epoch == 0
    answer(tick, "robot_1")
    assert not tick.is_over
    assert tick.waiting_for().startswith("robot_0")


@pytest.mark.parametrize(
    ("silent", "answered", "lacking", "named"),
    [
        (("robot_0", "robot_1", "tf"), (), {}, "waits for tf for 2 s"),
        (("robot_0", "robot_1"), (), {}, "waits for robot_0, robot_1 for 2 s"),
        (("robot_1",), (), None, "waits for robot_1 for 2 s: no process answers over the router"),
        (("robot_1",), ("robot_0",), None, "waits for all answers for 2 s: no process answers over the router"),
        (("robot_0", "robot_1"), (), None, "waits for all answers for 2 s: no process answers over the router"),
    ],
)
def test_a_complaint_names_those_to_blame(
    silent: tuple[str, ...], answered: tuple[str, ...], lacking: dict[str, str] | None, named: str
) -> None:
    """Not the robots that wait for the aggregator, nor any of a team behind a router that is silent."""
    tick = begun(*silent, *answered)
    for name in answered:
        answer(tick, name)
    assert tick.complaint(2.0, lacking) == f"tick {tick.message.tick} {named}"
