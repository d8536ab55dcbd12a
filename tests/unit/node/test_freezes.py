"""A process that was frozen detects it, logs it, and blames no other process for what it missed."""

import threading

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.bus.lateness import Lateness
from zteam.bus.memory import MemoryHub
from zteam.bus.transport import RawSample
from zteam.clock import AFTERMATH, FREEZE_WATCH, FREEZES, Freezes, monotonic, wait_until
from zteam.node.process_node import WALL_AFTER, ProcessNode
from zteam.node.shutdown import Stop
from zteam.node.working import watch_process


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


@pytest.mark.parametrize(("seconds", "worked"), [(10.0, 9.5), (10.0, 3.0), (1.0, 0.0)])
def test_a_busy_process_is_not_frozen(seconds: float, worked: float) -> None:
    """A behaviour that computes long lets no thread look, and a short delay is the machine's."""
    clocks = Clocks()
    clocks.pass_by(seconds, worked=worked)
    assert (clocks.freezes.look(), clocks.freezes.take()) == (float("-inf"), 0.0)


def test_nothing_is_a_freeze_while_nobody_watches() -> None:
    """A program may begin its first node late."""
    clocks = Clocks()
    clocks.pass_by(60.0)
    clocks.freezes.begin()
    assert clocks.freezes.take() == 0.0


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


@pytest.fixture
def woken(monkeypatch: pytest.MonkeyPatch) -> None:
    """This process goes on just now after a freeze."""
    now = monotonic()
    monkeypatch.setattr(FREEZES, "look", lambda: now)


@pytest.mark.usefixtures("woken")
def test_what_waited_for_a_frozen_process_accuses_no_link() -> None:
    """It is dropped as late, for a reason of this process."""
    lateness = Lateness()
    problems = [lateness.problem(RawSample("k", b"", "", 0, "", delay)) for delay in (0.0, 9.0)]
    assert problems == ["", "it waited while this process was frozen"]


@pytest.mark.usefixtures("woken")
def test_a_link_that_was_lost_in_a_freeze_accuses_no_router(hub: MemoryHub) -> None:
    """The router drops a process that is silent."""
    node = ProcessNode("a", hub.bus(), Stop())
    with captured_log() as log:
        for up in (False, True):
            node._on_link(up)
    assert log.count("router") == 0
    assert log.count("its link") == 2


@pytest.mark.usefixtures("woken")
def test_no_clock_is_chosen_for_what_a_freeze_kept_away(hub: MemoryHub) -> None:
    """A simulator's sign could not come meanwhile."""
    node = ProcessNode("a", hub.bus(), Stop())
    node.decide_clock(monotonic() - 2.0 * WALL_AFTER)
    assert not node.clock.decided
