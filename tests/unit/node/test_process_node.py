"""A process on a bus in memory: which messages wake the threads that wait for a change, and steps."""

import threading
from collections.abc import Iterator

import pytest

from support.limits import LIMIT
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.errors import BusError
from zteam.messages import String
from zteam.node import process_node as module
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop


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
        self.looks = 0
        self.threads: set[threading.Thread] = set()
        """Which of them looked."""
        self.thread = threading.Thread(target=self._wait)
        self.thread.start()
        with node.changed:
            assert wait_until(node.changed, lambda: self.looks > 0, LIMIT)

    def _wait(self) -> None:
        assert self._node.wait(self._is_heard, LIMIT)

    def _is_heard(self) -> bool:
        self.looks += 1
        self.threads.add(threading.current_thread())
        if self.looks == 1:
            self._node.changed.notify_all()
        return self._word in self._heard


def test_a_message_wakes_only_a_thread_that_waits_for_it(hub: MemoryHub, node: ProcessNode) -> None:
    """Other messages are looked at in the thread that brings them: the one that waits sleeps on."""
    heard: list[str] = []
    node.subscribe("words", String, lambda key, message: heard.append(message.data))
    waiter, words = Waiter(node, heard, "go"), hub.bus().publisher("words", String)
    waiter.threads.clear()
    for _ in range(100):
        words.put(String("other"))
    assert waiter.threads == {threading.current_thread()}
    words.put(String("go"))
    waiter.thread.join(LIMIT)
    assert not waiter.thread.is_alive()
    assert heard.count("other") == 100


def test_each_of_several_waits_ends_with_its_own_message(hub: MemoryHub, node: ProcessNode) -> None:
    """Two threads wait for two words: neither misses its own."""
    heard: list[str] = []
    node.subscribe("words", String, lambda key, message: heard.append(message.data))
    first, second = Waiter(node, heard, "first"), Waiter(node, heard, "second")
    words = hub.bus().publisher("words", String)
    words.put(String("second"))
    second.thread.join(LIMIT)
    assert (first.thread.is_alive(), second.thread.is_alive()) == (True, False)
    words.put(String("first"))
    first.thread.join(LIMIT)
    assert not first.thread.is_alive()


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
