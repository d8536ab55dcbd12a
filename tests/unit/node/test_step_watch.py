"""What the log says of steps that are too slow, and of those that do not return."""

import pytest

from support.log_capture import captured_log
from zteam.node import step_watch
from zteam.node.step_watch import LONG, LOOK, SLOW_STEPS, StepWatch, hanging

SECOND = round(1.0 / LOOK)


class Host:
    """The host's clock and the thread's, as the test sets them; no thread looks."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = self.worked = 0.0
        monkeypatch.setattr(step_watch, "monotonic", lambda: self.now)
        monkeypatch.setattr(step_watch, "thread_time", lambda: self.worked)
        monkeypatch.setattr(step_watch, "_start", lambda: None)
        monkeypatch.setattr(step_watch, "_thread", None)


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> Host:
    """Its time stands until the test sets it."""
    return Host(monkeypatch)


@pytest.fixture
def watch() -> StepWatch:
    """Of a behaviour."""
    return StepWatch("Slow.step", "a scan comes every", "try zteam check b:Slow")


def step(watch: StepWatch, host: Host, seconds: float, *, paced: bool = True, looks: int = 0) -> None:
    """A step of so long, which is seen under way so often."""

    def work() -> None:
        host.now += seconds
        for _ in range(looks):
            watch.look()

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
            step(watch, host, 0.9 * LONG, paced=False, looks=SECOND - 1)
        assert log.lines == []
        step(watch, host, 5.0, paced=False, looks=5 * SECOND)
        assert log.lines[-1] == "Slow.step takes 5.0 s, a scan comes every 0.1 s; try zteam check b:Slow"


def test_a_frozen_process_is_not_blamed(watch: StepWatch, host: Host) -> None:
    """While it is frozen it does not look, and its thread does not work: the step is not what took so long."""
    with captured_log() as log:
        step(watch, host, 8.0, paced=False, looks=1)
        assert log.lines == []


def test_work_that_lets_no_thread_look_is_named(watch: StepWatch, host: Host) -> None:
    """Compiled code may keep the interpreter for all of its step."""

    def work() -> None:
        host.now = host.worked = 3.0

    with captured_log() as log:
        watch.run(work, 0.1, paced=False)
        assert log.count("Slow.step takes 3.0 s") == 1


def test_a_step_that_lasts_is_named_while_it_does(watch: StepWatch, host: Host) -> None:
    """Once, with how long it has lasted; until it returns it is among those that hang."""

    def work() -> None:
        for _ in range(3 * SECOND):
            host.now += LOOK
            assert (watch in hanging()) == bool(log.lines)
            watch.look()
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
