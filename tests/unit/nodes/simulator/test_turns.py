"""The main loop's turns: changes as futures, and what ends a wait."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import UsageError
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.turns import Turns
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.shutdown import Stop


@pytest.fixture
def node(hub: MemoryHub) -> Iterator[ProcessNode]:
    """The simulator's node."""
    made = ProcessNode(names.SIMULATOR, hub.bus(), Stop())
    yield made
    made.close()


def free_turns(node: ProcessNode) -> Turns:
    """A world in which a tick is always due."""
    return Turns(node, Pacer(1_000_000, None))


def test_a_change_is_made_by_the_main_loop(node: ProcessNode) -> None:
    """Its future has the result after the next turn, and not before."""
    turns = free_turns(node)
    future: Future[int] = turns.submit(threading.get_ident)
    assert not future.done()
    assert turns.wait_for_turn()
    assert future.result(0) == threading.get_ident()


def test_changes_are_made_in_the_order_of_asking(node: ProcessNode) -> None:
    """All of them before the next tick."""
    turns, made = free_turns(node), list[int]()
    futures = [turns.submit(lambda i=i: made.append(i)) for i in range(5)]
    assert turns.wait_for_turn()
    assert made == [0, 1, 2, 3, 4]
    assert all(future.done() for future in futures)


def test_an_error_of_zteam_goes_to_the_future(node: ProcessNode) -> None:
    """The main loop goes on."""
    turns = free_turns(node)

    def fail() -> None:
        raise UsageError("no robot 9")

    future = turns.submit(fail)
    assert turns.wait_for_turn()
    assert isinstance(future.exception(0), UsageError)


def test_a_fault_in_a_change_ends_the_main_loop(node: ProcessNode) -> None:
    """It is a bug in the simulator, not in what was asked for."""
    turns = free_turns(node)
    turns.submit(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        turns.wait_for_turn()


def test_a_change_wakes_a_world_that_stands(node: ProcessNode) -> None:
    """A paused world makes it at once and goes on standing."""
    turns = Turns(node, Pacer(1_000_000, None, paused=True))
    thread = threading.Thread(target=turns.wait_for_turn)
    thread.start()
    assert turns.wait_until_standing(LIMIT)
    assert turns.submit(lambda: "made").result(LIMIT) == "made"
    assert turns.submit(lambda: "made too").result(LIMIT) == "made too"
    node.stop.request("test over")
    thread.join(LIMIT)
    assert not thread.is_alive()


def test_a_reset_gives_one_turn_to_a_world_that_is_over(node: ProcessNode) -> None:
    """The first tick is sent; then a paused world stands again."""
    turns = Turns(node, Pacer(1_000_000, None, paused=True))
    turns.finish()
    assert turns.wait_until_finished(0.0)
    turns.begin_anew()
    assert turns.wait_for_turn()
    assert not turns.finished
    assert not turns.wait_until_finished(0.0)


def test_a_stop_request_gives_no_turn(node: ProcessNode) -> None:
    """Though a tick is due."""
    node.stop.request("test")
    assert free_turns(node).wait_for_turn() is False
