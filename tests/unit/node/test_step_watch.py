"""What the log says of steps that are too slow, and of those that do not return."""

import pytest

from support.log_capture import captured_log
from zteam.clock import FREEZES
from zteam.node import working
from zteam.node.working import LONG, SLOW_STEPS, StepWatch, hanging


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
    """In real time three in a row, once: fewer may be the machine's fault, and more say nothing new."""
    with captured_log() as log:
        for seconds in (*[0.2] * (SLOW_STEPS - 1), 0.05, *[0.2] * (SLOW_STEPS - 1)):
            step(watch, host, seconds)
        assert log.lines == []
        for _ in range(5):
            step(watch, host, 0.2)
        assert log.lines == ["Slow.step takes 0.2 s, a scan comes every 0.1 s; try zteam check b:Slow"]


def test_in_lockstep_a_step_may_outlast_its_interval(watch: StepWatch, host: Host) -> None:
    """The world waits for it; only one that takes longer than LONG is named."""
    with captured_log() as log:
        for _ in range(2 * SLOW_STEPS):
            step(watch, host, 0.9 * LONG, paced=False)
        assert log.lines == []
        step(watch, host, 5.0, paced=False)
        assert log.lines[-1] == "Slow.step takes 5.0 s, a scan comes every 0.1 s; try zteam check b:Slow"


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


def test_it_is_named_again_after_a_minute(watch: StepWatch, host: Host) -> None:
    """A log of hours shows that it goes on."""
    assert (watch._slow._period, watch._hangs._period) == (60.0, 60.0)
    with captured_log() as log:
        for _ in range(2 * SLOW_STEPS):
            step(watch, host, 0.2)
        watch._slow._next = 0.0
        step(watch, host, 0.2)
    assert log.count("Slow.step takes 0.2 s") == 2
