"""Signals on purpose: only the launcher that has started a process sends them, whatever a stranger says on the bus."""

import os
import signal
import sys
import threading

import pytest

from support.started_child import Started
from support.transports import wait_until_true
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.bus.presence import ProcessInfo, find_processes
from zteam.config.fault import Fault
from zteam.errors import BusError
from zteam.node.kinds import ROUTER
from zteam.team.chaos.means import Signals, means_on_bus, strike
from zteam.team.launch.process import spawn

SLEEP = "import signal; print('up', flush=True); signal.pause()"
STATES = """
import signal
signal.signal(signal.SIGCONT, lambda *_: print('on', flush=True))
print('up', flush=True)
while True: signal.pause()
"""


def start(code: str) -> Started:
    """A child that has begun."""
    child = Started(spawn, [sys.executable, "-c", code])
    assert child.up.wait(20)
    child.up.clear()
    return child


def test_a_pid_on_the_bus_is_never_signalled(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stranger answers in another's name with the pid -1, with this test's own, and with others: the launcher's own
    child ends, and nothing else gets a signal."""
    sent: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "kill", lambda pid, number: sent.append((pid, number)) if number else None)
    monkeypatch.setattr(os, "killpg", lambda pid, number: sent.append((pid, number)))
    child, stranger = start(SLEEP), hub.bus()
    for pid in (-1, 0, 1, os.getpid(), 2**31, 2**70):
        answer = {"name": "robot_1", "host": os.uname().nodename, "pid": pid, "start": 1, "instance": "0"}
        stranger.serve(names.info_key("robot_1"), NoRequest, lambda _, answer=answer: answer)
    Signals(lambda: {"robot_1": child.process}).serve(hub.bus())
    means = means_on_bus(hub.bus(), lockstep=False)
    strike(Fault(at=0.0, fault="pause", name="robot_1"), means)()
    strike(Fault(at=0.0, fault="kill", name="robot_1"), means)
    pid = child.process.pid
    assert sent[:3] == [(pid, signal.SIGSTOP), (pid, signal.SIGCONT), (pid, signal.SIGKILL)]
    assert {each for each, _ in sent} == {pid}
    monkeypatch.undo()
    child.process.kill()
    child.finish()


def test_a_process_of_no_launcher_is_not_signalled(hub: MemoryHub) -> None:
    """With no launcher, and with one that has not started it, one line says so and how it is done by hand."""
    means = means_on_bus(hub.bus(), lockstep=False)
    told = r"if robot_1 was started by hand, end it there with 'kill -9 PID', .*'zteam node list'"
    with pytest.raises(BusError, match=f"no 'zteam up' answers, .*{told}"):
        strike(Fault(at=0.0, fault="kill", name="robot_1"), means)
    child = start(SLEEP)
    Signals(lambda: {"robot_0": child.process}).serve(hub.bus())
    with pytest.raises(BusError, match=f"the launcher runs no process robot_1: {told}"):
        strike(Fault(at=0.0, fault="pause", name="robot_1"), means)
    child.process.kill()
    child.finish()
    with pytest.raises(BusError, match="the launcher runs no process robot_0"):
        strike(Fault(at=0.0, fault="pause", name="robot_0"), means)


@pytest.mark.parametrize("name", ["robot_1", ROUTER])
def test_a_frozen_process_goes_on_by_itself(hub: MemoryHub, name: str) -> None:
    """After the time of its fault, though nothing lets it go on; what would freeze the router comes after the reply."""
    child = start(STATES)
    Signals(lambda: {name: child.process}).serve(hub.bus())
    strike(Fault(at=0.0, fault="pause", name=name, seconds=0.05), means_on_bus(hub.bus(), lockstep=False))
    assert child.up.wait(20) and child.heard == ["up", "on"]
    child.process.kill()
    child.finish()


def test_an_earlier_pause_does_not_end_a_later_one() -> None:
    """What lets a process go on after its pause ends with that pause."""
    child = start(STATES)
    signals, before = Signals(lambda: {"robot_1": child.process}), set(threading.enumerate())
    for _ in range(3):
        signals.send("robot_1", "pause", 3600.0)
        signals.send("robot_1", "resume")
    signals.send("robot_1", "pause", 3600.0)
    wait_until_true(lambda: len(set(threading.enumerate()) - before) == 1)
    signals.send("robot_1", "kill")
    wait_until_true(lambda: not set(threading.enumerate()) - before)
    child.finish()


def test_an_answer_out_of_bounds_is_no_process(hub: MemoryHub) -> None:
    """Neither a pid that no system has, nor a time, nor a long text; nor an answer in another's name."""
    good = {"name": "robot_1", "host": "h", "pid": 7, "start": 1, "instance": "0"}
    wrong = ({"pid": -1}, {"pid": 2**32}, {"start": -1}, {"now": 2**63}, {"host": "h" * 256}, {"name": "up"})
    for change in wrong:
        hub.bus().serve(names.info_key("robot_1"), NoRequest, lambda _, change=change: good | change)
    assert find_processes(hub.bus()) == []
    hub.bus().serve(names.info_key("robot_1"), NoRequest, lambda _: good)
    assert find_processes(hub.bus()) == [ProcessInfo("robot_1", "h", 7, 1, "0")]
