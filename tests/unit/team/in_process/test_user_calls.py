"""Calls of users' code in one process: which of them are ended, and which count as hanging."""

import threading
from collections.abc import Callable, Iterator

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.node import step_watch
from zteam.node.step_watch import StepWatch
from zteam.team.in_process import user_calls
from zteam.team.in_process.delivery import Delivery, call_as
from zteam.team.in_process.user_calls import CallWatch, UserCall
from zteam.team.launch.team_launch import Pace

PACE = Pace(lockstep=True, timeout=0.05)


@pytest.fixture
def delivery(monkeypatch: pytest.MonkeyPatch) -> Iterator[Delivery]:
    """Of a team whose calls are looked at often."""
    monkeypatch.setattr(user_calls, "_PERIOD", 0.01)
    chosen = Delivery()
    yield chosen
    chosen.close()


def start(work: Callable[[], None]) -> threading.Thread:
    """A thread that does it."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_only_a_call_that_holds_the_world_is_ended(delivery: Delivery) -> None:
    """A start in its node's own thread may take any time; a loop in the simulator's thread ends, with its line."""
    begun, done = threading.Event(), threading.Event()

    def prepare() -> None:
        begun.set()
        while not done.is_set():
            pass

    def loop() -> None:
        while True:
            pass

    def work() -> None:
        delivery.deliver_in_this_thread()
        with pytest.raises(SystemExit):
            call_as("robot_1", loop)

    watch = CallWatch(PACE, delivery)
    with captured_log() as log, watch.watching():
        slow = start(lambda: call_as("robot_0", prepare))
        assert begun.wait(LIMIT)
        world = start(work)
        world.join(LIMIT)
        assert not world.is_alive()
        assert slow.is_alive()
        done.set()
        slow.join(LIMIT)
    assert watch.hung == {"robot_1"}
    assert log.count("loop has not returned") == 1


def test_what_another_team_left_behind_does_not_count(delivery: Delivery, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of an earlier team that never returned fails no later team of the same process."""
    monkeypatch.setattr(step_watch, "_start", lambda: None)
    monkeypatch.setattr(step_watch, "_under_way", set())
    old, new = (StepWatch("Loop.step", "a scan comes every", "") for _ in range(2))

    def hang(step: StepWatch) -> None:
        step_watch._under_way.add(step)
        for _ in range(round(step_watch.LONG / step_watch.LOOK)):
            step.look()

    hang(old)
    watch = CallWatch(PACE, delivery)
    assert watch.hung == set()
    hang(new)
    assert watch.hung == {new.node}


def test_a_call_that_another_team_left_behind_fails_no_later_one(delivery: Delivery) -> None:
    """It cannot be ended, and its node has the name of one of the later team."""
    begun, done, taken, seen = threading.Event(), threading.Event(), list[str](), threading.Event()

    def sleep() -> None:
        begun.set()
        done.wait(LIMIT)

    def take(call: UserCall) -> bool:
        taken.append(call.owner)
        seen.set()
        return False

    left_behind = start(lambda: call_as("robot_0", sleep))
    assert begun.wait(LIMIT)
    watch = CallWatch(PACE, delivery, take)
    begun.clear()
    new = start(lambda: call_as("robot_1", sleep))
    with watch.watching():
        assert seen.wait(LIMIT)
    done.set()
    for each in (left_behind, new):
        each.join(LIMIT)
    assert {*taken} == {"robot_1"}
