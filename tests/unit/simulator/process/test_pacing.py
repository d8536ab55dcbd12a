"""When ticks are due, at any pace, and what is done between two of them."""

import math
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from itertools import pairwise

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import UsageError
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.simulator.process.pacing import MAX_LAG, Pacer, TickBoundary

TICK = 100_000_000
"""Simulated nanoseconds a tick."""
S = TICK / 1e9


class ScriptedHost:
    """A host on which each tick takes the time that the test gives."""

    def __init__(self, pacer: Pacer, now: float = 1000.0) -> None:
        self.pacer, self.now = pacer, now
        self.starts: list[float] = []

    def run(self, costs: Iterable[float]) -> list[float]:
        """Take one tick for each cost (s); the times at which these ticks began."""
        first = len(self.starts)
        for cost in costs:
            remaining = self.pacer.remaining(self.now)
            assert remaining is not None, "the world stands still"
            self.now += remaining
            self.pacer.start(self.now)
            self.starts.append(self.now)
            self.now += cost
        return self.starts[first:]

    def steps(self, limit: int = 1000) -> int:
        """Tick until the world stands still; the number of ticks."""
        for count in range(limit):
            if self.pacer.remaining(self.now) is None:
                return count
            self.run([0.0])
        raise AssertionError(f"still going after {limit} ticks")


def gaps(starts: list[float]) -> list[float]:
    """Seconds between ticks."""
    return [b - a for a, b in pairwise(starts)]


@pytest.mark.parametrize("speed", [1.0, 0.5, 2.0, 10.0, 0.001])
def test_ticks_are_evenly_spaced(speed: float) -> None:
    """While the host keeps up, a tick is due every interval / speed, however long each one took."""
    host = ScriptedHost(Pacer(TICK, speed))
    starts = host.run([share * S / speed for share in (0.0, 0.9, 0.1, 0.5, 0.0, 0.7, 0.99, 0.2)])
    assert starts[0] == 1000.0
    assert gaps(starts) == pytest.approx([S / speed] * 7, rel=1e-6)
    assert host.pacer.factor == pytest.approx(speed)
    assert not host.pacer.behind
    assert host.pacer.lateness_p99_ms == pytest.approx(0.0, abs=1e-6)


def test_the_schedule_does_not_drift() -> None:
    """The thousandth tick is due when it was due from the beginning, however long ticks took."""
    host = ScriptedHost(Pacer(TICK, 1.0), now=0.0)
    starts = host.run([0.031] * 1000)
    assert starts[-1] == pytest.approx(999 * S, abs=1e-9)


def test_the_first_tick_is_due_at_once() -> None:
    """Nothing is waited for before there is a schedule."""
    assert Pacer(TICK, 1.0).remaining(5.0) == 0.0
    assert Pacer(TICK, None).remaining(5.0) == 0.0


def test_remaining_counts_down_to_the_due_time() -> None:
    """It is never below zero, however late the tick is."""
    pacer = Pacer(TICK, 1.0)
    pacer.start(10.0)
    assert [pacer.remaining(10.0 + t) for t in (0.0, 0.03, 0.1, 0.2, 50.0)] == pytest.approx([0.1, 0.07, 0.0, 0.0, 0.0])


def test_as_fast_as_possible_never_waits() -> None:
    """With no speed there is no schedule, so there is nothing to be late for or behind."""
    host = ScriptedHost(Pacer(TICK, None))
    starts = host.run([0.001] * 60)
    assert gaps(starts) == pytest.approx([0.001] * 59)
    assert host.pacer.factor == pytest.approx(100.0)
    assert not host.pacer.behind
    assert host.pacer.lateness_p99_ms is None


def test_a_short_delay_is_made_up_for() -> None:
    """One slow tick delays the ones after it until the schedule is reached again; no tick is skipped."""
    host = ScriptedHost(Pacer(TICK, 1.0), now=0.0)
    starts = host.run([0.0, 0.25, 0.0, 0.0, 0.0, 0.0])
    assert starts == pytest.approx([0.0, 0.1, 0.35, 0.35, 0.4, 0.5])
    assert host.pacer.lateness_p99_ms == pytest.approx(150.0)


def test_a_long_delay_starts_the_schedule_anew() -> None:
    """More than MAX_LAG late, it goes on from now on at its speed instead of rushing to catch up."""
    host = ScriptedHost(Pacer(TICK, 1.0), now=0.0)
    starts = host.run([0.0, S + MAX_LAG + 0.05, 0.0, 0.0, 0.0])
    assert starts == pytest.approx([0.0, 0.1, 1.25, 1.35, 1.45])


def test_a_delay_of_just_under_the_limit_is_made_up_for() -> None:
    """Up to MAX_LAG of lateness, all ticks that are due follow at once."""
    host = ScriptedHost(Pacer(TICK, 1.0), now=0.0)
    starts = host.run([0.0, MAX_LAG, *[0.0] * 12])
    assert starts[2:11] == pytest.approx([1.1] * 9)
    assert starts[11:] == pytest.approx([1.1, 1.2, 1.3])


def test_behind_is_said_while_it_is_so() -> None:
    """A host that is slower than asked for is behind; so it is no more, once it keeps up for a while."""
    host = ScriptedHost(Pacer(TICK, 2.0))
    host.run([0.1] * 60)
    assert host.pacer.factor == pytest.approx(1.0)
    assert host.pacer.behind
    host.run([0.0] * 80)
    assert host.pacer.factor == pytest.approx(2.0, rel=0.01)
    assert not host.pacer.behind


def test_the_factor_is_one_until_it_is_known() -> None:
    """One tick says nothing about speed, nor do ticks at the very same moment."""
    pacer = Pacer(TICK, None)
    assert pacer.factor == 1.0
    pacer.start(3.0)
    assert pacer.factor == 1.0
    pacer.start(3.0)
    assert pacer.factor == 1.0
    assert not pacer.behind


def test_a_paused_world_stands_still() -> None:
    """The tick at hand is the last one, whenever it was paused."""
    host = ScriptedHost(Pacer(TICK, 1.0))
    host.run([0.0] * 3)
    host.pacer.pause()
    assert host.pacer.paused
    assert host.pacer.remaining(host.now) is None
    assert host.pacer.remaining(host.now + 3600.0) is None
    assert not host.pacer.behind


def test_a_world_may_begin_paused() -> None:
    """Its first tick, which the simulator sends in any case, takes no step away."""
    pacer = Pacer(TICK, 1.0, paused=True)
    pacer.start(0.0)
    assert (pacer.steps, pacer.remaining(0.0)) == (0, None)
    pacer.step(2)
    assert ScriptedHost(pacer).steps() == 2


def test_resuming_goes_on_at_once_and_at_speed() -> None:
    """The time it stood still is neither made up for nor counted as slowness."""
    host = ScriptedHost(Pacer(TICK, 1.0))
    host.run([0.0] * 3)
    host.pacer.pause()
    host.now += 3600.0
    resumed = host.now
    host.pacer.resume()
    starts = host.run([0.0] * 4)
    assert starts == pytest.approx([resumed + i * S for i in range(4)])
    assert host.pacer.factor == pytest.approx(1.0)
    assert not host.pacer.behind
    assert host.pacer.lateness_p99_ms == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("speed", [1.0, 0.01, None])
def test_so_many_steps_and_no_more(speed: float | None) -> None:
    """Steps are taken as fast as possible at any speed, from a running world or a paused one, and they add up."""
    host = ScriptedHost(Pacer(TICK, speed))
    host.run([0.0] * 2)
    host.pacer.step(3)
    assert host.steps() == 3
    assert host.starts[-1] == host.starts[-3]
    host.pacer.step(1)
    host.pacer.step(4)
    assert host.steps() == 5
    assert host.pacer.paused


def test_pausing_ends_the_steps() -> None:
    """Steps that were still to go are not taken, not even later."""
    host = ScriptedHost(Pacer(TICK, 1.0))
    host.pacer.step(100)
    host.run([0.0] * 10)
    host.pacer.pause()
    assert host.steps() == 0
    host.pacer.step(1)
    assert host.steps() == 1


def test_resuming_ends_the_steps() -> None:
    """A world that was resumed in the middle of its steps runs on, evenly."""
    host = ScriptedHost(Pacer(TICK, 1.0))
    host.pacer.step(5)
    host.run([0.0] * 2)
    host.pacer.resume()
    assert gaps(host.run([0.0] * 10)) == pytest.approx([S] * 9)


def test_a_new_speed_holds_from_now_on() -> None:
    """The old schedule and the old speed's ticks are forgotten; the next tick is due at once."""
    host = ScriptedHost(Pacer(TICK, 0.1))
    host.run([0.0] * 3)
    host.pacer.set_speed(4.0)
    assert host.pacer.remaining(host.now) == 0.0
    starts = host.run([0.0] * 10)
    assert gaps(starts) == pytest.approx([S / 4.0] * 9)
    assert host.pacer.factor == pytest.approx(4.0)
    host.pacer.set_speed(None)
    assert gaps(host.run([0.0] * 5)) == [0.0] * 4


def test_a_new_speed_does_not_wake_a_paused_world() -> None:
    """It holds when the world goes on."""
    host = ScriptedHost(Pacer(TICK, 1.0, paused=True))
    host.pacer.set_speed(2.0)
    assert host.steps() == 0
    host.pacer.resume()
    assert gaps(host.run([0.0] * 5)) == pytest.approx([S / 2.0] * 4)


def test_lateness_is_the_99th_percentile() -> None:
    """Of a thousand ticks a few late ones do not show, some twenty do."""
    for late, seen in ((5, False), (20, True)):
        pacer = Pacer(TICK, 1.0)
        due = 0.0
        pacer.start(due)
        for i in range(1000):
            due += S
            pacer.start(due + (0.05 if i < late else 0.0))
        lateness = pacer.lateness_p99_ms
        assert lateness is not None
        assert math.isclose(lateness, 50.0 if seen else 0.0, abs_tol=1e-6)


def test_the_latest_ticks_count_too() -> None:
    """The percentile shows ticks that begin more than MAX_LAG late."""
    host = ScriptedHost(Pacer(TICK, 1.0))
    host.run([S + MAX_LAG + 0.1] * 10)
    lateness = host.pacer.lateness_p99_ms
    assert lateness is not None
    assert lateness > 1e3 * MAX_LAG


def test_a_speed_that_changes_within_a_tick_counts_from_the_next_one() -> None:
    """A query's thread may set another speed while a tick begins; that tick keeps the speed it began with."""
    pacer = Pacer(TICK, 1.0, paused=False)
    pacer.start(1000.0)

    class Meanwhile(list[float]):
        def append(self, lateness: float) -> None:
            pacer.set_speed(None)
            super().append(lateness)

    pacer._lateness = Meanwhile()  # type: ignore[assignment]
    pacer.start(1000.0 + S)
    assert pacer.speed is None
    assert pacer.remaining(1000.0 + S) == 0.0


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
