"""What the log says of steps that are too slow or do not return; pauses between steps; and freezes of the process,
which blames no other process for what it missed."""

import threading

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.bus.lateness import Lateness
from zteam.bus.memory import MemoryHub
from zteam.bus.transport import RawSample
from zteam.clock import AFTERMATH, FREEZE_WATCH, FREEZES, Freezes, monotonic, wait_until
from zteam.node import working
from zteam.node.process_node import WALL_AFTER, ProcessNode
from zteam.node.shutdown import Stop
from zteam.node.working import LONG, SLOW_STEPS, Pauses, StepWatch, hanging, watch_process

TICK = 100_000_000
"""Nanoseconds."""


class Host:
    """The host's clock, and the end of the last freeze, as the test sets them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.woke = 0.0, float("-inf")
        monkeypatch.setattr(working, "monotonic", lambda: self.now)
        monkeypatch.setattr(FREEZES, "look", lambda: self.woke)


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> Host:
    """Its time stands until the test sets it."""
    return Host(monkeypatch)


@pytest.fixture
def watch() -> StepWatch:
    """Of a behaviour."""
    return StepWatch("Slow.step", "a scan comes every", "try zteam check b:Slow")


def step(watch: StepWatch, host: Host, seconds: float, *, paced: bool = True) -> None:
    """A step of so long."""

    def work() -> None:
        host.now += seconds

    watch.run(work, 0.1, paced=paced)


def test_steps_that_outlast_their_interval_are_named(watch: StepWatch, host: Host) -> None:
    """In real time three in a row, once a minute: fewer may be the machine's fault, and more say nothing new. In
    lock-step the world waits, and only a step that takes longer than LONG is named."""
    with captured_log() as log:
        for seconds in (*[0.2] * (SLOW_STEPS - 1), 0.05, *[0.2] * (SLOW_STEPS - 1)):
            step(watch, host, seconds)
        for _ in range(2 * SLOW_STEPS):
            step(watch, host, 0.9 * LONG, paced=False)
        assert log.lines == []
        for _ in range(5 + SLOW_STEPS):
            step(watch, host, 0.2)
        assert log.lines == ["Slow.step takes 0.2 s, a scan comes every 0.1 s; try zteam check b:Slow"]
        assert (watch._slow._period, watch._hangs._period) == (60.0, 60.0)
        watch._slow._next = 0.0
        step(watch, host, 5.0, paced=False)
    assert log.lines[1:] == ["Slow.step takes 5.0 s, a scan comes every 0.1 s; try zteam check b:Slow"]


def test_a_frozen_process_is_not_blamed(watch: StepWatch, host: Host) -> None:
    """The step is not what took so long; if it goes on and on after that, it is."""

    def work() -> None:
        host.now = host.woke = host.now + 8.0
        watch.look()
        assert watch not in hanging()
        host.now += lasts

    with captured_log() as log:
        lasts = 0.9 * LONG
        watch.run(work, 0.1, paced=False)
        assert log.lines == []
        lasts = LONG
        watch.run(work, 0.1, paced=False)
        assert log.count("Slow.step takes 9.0 s") == 1


def test_a_step_that_lasts_is_named_while_it_does(watch: StepWatch, host: Host) -> None:
    """Once, with how long it has lasted; until it returns it is among those that hang."""

    def work() -> None:
        for _ in range(12):
            host.now += 0.25
            watch.look()
            assert (watch in hanging()) == bool(log.lines)
        assert log.lines == ["Slow.step has not returned for 1.0 s, a scan comes every 0.1 s; try zteam check b:Slow"]

    with captured_log() as log:
        watch.run(work, 0.1, paced=False)
    assert watch not in hanging()


@pytest.mark.parametrize(
    ("ticks", "seconds", "interval", "in_lockstep", "woke", "is_pause"),
    [
        (3, 10.0, 0.1, False, -1.0, False),
        (100, 10.0, 0.1, False, -1.0, True),
        (100, 0.1, 0.1, False, -1.0, False),
        (100, 0.0, 0.1, False, 50.1, True),
        (100, 0.0, 0.1, True, -1.0, True),
        (3, 0.0, 0.1, True, -1.0, False),
        (10, 10.0, 1.0, False, -1.0, False),
    ],
    ids=["short", "long in both times", "a fast world", "suspended", "lock-step", "lock-step, short", "a slow laser"],
)
def test_a_pause_is_long_in_both_times(
    host: Host, ticks: int, seconds: float, interval: float, in_lockstep: bool, woke: float, is_pause: bool
) -> None:
    """In lock-step the time of the ticks alone counts, so that every run is the same. In a suspension the host's clock
    stood as well, but the freeze is known."""
    host.now, found = 50.0, Pauses()
    assert not found.take(TICK, interval, in_lockstep=in_lockstep)
    host.now, host.woke = host.now + seconds, woke
    assert found.take((1 + ticks) * TICK, interval, in_lockstep=in_lockstep) is is_pause
    assert not found.take((2 + ticks) * TICK, interval, in_lockstep=in_lockstep)


class Clocks:
    """The clocks of a process, set by the test: with the time of a suspended machine, its own work, and the host's."""

    def __init__(self) -> None:
        self.now = self.worked = self.host = 100.0
        self.freezes = Freezes(lambda: self.now, lambda: self.worked, lambda: self.host)
        self.freezes.begin()

    def pass_by(self, seconds: float, *, worked: float = 0.0, suspended: bool = False) -> None:
        """Time goes by in which the process `worked` so long; the host's clock stands in suspension."""
        self.now, self.worked = self.now + seconds, self.worked + worked
        self.host += 0.0 if suspended else seconds


@pytest.mark.parametrize("suspended", [False, True])
def test_a_look_that_is_late_without_work_is_a_freeze(suspended: bool) -> None:
    """A freeze is logged once, also if the machine was suspended and the host's clock stood still."""
    clocks = Clocks()
    clocks.pass_by(FREEZE_WATCH)
    assert clocks.freezes.look() == float("-inf")
    clocks.pass_by(10.2 + FREEZE_WATCH, worked=0.05, suspended=suspended)
    assert clocks.freezes.look() == clocks.host
    assert (clocks.freezes.take(), clocks.freezes.take()) == (pytest.approx(10.2), 0.0)
    assert clocks.freezes.has_just_woken()
    clocks.pass_by(FREEZE_WATCH)
    clocks.host += AFTERMATH
    assert not clocks.freezes.has_just_woken()


@pytest.mark.parametrize(
    ("seconds", "worked", "watched"), [(10.0, 9.5, True), (10.0, 3.0, True), (1.0, 0.0, True), (60.0, 0.0, False)]
)
def test_a_busy_process_is_not_frozen(seconds: float, worked: float, watched: bool) -> None:
    """A behaviour that computes long lets no thread look, a short delay is the machine's, and a program may begin its
    first node late."""
    clocks = Clocks()
    clocks.pass_by(seconds, worked=worked)
    if not watched:
        clocks.freezes.begin()
    assert (clocks.freezes.look(), clocks.freezes.take()) == (float("-inf"), 0.0)


def test_the_log_says_it_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """One thread serves all nodes of a process."""
    told, frozen = threading.Condition(), [10.2]

    def take() -> float:
        with told:
            told.notify_all()
            return frozen.pop() if frozen else 0.0

    monkeypatch.setattr(FREEZES, "take", take)
    with captured_log() as log:
        watch_process()
        watch_process()
        with told:
            assert wait_until(told, lambda: log.count("was frozen for 10.2 s") == 1, LIMIT)
    assert [thread.name for thread in threading.enumerate()].count("watch") == 1


def test_what_a_freeze_kept_away_accuses_nobody(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """A message that waited for a frozen process is dropped for a reason of this process; the router dropped its link,
    as it was silent; and no clock is chosen, because a simulator's sign could not come."""
    now = monotonic()
    monkeypatch.setattr(FREEZES, "look", lambda: now)
    lateness, node = Lateness(), ProcessNode("a", hub.bus(), Stop())
    problems = [lateness.problem(RawSample("k", b"", "", 0, "", delay)) for delay in (0.0, 9.0)]
    assert problems == ["", "it waited while this process was frozen"]
    with captured_log() as log:
        for up in (False, True):
            node._on_link(up)
    assert (log.count("router"), log.count("its link")) == (0, 2)
    node.decide_clock(monotonic() - 2.0 * WALL_AFTER)
    assert not node.clock.decided
