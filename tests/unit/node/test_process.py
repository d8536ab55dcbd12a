"""`zteam.run`, and what a command does beyond it."""

import gc
import logging
import re
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import zteam
from support.limits import LIMIT
from zteam.bus import BusOptions, MemoryHub
from zteam.errors import UsageError
from zteam.messages import Bool, Log, LogLevel
from zteam.node import log_client, logs, node, process_node, shutdown
from zteam.node.logs import LogKeeper
from zteam.node.process_node import ProcessNode


@pytest.fixture
def offline(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """`zteam.run` opens its sessions in memory, in a program that has not set up any log."""
    for module in (process_node, node):
        monkeypatch.setattr(module, "connect", lambda options, stopping: hub.bus())
    keeper = LogKeeper()
    for module in (process_node, log_client, logs):
        monkeypatch.setattr(module, "KEEPER", keeper)
    log = logging.getLogger("zteam")
    monkeypatch.setattr(log, "handlers", [])
    monkeypatch.setattr(log, "propagate", True)
    monkeypatch.setattr(log, "level", logging.NOTSET)


def _settings() -> tuple[list[logging.Handler], bool, int, float, bool, list[object]]:
    """What a program may have set up for itself: its log, switch interval, garbage collector and signal handlers."""
    log, handlers = logging.getLogger("zteam"), [signal.getsignal(number) for number in shutdown.SIGNALS]
    return [*log.handlers], log.propagate, log.level, sys.getswitchinterval(), gc.isenabled(), [*handlers]


@pytest.mark.usefixtures("offline")
def test_after_run_the_process_is_the_users_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The code behind `zteam.run` is not ended by force, and signals go to the handlers that had them before. Neither
    within `body` nor after it are log, switch interval or garbage collector other than before."""
    ends, seen = list[int](), []
    monkeypatch.setattr(shutdown, "HARD_EXIT", 10 * LIMIT)
    monkeypatch.setattr(shutdown.os, "_exit", ends.append)

    def main(node: zteam.Node) -> None:
        node.become_present()
        seen.append(_settings())
        node.stop.request("over")

    before, frozen, threads = _settings(), gc.get_freeze_count(), set(threading.enumerate())
    assert zteam.run("planner", main) == 0
    for thread in set(threading.enumerate()) - threads:
        thread.join(LIMIT)
        assert not thread.is_alive(), thread.name
    assert (ends, seen[0][:-1], _settings()) == ([], before[:-1], before)
    # What an earlier test has left frozen may be freed meanwhile.
    assert gc.get_freeze_count() <= frozen


@pytest.mark.parametrize(("hung", "hangs", "codes"), [(3, False, [1]), (3, True, [3]), (None, True, [])])
def test_a_process_that_does_not_stop_is_ended(
    monkeypatch: pytest.MonkeyPatch, hung: int | None, hangs: bool, codes: list[int]
) -> None:
    """HARD_EXIT after the request, with code 1, or `hung` where a step does not return; without `hung` never."""
    ends, stop, before = list[int](), shutdown.Stop(), set(threading.enumerate())
    for name, value in (("HARD_EXIT", 0.0), ("hanging", lambda: hangs)):
        monkeypatch.setattr(shutdown, name, value)
    monkeypatch.setattr(shutdown.os, "_exit", ends.append)
    monkeypatch.setattr(shutdown.logging, "shutdown", lambda: None)
    with stop.install(hung=hung):
        stop.request("over")
        for thread in set(threading.enumerate()) - before:
            if thread.name not in ("signals", "launcher"):
                thread.join(LIMIT)
    assert ends == codes


@pytest.mark.usefixtures("offline")
@pytest.mark.parametrize("name", ["clock", "sim", "view_2", "a/b", ""])
def test_a_name_of_zteam_itself_ends_with_2_and_one_line(caplog: pytest.LogCaptureFixture, name: str) -> None:
    """A topic, a process of every team, and what is no name: nothing is run."""
    with pytest.raises(SystemExit) as end:
        zteam.run(name, lambda node: pytest.fail("it was run"))
    assert (end.value.code, [record.levelname for record in caplog.records]) == (2, ["ERROR"])


@pytest.mark.usefixtures("offline")
@pytest.mark.parametrize("where", ["callback", "step", "hook"])
def test_an_error_of_the_users_code_is_shown_and_makes_exit_code_1(
    hub: MemoryHub, caplog: pytest.LogCaptureFixture, where: str
) -> None:
    """The log has the traceback with the user's frames alone."""

    def fail(*_: object) -> None:
        raise ValueError("out of plans")

    def main(node: zteam.Node) -> None:
        node.subscribe("plan", Bool, fail)
        if where == "hook":
            node.on_stop(fail)
            return
        if where == "callback":
            hub.bus().publisher("plan", Bool).put(Bool(True))
        node.clock.use_wall()
        node.run(fail if where == "step" else lambda _now: None)

    with pytest.raises(SystemExit, match="1"):
        zteam.run("planner", main)
    text = caplog.text.strip()
    assert "ended by an error:\nTraceback" in text
    assert text.endswith("ValueError: out of plans")
    assert "in fail" in text
    assert {Path(name).name for name in re.findall('File "(.*)"', text)} == {Path(__file__).name}


@pytest.mark.usefixtures("offline")
def test_the_log_of_a_users_process_is_on_the_bus(hub: MemoryHub, caplog: pytest.LogCaptureFixture) -> None:
    """Lines of any logger, and the error that ends the process, reach a subscriber; afterwards nothing is published."""
    heard: list[Log] = []
    hub.bus().subscribe("planner/log", Log, lambda _key, message: heard.append(message))
    factory = logging.getLogRecordFactory()

    def main(_node: zteam.Node) -> None:
        logging.getLogger("my.plans").warning("no way")
        raise ValueError("out of plans")

    with pytest.raises(SystemExit, match="1"):
        zteam.run("planner", main)
    logging.getLogger("my.plans").warning("over")
    assert caplog.messages[-1] == "over"
    first, last = heard
    assert (first.name, first.level, first.msg) == ("planner", LogLevel.WARN, "no way")
    assert last.level == LogLevel.FATAL
    assert last.msg.endswith("ValueError: out of plans")
    assert logging.getLogRecordFactory() is factory


@pytest.mark.usefixtures("offline")
def test_a_process_without_its_name_is_silent(hub: MemoryHub) -> None:
    """Once it has given its name back it answers nothing under it, and neither its lines nor its end are published."""
    heard: list[Log] = []
    hub.bus().subscribe("planner/log", Log, lambda _key, message: heard.append(message))
    answers: list[list[tuple[str, object]]] = []

    def main(node: zteam.Node) -> None:
        node.claim.release()
        logging.getLogger("my.plans").warning("I only look")
        answers.extend(hub.bus().query(f"planner/{what}", object) for what in ("info", "stats", "log"))
        raise UsageError("nothing to see")

    with pytest.raises(SystemExit, match="2"):
        zteam.run("planner", main)
    assert (answers, heard) == ([[], [], []], [])


@pytest.fixture
def tuned() -> Iterator[None]:
    """The interpreter's own settings come back after the test."""
    interval = sys.getswitchinterval()
    # Kernels that took over in a test before have frozen objects.
    gc.unfreeze()
    yield
    sys.setswitchinterval(interval)
    gc.unfreeze()


@pytest.mark.usefixtures("offline", "tuned")
def test_a_command_sets_up_its_interpreter(monkeypatch: pytest.MonkeyPatch) -> None:
    """A command's process switches threads quickly, and the collector passes over what start-up made."""
    monkeypatch.setattr(shutdown.Stop, "install", lambda self: None)
    frozen = []

    def main(node: ProcessNode) -> None:
        frozen.append(gc.get_freeze_count())
        node.become_present()
        frozen.append(gc.get_freeze_count())

    assert process_node.run_node("planner", BusOptions(), main, "auto", process_node.ProcessNode) == 0
    assert sys.getswitchinterval() == pytest.approx(process_node.SWITCH_INTERVAL)
    assert frozen[0] == 0 < frozen[1]
