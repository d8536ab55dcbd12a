"""Between two ticks: changes as futures, and what ends a wait."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import UsageError
from zteam.nodes.simulator.pacing import Pacer, TickBoundary
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.shutdown import Stop


@pytest.fixture
def node(hub: MemoryHub) -> Iterator[ProcessNode]:
    """The simulator's node."""
    made = ProcessNode(names.SIMULATOR, hub.bus(), Stop())
    yield made
    made.close()


def free_boundary(node: ProcessNode) -> TickBoundary:
    """A world in which a tick is always due."""
    return TickBoundary(node, Pacer(1_000_000, None))


def test_a_change_is_made_by_the_main_loop(node: ProcessNode) -> None:
    """Its future has the result after the next turn, and not before."""
    boundary = free_boundary(node)
    future: Future[int] = boundary.submit(threading.get_ident)
    assert not future.done()
    assert boundary.wait_for_tick()
    assert future.result(0) == threading.get_ident()


def test_changes_are_made_in_the_order_of_asking(node: ProcessNode) -> None:
    """All of them before the next tick."""
    boundary, made = free_boundary(node), list[int]()
    futures = [boundary.submit(lambda i=i: made.append(i)) for i in range(5)]
    assert boundary.wait_for_tick()
    assert made == [0, 1, 2, 3, 4]
    assert all(future.done() for future in futures)


def test_an_error_of_zteam_goes_to_the_future(node: ProcessNode) -> None:
    """The main loop goes on."""
    boundary = free_boundary(node)

    def fail() -> None:
        raise UsageError("no robot 9")

    future = boundary.submit(fail)
    assert boundary.wait_for_tick()
    assert isinstance(future.exception(0), UsageError)


def test_a_fault_in_a_change_ends_the_main_loop(node: ProcessNode) -> None:
    """It is a bug in the simulator, not in what was asked for."""
    boundary = free_boundary(node)
    boundary.submit(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        boundary.wait_for_tick()


def test_a_change_wakes_a_world_that_stands(node: ProcessNode) -> None:
    """A paused world makes it at once and goes on standing."""
    boundary = TickBoundary(node, Pacer(1_000_000, None, paused=True))
    thread = threading.Thread(target=boundary.wait_for_tick)
    thread.start()
    assert boundary.wait_until_standing(LIMIT)
    assert boundary.submit(lambda: "made").result(LIMIT) == "made"
    assert boundary.submit(lambda: "made too").result(LIMIT) == "made too"
    node.stop.request("test over")
    thread.join(LIMIT)
    assert not thread.is_alive()


def test_a_reset_gives_one_turn_to_a_world_that_is_over(node: ProcessNode) -> None:
    """The first tick is sent; then a paused world stands again."""
    boundary = TickBoundary(node, Pacer(1_000_000, None, paused=True))
    boundary.finish()
    assert boundary.wait_until_finished(0.0)
    boundary.begin_anew()
    assert boundary.wait_for_tick()
    assert not boundary.finished
    assert not boundary.wait_until_finished(0.0)


def test_a_stop_request_gives_no_turn(node: ProcessNode) -> None:
    """Though a tick is due."""
    node.stop.request("test")
    assert free_boundary(node).wait_for_tick() is False
