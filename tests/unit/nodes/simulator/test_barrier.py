"""The barrier: who takes part in a tick, from when on, and whose answers count."""

import pytest

from zteam.messages import Done, Twist, Vector3
from zteam.nodes.simulator.barrier import Barrier


def come(barrier: Barrier, *names: str) -> None:
    """Processes take these names."""
    for name in names:
        barrier.take_token(name, f"first-{name}", True)


def go(barrier: Barrier, name: str) -> None:
    """The process with this name dies."""
    barrier.take_token(name, f"first-{name}", False)


def join(barrier: Barrier, *names: str) -> None:
    """They come, and answer some tick."""
    come(barrier, *names)
    for name in names:
        assert barrier.take_done(name, Done(9, 9))


@pytest.fixture
def team() -> Barrier:
    """Three participants at tick 1."""
    barrier = Barrier()
    join(barrier, "tf", "robot_1", "robot_0")
    assert barrier.open(1, 1) == ["robot_0", "robot_1", "tf"]
    return barrier


def test_a_process_takes_part_from_the_tick_after_its_first_answer() -> None:
    """A living process is nobody until it answers, then joins, and is waited for from the next open on."""
    barrier = Barrier()
    come(barrier, "robot_0")
    assert barrier.open(1, 1) == []
    assert barrier.complete
    assert barrier.take_done("robot_0", Done(1, 1))
    assert (barrier.joining, barrier.members) == ({"robot_0"}, [])
    assert barrier.complete
    assert barrier.open(1, 2) == ["robot_0"]
    assert (barrier.joining, barrier.missing()) == (set(), ["robot_0"])
    assert not barrier.complete


def test_a_tick_is_complete_with_the_last_answer(team: Barrier) -> None:
    """Answers may come in any order; the missing ones are named in the order of names."""
    for name, missing in (("robot_1", ["robot_0", "tf"]), ("tf", ["robot_0"]), ("robot_0", [])):
        assert not team.complete
        assert team.take_done(name, Done(1, 1))
        assert team.missing() == missing
    assert team.complete


def test_an_answer_to_another_tick_is_not_the_answer(team: Barrier) -> None:
    """Older and newer ticks, and another GO's tick of that number, are taken without any effect."""
    for stray in (Done(1, 0), Done(1, 2), Done(0, 1), Done(2, 1)):
        assert team.take_done("tf", stray)
    assert team.missing() == ["robot_0", "robot_1", "tf"]
    assert team.answers == {}


def test_the_newest_answer_to_a_tick_stands(team: Barrier) -> None:
    """A participant that answers twice counts once, with what it said last."""
    team.take_done("robot_0", Done(1, 1, True, Twist(Vector3(0.1))))
    team.take_done("robot_0", Done(1, 1, True, Twist(Vector3(0.2))))
    assert team.answers["robot_0"].command.linear.x == 0.2
    assert team.missing() == ["robot_1", "tf"]


def test_a_new_tick_forgets_the_answers(team: Barrier) -> None:
    """Everybody has to answer every tick."""
    for name in team.members:
        team.take_done(name, Done(1, 1))
    assert team.complete
    assert team.open(1, 2) == ["robot_0", "robot_1", "tf"]
    assert team.answers == {}
    assert team.missing() == ["robot_0", "robot_1", "tf"]


def test_a_tick_that_is_opened_again_keeps_its_answers(team: Barrier) -> None:
    """A newcomer may enter the open tick, which then waits for the newcomer alone."""
    for name in team.members:
        team.take_done(name, Done(1, 1))
    join(team, "robot_2")
    assert team.complete
    assert team.open(1, 1) == ["robot_0", "robot_1", "robot_2", "tf"]
    assert team.missing() == ["robot_2"]


def test_go_opens_the_tick_anew(team: Barrier) -> None:
    """The same tick under another epoch is another tick: all have to answer it."""
    for name in team.members:
        team.take_done(name, Done(1, 1))
    team.open(2, 1)
    assert team.missing() == ["robot_0", "robot_1", "tf"]


def test_nobodys_answer_is_refused(team: Barrier) -> None:
    """Without a token of that name an answer neither joins nor counts."""
    assert not team.take_done("robot_9", Done(1, 1))
    assert (team.joining, team.answers) == (set(), {})
    go(team, "tf")
    assert not team.take_done("tf", Done(1, 1))
    assert team.open(1, 2) == ["robot_0", "robot_1"]


def test_the_dead_are_not_waited_for(team: Barrier) -> None:
    """A participant leaves with its token, and comes back like anybody new."""
    team.take_done("robot_0", Done(1, 1))
    team.take_done("robot_1", Done(1, 1))
    go(team, "tf")
    assert not team.is_alive("tf")
    assert team.complete
    assert team.open(1, 2) == ["robot_0", "robot_1"]
    come(team, "tf")
    assert team.is_alive("tf")
    assert team.missing() == ["robot_0", "robot_1"]
    join(team, "tf")
    assert team.open(1, 3) == ["robot_0", "robot_1", "tf"]


def test_who_dies_while_joining_does_not_enter() -> None:
    """The token goes between the answer and the next tick."""
    barrier = Barrier()
    join(barrier, "robot_0")
    go(barrier, "robot_0")
    assert (barrier.joining, barrier.open(1, 1)) == (set(), [])


def test_a_name_lives_as_long_as_one_of_its_tokens(team: Barrier) -> None:
    """A process that is restarted shows the new token before the old one goes: the name stays in."""
    team.take_token("tf", "second", True)
    go(team, "tf")
    assert team.is_alive("tf")
    assert team.missing() == ["robot_0", "robot_1", "tf"]
    team.take_token("tf", "second", False)
    assert not team.is_alive("tf")
    assert team.missing() == ["robot_0", "robot_1"]


def test_a_token_that_was_never_there_may_go() -> None:
    """The loss of an unknown token is no loss."""
    barrier = Barrier()
    go(barrier, "robot_0")
    assert not barrier.is_alive("robot_0")
    join(barrier, "robot_0")
    assert barrier.open(1, 1) == ["robot_0"]


def test_the_answer_of_the_dead_stays(team: Barrier) -> None:
    """What was answered for the open tick is used, whatever became of who said it."""
    command = Twist(Vector3(0.3))
    team.take_done("robot_0", Done(1, 1, True, command))
    go(team, "robot_0")
    assert team.answers["robot_0"].command == command
    team.take_done("robot_1", Done(1, 1))
    assert team.missing() == ["tf"]
    assert not team.complete
    team.take_done("tf", Done(1, 1))
    assert team.complete


def test_who_is_dropped_lives_and_may_come_back(team: Barrier) -> None:
    """A hung participant is not waited for; its next answer, however old, lets it in at the next tick."""
    team.drop("tf")
    assert team.is_alive("tf")
    assert team.members == ["robot_0", "robot_1"]
    assert team.take_done("tf", Done(1, 1))
    assert (team.joining, team.missing()) == ({"tf"}, ["robot_0", "robot_1"])
    assert team.open(1, 2) == ["robot_0", "robot_1", "tf"]
    team.drop("nobody")
    assert team.members == ["robot_0", "robot_1", "tf"]


def test_who_is_expected_is_absent_until_it_joins() -> None:
    """Being alive is not enough; joining is, and leaving undoes it."""
    barrier = Barrier(["tf", "robot_1", "robot_0"])
    assert barrier.absent == ["robot_0", "robot_1", "tf"]
    come(barrier, "tf")
    assert barrier.absent == ["robot_0", "robot_1", "tf"]
    join(barrier, "tf", "robot_7")
    assert barrier.absent == ["robot_0", "robot_1"]
    barrier.open(0, 1)
    assert barrier.absent == ["robot_0", "robot_1"]
    go(barrier, "tf")
    assert barrier.absent == ["robot_0", "robot_1", "tf"]


def test_the_list_of_an_open_tick_is_not_changed_behind_its_readers(team: Barrier) -> None:
    """What `open` gave is the list as it was then, though somebody leaves meanwhile."""
    listed = team.open(1, 2)
    go(team, "tf")
    assert listed == ["robot_0", "robot_1", "tf"]
    assert team.members == ["robot_0", "robot_1"]
