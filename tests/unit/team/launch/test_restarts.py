"""Processes that are started again after a failure: how often, when, and in which words."""

import threading

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.clock import wait_until
from zteam.team.launch import supervisor as restarts
from zteam.team.launch.supervisor import DELAYS, STEADY, Again, Restarts, after_failure, log_failure


def test_the_delay_grows_and_then_it_is_given_up() -> None:
    """Each failure in a row waits at least as long as the one before; after the last delay there is none."""
    failures = [after_failure(before, 1.0) for before in range(len(DELAYS) + 2)]
    assert [again.delay for again in failures] == [*DELAYS, None, None]
    assert list(DELAYS) == sorted(DELAYS)
    assert [again.in_row for again in failures] == [*range(1, len(DELAYS) + 3)]


def test_a_steady_process_has_recovered() -> None:
    """A failure after a long run is the first in a row, also for a process that had only one attempt left."""
    assert after_failure(len(DELAYS), STEADY) == Again(DELAYS[0], 1)
    assert after_failure(1, STEADY - 0.1) == Again(DELAYS[1], 2)


class Team:
    """Restarts of a set of names."""

    def __init__(self, *allowed: str) -> None:
        self.started: list[str] = []
        self.changed = threading.Condition()
        self.restarts = Restarts(self._start)
        for name in allowed:
            self.restarts.note_start(name, restarts=True)

    def _start(self, name: str) -> None:
        with self.changed:
            self.started.append(name)
            self.changed.notify_all()

    def wait_for(self, *names: str) -> None:
        """Wait until these were started again, in any order."""
        with self.changed:
            assert wait_until(self.changed, lambda: sorted(self.started) == sorted(names), LIMIT), self.started


@pytest.fixture
def team(monkeypatch: pytest.MonkeyPatch) -> Team:
    """Two of three names are started again, at once."""
    monkeypatch.setattr(restarts, "DELAYS", (0.0, 0.0))
    return Team("robot_0", "planner")


def test_a_process_is_started_again_until_it_is_given_up(team: Team) -> None:
    """Each failure has one start, and is counted; names that are not allowed have none."""
    for count in (1, 2):
        team.restarts.note_start("planner", restarts=True)
        assert team.restarts.take_failure("planner") == Again(0.0, count)
        team.wait_for(*["planner"] * count)
    assert team.restarts.take_failure("planner") == Again(None, 3)
    assert team.restarts.take_failure("sim") == Again()
    assert team.restarts.counts == {"planner": 2}


def test_what_is_cancelled_does_not_start(team: Team, monkeypatch: pytest.MonkeyPatch) -> None:
    """A restart that is due is called off; later failures have none."""
    monkeypatch.setattr(restarts, "DELAYS", (LIMIT,))
    assert team.restarts.take_failure("planner").delay == LIMIT
    assert team.restarts.take_failure("robot_0").delay == LIMIT
    timers = [thread for thread in threading.enumerate() if thread.name.startswith("restart ")]
    assert len(timers) == 2
    team.restarts.cancel(["planner", "robot_0"])
    for timer in timers:
        timer.join(LIMIT / 2)
        assert not timer.is_alive()
    assert team.started == []
    assert team.restarts.take_failure("robot_0") == Again()


def test_a_failure_is_told_with_what_follows() -> None:
    """Exit code or signal, the delay and the count; that it is given up, and why; or that it is never started again."""
    with captured_log() as told:
        log_failure("planner", 3, Again(2.0, 2))
        log_failure("planner", -9, Again(None, 6))
        log_failure("sim", -11, Again())
    assert told.lines == [
        "planner ended: exit code 3; it is started again in 2 s (2 of 5)",
        "planner ended: killed by SIGKILL; it is not started again: it has failed 6 times in a row",
        "sim ended: killed by SIGSEGV; it is not started again",
    ]
