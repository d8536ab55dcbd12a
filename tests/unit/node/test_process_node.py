"""A process on a bus in memory: which messages wake the threads that wait for a change, steps, and jumps of time."""

import threading
from collections.abc import Iterator
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.limits import LIMIT
from zteam.bus import MemoryHub
from zteam.errors import BusError
from zteam.messages import String
from zteam.node import process_node as module
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop

TICK = 100_000_000


@pytest.fixture
def node(hub: MemoryHub) -> Iterator[ProcessNode]:
    """A node that ends with the test."""
    made = ProcessNode("listener", hub.bus(), Stop())
    yield made
    made.close()


class Waiter:
    """A thread that waits until `node` has heard a word."""

    def __init__(self, node: ProcessNode, heard: list[str], word: str) -> None:
        self._node, self._heard, self._word = node, heard, word
        self._has_looked = threading.Event()
        self.threads: set[threading.Thread] = set()
        """Which of them looked."""
        self.thread = threading.Thread(target=self._wait)
        self.thread.start()
        assert self._has_looked.wait(LIMIT)
        with node.changed:
            # It looks with the lock, and waits when that is free.
            pass

    def _wait(self) -> None:
        assert self._node.wait(self._is_heard, LIMIT)

    def _is_heard(self) -> bool:
        self.threads.add(threading.current_thread())
        self._has_looked.set()
        return self._word in self._heard


def test_a_message_wakes_only_a_thread_that_waits_for_it(hub: MemoryHub, node: ProcessNode) -> None:
    """Two threads wait for two words, and neither misses its own. Other messages are looked at in the thread that
    brings them: those that wait sleep on."""
    heard: list[str] = []
    node.subscribe("words", String, lambda key, message: heard.append(message.data))
    waiters = [Waiter(node, heard, word) for word in ("first", "second")]
    words = hub.bus().publisher("words", String)
    for waiter in waiters:
        waiter.threads.clear()
    for _ in range(100):
        words.put(String("other"))
    assert [waiter.threads for waiter in waiters] == [{threading.current_thread()}] * 2
    for waiter, word in ((waiters[1], "second"), (waiters[0], "first")):
        assert waiter.thread.is_alive()
        words.put(String(word))
        waiter.thread.join(LIMIT)
        assert not waiter.thread.is_alive()
    assert heard.count("other") == 100


def test_an_error_ends_a_wait_for_something_else(node: ProcessNode) -> None:
    """A handler that fails wakes the main loop, which raises the error."""
    errors: list[str] = []

    def wait() -> None:
        try:
            node.wait(lambda: False, LIMIT)
        except ValueError as error:
            errors.append(str(error))

    thread = threading.Thread(target=wait)
    thread.start()
    node.fail(ValueError("of a handler"))
    thread.join(LIMIT)
    assert errors == ["of a handler"]


class Desk:
    """A node whose step hears words in the middle, and waits until `go_on`."""

    def __init__(self, hub: MemoryHub, node: ProcessNode) -> None:
        self.heard: list[str] = []
        self.in_step, self.go_on = threading.Event(), threading.Event()
        self._node, self._words = node, hub.bus().publisher("words", String)
        node.subscribe("words", String, lambda _, message: self.heard.append(message.data))
        node.become_present()

    def say(self, word: str) -> None:
        """Publish a word."""
        self._words.put(String(word))

    def step(self, _given: int) -> str:
        """Wait in the step."""
        self.in_step.set()
        assert self.go_on.wait(LIMIT)
        return "done"

    def begin(self) -> threading.Thread:
        """Take a step in a thread, and return when it is under way."""

        def end(given: int, result: str) -> None:
            self.heard.append(f"{result} {given}")

        thread = threading.Thread(target=lambda: self._node.take_step(lambda: 7, self.step, end))
        thread.start()
        assert self.in_step.wait(LIMIT)
        return thread


def test_what_comes_during_a_step_is_taken_after_it(hub: MemoryHub, node: ProcessNode) -> None:
    """In its order, after the end of the step; no thread of the bus waits meanwhile, and no other step begins."""
    desk = Desk(hub, node)
    thread = desk.begin()
    desk.say("one")
    desk.say("two")
    begun: list[int] = []
    node.take_step(lambda: begun.append(8), desk.step)
    assert desk.heard == begun == []
    desk.go_on.set()
    thread.join(LIMIT)
    desk.say("three")
    assert desk.heard == ["done 7", "one", "two", "three"]


def test_what_must_not_happen_during_a_step_waits_for_its_end(
    hub: MemoryHub, node: ProcessNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step that does not return is named after a while."""
    monkeypatch.setattr(module, "STEP_LIMIT", 0.01)
    desk = Desk(hub, node)
    thread = desk.begin()
    with pytest.raises(BusError, match="a step of listener has not returned"), node.between_steps():
        raise AssertionError("during the step")
    desk.go_on.set()
    thread.join(LIMIT)
    with node.between_steps():
        desk.heard.append("between")
    assert desk.heard == ["done 7", "between"]


def test_a_node_that_is_to_stop_does_not_end_its_step(hub: MemoryHub, node: ProcessNode) -> None:
    """What the step found out is not published any more, and the node closes when it is over."""
    desk = Desk(hub, node)
    thread = desk.begin()
    node.stop.request("test")
    closing = threading.Thread(target=node.close)
    closing.start()
    assert node.present
    desk.go_on.set()
    for each in (thread, closing):
        each.join(LIMIT)
    assert (desk.heard, node.present) == ([], False)


def node_after(*ticks: int) -> ProcessNode:
    """A process whose time was this, in ticks."""
    node = ProcessNode("a", MemoryHub().bus(), Stop(), "sim")
    for tick in ticks:
        node.set_time(tick * TICK)
    return node


@given(st.integers(3, 500), st.integers(0, 1), st.integers(1, 500))
def test_messages_of_a_time_that_has_ended_are_told_apart(end: int, earlier: int, last: int) -> None:
    """What was sent in the last two ticks of the old time is of the old time, and all from the new first tick on is
    not, each in a tick that is open or that comes next."""
    node = node_after(end, 1)
    assert node.is_of_ended_time(lambda: (end - (earlier if end > 4 else 0)) * TICK)
    for tick in range(1, last):
        node.set_time(max(1, tick - tick % 2) * TICK)
        assert not node.is_of_ended_time(partial(int, tick * TICK))


@pytest.mark.parametrize(
    ("ticks", "stamp", "is_ended"),
    [((1,), 99, False), ((60, 1), 0, False), ((60, 1, 29), 60, True), ((60, 1, 60), 99, False)],
)
def test_no_message_is_of_an_ended_time_without_a_jump_or_a_stamp(
    ticks: tuple[int, ...], stamp: int, is_ended: bool
) -> None:
    """Nor once time has reached its old end: by then all messages of the old time have come."""
    assert node_after(*ticks).is_of_ended_time(lambda: stamp * TICK) == is_ended
