"""When ticks are due, at any pace, and what is done between two of them."""

from collections.abc import Iterable
from itertools import pairwise

import pytest

from zteam import names
from zteam.bus import MemoryHub
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


@pytest.mark.parametrize("speed", [1.0, 10.0, 0.001])
def test_ticks_are_evenly_spaced(speed: float) -> None:
    """While the host keeps up, a tick is due every interval / speed, however long each one took."""
    host = ScriptedHost(Pacer(TICK, speed))
    starts = host.run([share * S / speed for share in (0.0, 0.9, 0.1, 0.5, 0.0, 0.7, 0.99, 0.2)])
    assert starts[0] == 1000.0
    assert gaps(starts) == pytest.approx([S / speed] * 7, rel=1e-6)
    assert host.pacer.factor == pytest.approx(speed)
    assert not host.pacer.behind
    assert host.pacer.lateness_p99_ms == pytest.approx(0.0, abs=1e-6)


def test_remaining_counts_down_to_the_due_time() -> None:
    """It is never below zero, however late the tick is; the first tick is due at once."""
    pacer = Pacer(TICK, 1.0)
    assert pacer.remaining(5.0) == 0.0
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


@pytest.mark.parametrize(
    ("late", "starts"),
    [(MAX_LAG - 0.01, [1.09] * 10 + [1.1, 1.2]), (MAX_LAG + 0.05, [1.15 + 0.1 * i for i in range(12)])],
)
def test_a_long_delay_starts_the_schedule_anew(late: float, starts: list[float]) -> None:
    """Up to MAX_LAG late, all ticks that are due follow at once; later, it goes on from now on at its speed."""
    host = ScriptedHost(Pacer(TICK, 1.0), now=0.0)
    assert host.run([S + late, *[0.0] * 12])[1:] == pytest.approx(starts)
    assert host.pacer.lateness_p99_ms == pytest.approx(1e3 * late)


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


def test_a_paused_world_stands_still() -> None:
    """The tick at hand is the last one; a world may begin so, and a new speed does not wake it. Both a pause and a
    resumption end the steps that were still to go."""
    host = ScriptedHost(Pacer(TICK, 1.0, paused=True))
    host.pacer.start(host.now)
    assert (host.pacer.steps, host.pacer.remaining(host.now + 3600.0), host.pacer.behind) == (0, None, False)
    host.pacer.set_speed(2.0)
    assert host.steps() == 0
    host.pacer.step(100)
    host.run([0.0] * 10)
    host.pacer.pause()
    assert (host.pacer.paused, host.steps()) == (True, 0)
    host.pacer.step(5)
    host.run([0.0] * 2)
    host.pacer.resume()
    assert gaps(host.run([0.0] * 10)) == pytest.approx([S / 2.0] * 9)


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


def test_a_fault_in_a_change_ends_the_main_loop(hub: MemoryHub) -> None:
    """It is a bug in the simulator, not in what was asked for."""
    node = ProcessNode(names.SIMULATOR, hub.bus(), Stop())
    boundary = TickBoundary(node, Pacer(TICK, None))
    boundary.submit(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        boundary.wait_for_tick()
    node.close()
