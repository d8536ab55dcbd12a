"""Calls of users' code in one process: which of them are ended, and which count as hanging."""

import bdb
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.bus.memory import HubReceiver
from zteam.node import working
from zteam.node.working import StepWatch, working_for
from zteam.team.in_process.bridge import Delivery
from zteam.team.launch.plan import Pace
from zteam.team.run import threads
from zteam.team.run.threads import CallWatch, end_user_calls

PACE = Pace(lockstep=True, timeout=0.02)


@pytest.fixture(autouse=True)
def looks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """The calls are looked at often."""
    monkeypatch.setattr(threads, "_PERIOD", 0.01)


@pytest.fixture
def deliver() -> Iterator[Callable[..., threading.Thread]]:
    """`deliver(node, take)`: a thread that has a message handled by it, as the simulator's does."""
    made = list[Delivery]()

    def start(node: str, take: Callable[[object], object]) -> threading.Thread:
        delivery = Delivery()
        made.append(delivery)

        def work() -> None:
            delivery.deliver_in_this_thread()
            try:
                delivery.deliver([HubReceiver(node, take)], None)
            except SystemExit:
                ended.append(node)

        return in_thread(work)

    ended.clear()
    yield start
    for each in made:
        each.close()


ended: list[str] = []
"""The nodes whose calls were ended."""


def in_thread(work: Callable[[], object]) -> threading.Thread:
    """A thread that does it."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


@contextmanager
def watching(watch: CallWatch, pace: Pace = PACE, *, in_real_time: bool = False) -> Iterator[None]:
    """Within, the calls are looked at."""
    end = watch.start(pace, in_real_time=in_real_time)
    try:
        yield
    finally:
        end()


def loop(_news: object = None) -> None:
    """Never returns."""
    while True:
        pass


def test_only_a_call_that_holds_the_world_is_ended(deliver: Callable[..., threading.Thread]) -> None:
    """A start in its node's own thread may take any time; a loop in the simulator's thread ends, with its line."""
    begun, done = threading.Event(), threading.Event()

    def prepare() -> None:
        with working_for("robot_0"):
            begun.set()
            while not done.is_set():
                pass

    watch = CallWatch()
    with captured_log() as log, watching(watch):
        slow = in_thread(prepare)
        assert begun.wait(LIMIT)
        world = deliver("robot_1", loop)
        world.join(LIMIT)
        assert not world.is_alive()
        assert slow.is_alive()
        done.set()
        slow.join(LIMIT)
    assert ended == [*watch.hung] == ["robot_1"]
    assert log.count("robot_1 hangs: after 0.02 s loop has not returned") == 1
    assert f'File "{__file__}"' in watch.hangs["robot_1"]


def test_a_step_that_loops_in_its_own_thread_is_ended() -> None:
    """With `in_real_time` calls are ended out of lock-step too."""
    watch = CallWatch()

    def work() -> None:
        with working_for("robot_1"), pytest.raises(SystemExit):
            StepWatch("Loop.step", "", "").run(loop, 0.0, paced=True)

    with watching(watch, Pace(timeout=0.02), in_real_time=True):
        thread = in_thread(work)
        thread.join(LIMIT)
    assert not thread.is_alive()
    assert watch.hangs["robot_1"].startswith("robot_1 hangs: after 0.02 s loop has not returned (")


def test_a_debugger_is_not_ended(deliver: Callable[..., threading.Thread]) -> None:
    """The user may look at a call for as long as they like."""
    stopped, done, returned = threading.Event(), threading.Event(), list[bool]()

    class Debugger(bdb.Bdb):
        def user_line(self, frame: object) -> None:
            self.set_continue()
            stopped.set()
            while not done.is_set():
                pass

    def take(_news: object) -> None:
        Debugger().set_trace()
        returned.append(stopped.is_set())

    watch = CallWatch()
    with watching(watch):
        debugged = deliver("robot_0", take)
        assert stopped.wait(LIMIT)
        # Other calls are ended meanwhile.
        deliver("robot_1", loop).join(LIMIT)
        done.set()
        debugged.join(LIMIT)
    assert returned == [True]
    assert ended == [*watch.hangs] == ["robot_1"]


def test_the_calls_of_nodes_alone_are_ended(deliver: Callable[..., threading.Thread]) -> None:
    """At the end of a team, at once; a thread of the test's own goes on."""
    done = threading.Event()

    def wait() -> None:
        while not done.is_set():
            pass

    own = in_thread(wait)
    looping = deliver("robot_0", loop)
    while looping.is_alive():
        end_user_calls()
        looping.join(0.05)
    assert own.is_alive()
    done.set()
    own.join(LIMIT)


def test_what_another_team_left_behind_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of an earlier team that never returned fails no later team of the same process."""
    under_way = set[StepWatch]()
    monkeypatch.setattr(working, "_under_way", under_way)
    old, new = (StepWatch("Loop.step", "a scan comes every", "") for _ in range(2))
    under_way.add(old)
    watch = CallWatch()
    assert watch.hung == set()
    under_way.add(new)
    assert watch.hung == {new.node}


def test_a_call_that_another_team_left_behind_fails_no_later_one(deliver: Callable[..., threading.Thread]) -> None:
    """It cannot be ended, and its node has the name of one of the later team."""
    begun, done = threading.Event(), threading.Event()

    def sleep(_news: object) -> None:
        begun.set()
        done.wait(LIMIT)

    left_behind = deliver("robot_0", sleep)
    assert begun.wait(LIMIT)
    watch = CallWatch()
    with watching(watch):
        deliver("robot_1", loop).join(LIMIT)
    done.set()
    left_behind.join(LIMIT)
    assert ended == [*watch.hangs] == ["robot_1"]
