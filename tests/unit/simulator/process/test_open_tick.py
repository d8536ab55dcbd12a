"""The participants of a tick, and the rules by which it begins and ends, without a bus."""

import pytest

from zteam.messages import Done, Twist, Vector3
from zteam.simulator.process.open_tick import OpenTick


def take_names(tick: OpenTick, *names: str) -> None:
    """Let processes take these names."""
    for name in names:
        tick.take_token(name, f"first-{name}", True)


def lose_name(tick: OpenTick, name: str) -> None:
    """Let the process that holds this name end."""
    tick.take_token(name, f"first-{name}", False)


def join_all(tick: OpenTick, *names: str) -> None:
    """Let processes take these names and answer some tick."""
    take_names(tick, *names)
    for name in names:
        assert tick.take_done(name, f"first-{name}", Done(9, 9))


def free_tick(*expected: str) -> OpenTick:
    """No tick is held, and GO was given."""
    tick = OpenTick(expected, gate=False)
    tick.end()
    tick.take_go(1)
    return tick


def open_tick(tick: OpenTick, number: int) -> list[str]:
    """Open a tick; its participants."""
    return tick.open(0, number, []).participants


@pytest.fixture
def team() -> OpenTick:
    """Three participants at tick 1."""
    tick = free_tick()
    join_all(tick, "tf", "robot_1", "robot_0")
    assert open_tick(tick, 1) == ["robot_0", "robot_1", "tf"]
    return tick


def test_a_process_that_a_fault_keeps_out_joins_when_it_is_over(team: OpenTick) -> None:
    """The tick goes on without it, whether it asks to be let in or not, and lists it again as soon as it may."""
    assert team.open(0, 2, [], frozenset({"robot_1"})).participants == ["robot_0", "tf"]
    assert team.take_done("robot_1", "first-robot_1", Done(1, 2, True, Twist(Vector3(1.0))))
    assert team.open(0, 3, [], frozenset({"robot_1"})).participants == ["robot_0", "tf"]
    assert team.commands({0, 1}) == {}
    assert open_tick(team, 4) == ["robot_0", "robot_1", "tf"]
    lose_name(team, "robot_1")
    assert team.open(0, 5, [], frozenset({"robot_1"})).participants == ["robot_0", "tf"]
    assert open_tick(team, 6) == ["robot_0", "tf"], "it has ended meanwhile"


def test_a_process_takes_part_from_the_tick_after_its_first_answer() -> None:
    """A process joins with its first answer; the tick waits for it from the next tick on."""
    tick = free_tick()
    take_names(tick, "robot_0")
    assert open_tick(tick, 1) == []
    assert tick.complete
    assert tick.take_done("robot_0", "first-robot_0", Done(1, 1))
    assert (tick.joining, tick.members) == ({"robot_0"}, [])
    assert tick.complete
    assert open_tick(tick, 2) == ["robot_0"]
    assert (tick.joining, tick.missing()) == (set(), ["robot_0"])
    assert not tick.complete


def test_a_tick_is_complete_with_the_last_answer(team: OpenTick) -> None:
    """Answers may come in any order; `missing` is sorted by name."""
    for name, missing in (("robot_1", ["robot_0", "tf"]), ("tf", ["robot_0"]), ("robot_0", [])):
        assert not team.complete
        assert team.take_done(name, f"first-{name}", Done(1, 1))
        assert team.missing() == missing
    assert team.complete


def test_an_answer_to_another_tick_is_not_the_answer(team: OpenTick) -> None:
    """Answers to older or newer ticks, or to the same number under another epoch, have no effect."""
    for stray in (Done(1, 0), Done(1, 2), Done(0, 1), Done(2, 1)):
        assert team.take_done("tf", "first-tf", stray)
    assert team.missing() == ["robot_0", "robot_1", "tf"]
    assert team.answers == {}


def test_the_newest_answer_to_a_tick_stands(team: OpenTick) -> None:
    """A participant that answers twice counts once, with its last answer."""
    team.take_done("robot_0", "first-robot_0", Done(1, 1, True, Twist(Vector3(0.1))))
    team.take_done("robot_0", "first-robot_0", Done(1, 1, True, Twist(Vector3(0.2))))
    assert team.answers["robot_0"].command.linear.x == 0.2
    assert team.missing() == ["robot_1", "tf"]


def test_a_new_tick_forgets_the_answers(team: OpenTick) -> None:
    """Every participant has to answer every tick."""
    for name in team.members:
        team.take_done(name, f"first-{name}", Done(1, 1))
    assert team.complete
    assert open_tick(team, 2) == ["robot_0", "robot_1", "tf"]
    assert team.answers == {}
    assert team.missing() == ["robot_0", "robot_1", "tf"]


def test_a_tick_that_is_opened_again_keeps_its_answers(team: OpenTick) -> None:
    """A process may join_all the open tick, which then waits for that process alone."""
    for name in team.members:
        team.take_done(name, f"first-{name}", Done(1, 1))
    join_all(team, "robot_2")
    assert team.complete
    assert open_tick(team, 1) == ["robot_0", "robot_1", "robot_2", "tf"]
    assert team.missing() == ["robot_2"]


def test_go_opens_the_tick_anew(team: OpenTick) -> None:
    """The same tick under another epoch is another tick: all have to answer it."""
    for name in team.members:
        team.take_done(name, f"first-{name}", Done(1, 1))
    team.take_go(2)
    open_tick(team, 1)
    assert team.missing() == ["robot_0", "robot_1", "tf"]


def test_an_answer_without_a_token_is_refused(team: OpenTick) -> None:
    """Without a token of that name an answer neither joins nor counts."""
    assert not team.take_done("robot_9", "first-robot_9", Done(1, 1))
    assert (team.joining, team.answers) == (set(), {})
    lose_name(team, "tf")
    assert not team.take_done("tf", "first-tf", Done(1, 1))
    assert open_tick(team, 2) == ["robot_0", "robot_1"]


def test_an_answer_of_a_session_that_holds_another_name_is_refused(team: OpenTick) -> None:
    """The sender of a sample decides, not its key; the session has the name that it holds."""
    assert not team.take_done("robot_1", "first-robot_0", Done(1, 1, True, Twist(Vector3(1.0))))
    assert (team.answers, team.missing()) == ({}, ["robot_0", "robot_1", "tf"])
    assert (team.holders.name_of("first-robot_0"), team.holders.name_of("first-robot_9")) == ("robot_0", None)


def test_a_process_that_ended_is_not_waited_for(team: OpenTick) -> None:
    """A participant leaves with its token, and comes back like a new process."""
    team.take_done("robot_0", "first-robot_0", Done(1, 1))
    team.take_done("robot_1", "first-robot_1", Done(1, 1))
    lose_name(team, "tf")
    assert "tf" not in team.holders
    assert team.complete
    assert open_tick(team, 2) == ["robot_0", "robot_1"]
    take_names(team, "tf")
    assert "tf" in team.holders
    assert team.missing() == ["robot_0", "robot_1"]
    join_all(team, "tf")
    assert open_tick(team, 3) == ["robot_0", "robot_1", "tf"]


def test_a_process_that_ends_while_joining_does_not_take_part() -> None:
    """Its token goes between the answer and the next tick."""
    tick = free_tick()
    join_all(tick, "robot_0")
    lose_name(tick, "robot_0")
    assert (tick.joining, open_tick(tick, 1)) == (set(), [])


def test_a_name_lives_as_long_as_one_of_its_tokens(team: OpenTick) -> None:
    """A process that is restarted shows the new token before the old one goes: the name stays in."""
    team.take_token("tf", "second", True)
    assert team.take_done("tf", "first-tf", Done(1, 0))
    lose_name(team, "tf")
    assert not team.take_done("tf", "first-tf", Done(1, 1))
    assert team.missing() == ["robot_0", "robot_1", "tf"]
    assert team.take_done("tf", "second", Done(1, 0))
    team.take_token("tf", "second", False)
    assert not team.take_done("tf", "second", Done(1, 1))
    assert team.missing() == ["robot_0", "robot_1"]


def test_a_token_that_was_never_there_may_go() -> None:
    """The loss of an unknown token is no loss."""
    tick = free_tick()
    lose_name(tick, "robot_0")
    assert "robot_0" not in tick.holders
    join_all(tick, "robot_0")
    assert open_tick(tick, 1) == ["robot_0"]


def test_the_answer_of_a_process_that_ended_goes_with_it(team: OpenTick) -> None:
    """Whether its answer or its end came first must not matter; the others are waited for."""
    team.take_done("robot_0", "first-robot_0", Done(1, 1, True, Twist(Vector3(0.3))))
    lose_name(team, "robot_0")
    assert (team.answers, team.left) == ({}, {"robot_0"})
    team.take_done("robot_1", "first-robot_1", Done(1, 1))
    assert team.missing() == ["tf"]
    assert not team.complete
    team.take_done("tf", "first-tf", Done(1, 1))
    assert team.complete


def test_the_answer_of_a_dropped_process_stays(team: OpenTick) -> None:
    """It lives, and what it said counts."""
    command = Twist(Vector3(0.3))
    team.take_done("robot_0", "first-robot_0", Done(1, 1, True, command))
    team.drop_silent(["robot_0"])
    assert (team.answers["robot_0"].command, team.left) == (command, set())


def test_a_dropped_participant_may_come_back(team: OpenTick) -> None:
    """No tick waits for it; its next answer, to whatever tick, makes it join_all the next tick."""
    team.drop_silent(["tf"])
    assert "tf" in team.holders
    assert team.members == ["robot_0", "robot_1"]
    assert team.take_done("tf", "first-tf", Done(1, 1))
    assert (team.joining, team.missing()) == ({"tf"}, ["robot_0", "robot_1"])
    assert open_tick(team, 2) == ["robot_0", "robot_1", "tf"]
    team.drop_silent(["unknown"])
    assert team.members == ["robot_0", "robot_1", "tf"]


def test_an_expected_process_is_absent_until_it_joins() -> None:
    """Holding the name is not enough; and a process that leaves is absent again."""
    tick = free_tick("tf", "robot_1", "robot_0")
    assert tick.absent == ["robot_0", "robot_1", "tf"]
    take_names(tick, "tf")
    assert tick.absent == ["robot_0", "robot_1", "tf"]
    join_all(tick, "tf", "robot_7")
    assert tick.absent == ["robot_0", "robot_1"]
    open_tick(tick, 1)
    assert tick.absent == ["robot_0", "robot_1"]
    lose_name(tick, "tf")
    assert tick.absent == ["robot_0", "robot_1", "tf"]


def test_the_list_of_participants_does_not_change_in_place(team: OpenTick) -> None:
    """The list that `open` returned stays as it was when a participant leaves."""
    listed = open_tick(team, 2)
    lose_name(team, "tf")
    assert listed == ["robot_0", "robot_1", "tf"]
    assert team.members == ["robot_0", "robot_1"]


def join(tick: OpenTick, *names: str) -> None:
    """Let processes take these names and ask to join."""
    for name in names:
        tick.take_token(name, f"session-{name}", True)
        assert tick.take_done(name, f"session-{name}", Done())


def answer(tick: OpenTick, *names: str) -> None:
    """Answer the open tick."""
    for name in names:
        assert tick.take_done(name, f"session-{name}", Done(tick.message.epoch, tick.message.tick))


def begun(*names: str) -> OpenTick:
    """Tick 2 is open, and these take part."""
    tick = OpenTick(gate=False)
    join(tick, *names)
    tick.open(0, 1, [])
    tick.end()
    tick.open(0, 2, [])
    return tick


def test_a_tick_is_over_with_the_last_answer() -> None:
    """And not before."""
    tick = begun("robot_0", "tf")
    answer(tick, "tf")
    assert (tick.is_over, tick.needs_attention, tick.waiting_for()) == (False, False, "robot_0")
    answer(tick, "robot_0")
    assert (tick.is_over, tick.needs_attention, tick.waiting_for()) == (True, True, "")


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
    tick.take_go(3)
    tick.take_go(2)
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
    held.take_go(1)
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
    assert begun("robot_0", "tf").take_token(name, f"session-{name}", alive) is repeats


def test_no_token_repeats_a_tick_that_was_never_opened() -> None:
    """Before the first tick there is nothing to send."""
    assert not OpenTick().take_token("tf", "a", True)


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
        tick.take_done(
            f"robot_{robot_id}", f"session-robot_{robot_id}", Done(0, 2, True, Twist(Vector3(0.1 * robot_id)))
        )
    answer(tick, "robot_3", "tf")
    assert list(tick.commands({2, 3, 10}).items()) == [(2, Twist(Vector3(0.2))), (10, Twist(Vector3(1.0)))]
    assert list(tick.commands({10})) == [10]


def test_a_robot_that_leaves_stops() -> None:
    """Whether it has answered the open tick or not; with the next tick that rule has done its work."""
    tick = begun("robot_0", "robot_1", "tf")
    tick.take_done("robot_0", "session-robot_0", Done(0, 2, True, Twist(Vector3(0.3))))
    for name in ("robot_0", "robot_1"):
        tick.take_token(name, f"session-{name}", False)
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
    tick.take_token("robot_0", "session-robot_0", False)
    join(tick, "robot_0")
    tick.reopen()
    tick.take_done("robot_0", "session-robot_0", Done(0, 1, True, Twist(Vector3(0.3))))
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
    tick.take_go(1)
    assert tick.open(0, 1, [0, 1]).epoch == 1
    answer(tick, "robot_1")
    assert tick.take_token("robot_0", "session-robot_0", False)
    assert tick.must_reopen
    assert tick.reopen().participants == ["robot_1"]
    answer(tick, "robot_1")
    assert (tick.is_over, tick.waiting_for()) == (True, "")


def test_a_process_that_ends_in_the_held_tick_before_go_is_waited_for() -> None:
    """Without it the team is not complete."""
    tick = OpenTick(["robot_0", "robot_1"])
    join(tick, "robot_0", "robot_1")
    tick.open(0, 1, [0, 1])
    tick.take_token("robot_0", "session-robot_0", False)
    tick.take_go(1)
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
