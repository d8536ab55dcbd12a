"""What a run of a study gives: which followers are held, how long all robots stand, and how far the head drives."""

import numpy as np
import pytest

from studies.study.one_run import Outcome, Task, distances, longest_stand, measure, pairs_of


def test_a_stand_is_one_of_the_whole_team() -> None:
    """Only ticks count in which no robot gets 5 cm from where it was; a slow robot moves, trembling is none."""
    ticks = np.arange(200)
    creeping = np.stack([0.009 * ticks, 0.0 * ticks], axis=1)
    trembling = np.stack([0.02 * (-1.0) ** ticks, 0.0 * ticks], axis=1)
    assert longest_stand(np.stack([creeping, trembling], axis=1)) == 6
    assert longest_stand(trembling[:, None]) == 200
    stops = np.stack([np.minimum(ticks, 50) * 0.1, 0.0 * ticks], axis=1)
    assert longest_stand(np.stack([stops, trembling], axis=1)) == 149


def test_a_run_is_measured() -> None:
    """The shipped arena for 10 s: both drive, the follower is held, and the same task gives the same outcome."""
    task = Task("arena", 10.0, 1)
    found = measure(task)
    assert found.error == ""
    assert found.contacts == 0
    assert list(found.held) == [1]
    assert found.held[1] > 0.5
    assert found.share == pytest.approx(found.driven[0] / 4.0, abs=0.02)
    assert 0.0 < found.driven[0] <= 4.0
    assert measure(task) == found


def test_held_is_about_the_robot_that_is_followed_now() -> None:
    """A robot that follows another one from then on is measured from that; one that leads is not measured."""
    places = np.array([[[4.0 * robot, 0.0] for robot in range(3)]] * 2)
    assert distances(places, (0, 1, 2), [{0: -1, 1: 0, 2: 1}, {0: -1, 1: 2, 2: 0}]) == {1: [4.0, 4.0], 2: [4.0, 8.0]}


def test_a_status_that_comes_late_changes_nothing() -> None:
    """In a tick before a robot's first status it counts as a follower of the robot which that names."""
    places = np.array([[[0.0, 0.0], [4.0, 0.0]]] * 2)
    assert distances(places, (0, 1), [{}, {1: 0}]) == {1: [4.0, 4.0]}


def test_a_pair_is_the_same_whichever_robot_follows() -> None:
    """A line that is led from the other end has the same pairs of robots; one that follows nobody has none."""
    assert pairs_of([{0: -1, 1: 0, 2: 1}, {0: 1, 1: 2, 2: -1}, {0: -1}]) == [{1: 0, 2: 1}, {1: 0, 2: 1}, {}]


@pytest.mark.team
def test_processes_are_measured_as_a_team_in_this_process() -> None:
    """In lock-step the processes that `zteam up` starts give the same outcome as a team in this process."""
    assert measure(Task("arena", 5.0, 1, processes=True)) == measure(Task("arena", 5.0, 1))


@pytest.mark.team
@pytest.mark.real_time
def test_a_run_in_real_time_is_measured() -> None:
    """All figures are there that are compared with lock-step."""
    found = measure(Task("arena", 5.0, 1, processes=True, speed=0.5))
    assert (found.error, found.contacts, found.gaps.keys(), len(found.stands)) == ("", 0, {1}, 2)
    assert found.driven[0] > 0.5


def test_an_error_is_an_outcome() -> None:
    """A team that cannot run says why, in one outcome."""
    found = measure(Task("no_such_team.toml", 1.0, 1))
    assert found == Outcome(error=found.error)
    assert "no_such_team" in found.error
