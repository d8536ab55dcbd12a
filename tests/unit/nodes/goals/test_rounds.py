"""Which goal a robot gets next."""

from zteam.geometry import Pose2
from zteam.nodes.goals.file import FileGoal
from zteam.nodes.goals.rounds import Rounds


def goals(*robots: int | None) -> list[FileGoal]:
    """Goals of these robots; the line is the place in the list."""
    return [FileGoal(robot, Pose2(float(line), 0.0, 0.0), line) for line, robot in enumerate(robots)]


def taken(rounds: Rounds, robot_id: int, most: int = 10) -> list[int]:
    """The lines of the goals that a robot gets, `most` at most."""
    found = []
    while len(found) < most and (goal := rounds.take(robot_id)) is not None:
        found.append(goal.line)
    return found


def test_a_robot_gets_its_own_goals_in_their_order() -> None:
    """Goals of other robots are left to them."""
    rounds = Rounds(goals(1, 2, 1, 1))
    assert rounds.robots == [1, 2]
    assert taken(rounds, 1) == [0, 2, 3]
    assert taken(rounds, 2) == [1]
    assert (rounds.count(1), rounds.count(2)) == (3, 1)


def test_rounds_begin_again() -> None:
    """So many rounds, or without end."""
    assert taken(Rounds(goals(1, 1), rounds=2), 1) == [0, 1, 0, 1]
    assert taken(Rounds(goals(1, 1), rounds=None), 1) == [0, 1] * 5


def test_shared_goals_go_to_each_robot_that_is_free() -> None:
    """Each shared goal is given once a round, after a robot's own; robots that do not share get none."""
    rounds = Rounds(goals(None, 1, None, 5, None), spread=[0, 1], rounds=2)
    assert rounds.robots == [0, 1, 5]
    assert [rounds.take(0).line, rounds.take(1).line, rounds.take(0).line] == [0, 1, 2]  # type: ignore[union-attr]
    assert taken(rounds, 5) == [3, 3]
    assert taken(rounds, 0) == [4, 0, 2, 4]
    assert taken(rounds, 1) == [1]
    assert (rounds.count(0), rounds.count(1), rounds.count(5)) == (3, 4, 1)
