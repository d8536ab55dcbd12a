"""A set of processes: failures are reported or mended, stops are in order, and no process outlives its supervisor."""

import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from msgspec import structs

from support.limits import LIMIT
from support.log_capture import captured_log
from support.transports import wait_until_true
from zteam.node.launcher import Report
from zteam.team.launch import supervisor as supervising
from zteam.team.launch.process import Job, Process
from zteam.team.launch.supervisor import Member, Supervisor

WAITING = "print('up', flush=True)\nimport time\ntime.sleep(600)"
"""A child that ends only when it gets a signal."""
STUBBORN = "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n" + WAITING
"""A child that SIGTERM does not end."""
OWN = (
    "from zteam.node.shutdown import Stop\n"
    "import threading\n"
    "stop, asked = Stop(), threading.Event()\n"
    "stop.install()\n"
    "stop.on_request(asked.set)\n"
    "print('up', flush=True)\n"
    "asked.wait(600)\n"
    "print(stop.reason, flush=True)"
)
"""A child that ends as every process of a team does."""
FAILING = "import sys; print('once more', flush=True); sys.exit('no camera')"


class Watched(Supervisor):
    """A Supervisor that records its callbacks."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, str]] = []
        self.failed: list[tuple[str, bool]] = []
        """Names, and whether they counted as ended then."""
        super().__init__(lambda name, line: self.heard.append((name, line)))
        self.on_failure = self.fail

    def fail(self, process: Member, _again: bool) -> None:
        """One has failed."""
        self.failed.append((process.name, process.name in self.ended))

    def run(self, name: str, code: str, *, restarts: bool = False) -> Process:
        """Start a Python text; return when it has written its first line."""
        # Without what is installed an interpreter starts in half the time.
        command = [sys.executable, *([] if "zteam" in code else ["-S"]), "-c", code]
        process = self.start_job(name, Job(command, restarts=restarts, may_end=restarts))
        assert self.wait(lambda: bool(process.lines) or not process.running, LIMIT)
        return process


@pytest.fixture
def supervisor() -> Iterator[Watched]:
    """One without processes."""
    with closing(Watched()) as made:
        yield made


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two restarts, at once."""
    monkeypatch.setattr(supervising, "DELAYS", (0.0, 0.0))


@pytest.mark.parametrize(("code", "exit_code"), [("raise SystemExit(3)", 3), (WAITING, -signal.SIGKILL)])
def test_an_unexpected_end_is_reported(supervisor: Watched, code: str, exit_code: int) -> None:
    """A process that fails or that another program kills is reported with its name before it counts as ended: what is
    done about a failure, such as a stop with its reason, comes first."""
    process = supervisor.run("robot_3", code)
    if exit_code < 0:
        os.kill(process.pid, signal.SIGKILL)
    assert supervisor.wait(lambda: "robot_3" in supervisor.ended, LIMIT)
    assert supervisor.failed == [("robot_3", False)]
    assert supervisor.failures == [process]
    assert process.exit_code == exit_code


def test_a_stop_is_no_failure(supervisor: Watched) -> None:
    """Processes that were asked to stop are not reported, whatever their exit code; the others run on."""
    polite, rude, other = supervisor.run("a", OWN), supervisor.run("b", WAITING), supervisor.run("c", WAITING)
    supervisor.stop(["a", "b", "unknown"])
    assert (polite.exit_code, rude.exit_code) == (0, -signal.SIGTERM)
    assert supervisor.heard[-1] == ("a", "SIGTERM")
    assert supervisor.failed == [] and other.running


@pytest.mark.parametrize(("grace", "hurry"), [(0.3, False), (1000.0, True)])
def test_what_does_not_stop_is_killed(
    supervisor: Watched, monkeypatch: pytest.MonkeyPatch, grace: float, hurry: bool
) -> None:
    """A process that ignores SIGTERM is killed after GRACE, or at once in a hurry; `stop` returns when all have
    ended."""
    monkeypatch.setattr(supervising, "GRACE", grace)
    stubborn = supervisor.run("a", STUBBORN)
    supervisor.stop(["a"], lambda: hurry)
    assert stubborn.exit_code == -signal.SIGKILL


def test_closing_kills_what_is_left() -> None:
    """An exception in the launcher leaves no process behind, frozen and stubborn ones included; nor the descriptors of
    processes that were started again. A second close finds nothing to do."""
    before = len(list(Path("/proc/self/fd").iterdir()))
    kept: list[Process] = []
    with pytest.raises(ZeroDivisionError), closing(Watched()) as supervisor:
        kept += [supervisor.run("a", WAITING), supervisor.run("b", STUBBORN), supervisor.run("c", OWN)]
        kept += [supervisor.run("a", "raise SystemExit(1)") for _ in range(3)]
        kept[2].signal(signal.SIGSTOP)
        raise ZeroDivisionError
    supervisor.close()
    assert [process.running for process in kept] == [False] * 6
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_the_name_stands_for_the_newest_process(supervisor: Watched) -> None:
    """Whether the one before has ended or still runs: then it is killed, and that is no failure."""
    first = supervisor.run("a", WAITING)
    second = supervisor.run("a", WAITING)
    assert supervisor.processes == {"a": second}
    assert second.running and not first.running
    assert supervisor.failed == []


def test_a_start_by_hand_replaces_the_one_that_waits(
    supervisor: Watched, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A process that is started again by hand, while its own restart waits, is not replaced when that is due."""
    monkeypatch.setattr(supervising, "DELAYS", (0.3,))
    flag = tmp_path / "flag"
    fails_once = f"import pathlib\nflag = pathlib.Path({str(flag)!r})\nif not flag.exists():\n flag.touch()\n 1/0\n"
    supervisor.run("a", fails_once + WAITING, restarts=True)
    assert supervisor.wait(lambda: bool(supervisor.failed), LIMIT)
    by_hand = supervisor.restart("a")
    for thread in threading.enumerate():
        if thread.name == "restart a":
            thread.join(LIMIT)
    assert supervisor.members["a"] is by_hand and by_hand.running


def test_children_get_the_environment_asked_for(supervisor: Watched) -> None:
    """The given variables reach the child, besides those of this process."""
    code = "import os; print(os.environ['ZTEAM_NAMESPACE'], 'PATH' in os.environ)"
    supervisor.start_job("a", Job([sys.executable, "-c", code], {"ZTEAM_NAMESPACE": "t1"}))
    assert supervisor.wait(lambda: bool(supervisor.heard), LIMIT)
    assert supervisor.heard == [("a", "t1 True")]


def test_measuring_covers_every_process(supervisor: Watched) -> None:
    """One call updates the figures of all processes."""
    both = [supervisor.run("a", WAITING), supervisor.run("b", WAITING)]
    supervisor.measure()
    assert all(p.usage.rss_mb > 1 and p.usage.pss_mb > 1 for p in both)


SUPERVISED = f"""
import os, signal, sys
from zteam.team.launch.process import Job
from zteam.team.launch.supervisor import Supervisor
supervisor = Supervisor(lambda name, line: print(name, line, flush=True))
child = supervisor.start_job("child", Job([sys.executable, "-c", {OWN!r}]))
supervisor.wait(lambda: bool(child.lines), {LIMIT})
print("pid", child.pid, flush=True)
signal.pause()
"""


def is_frozen(pid: int) -> bool:
    """Whether a process is stopped. Only its parent is notified of that."""
    return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] == "T"


@pytest.mark.few(2)
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("frozen", [False, True])
def test_children_end_when_their_supervisor_dies(number: signal.Signals, frozen: bool) -> None:
    """However the supervisor ends, its children stop, and a frozen one stops when it goes on."""
    with subprocess.Popen([sys.executable, "-c", SUPERVISED], stdout=subprocess.PIPE, text=True) as supervisor:
        assert supervisor.stdout is not None
        pid = next(int(line.split()[1]) for line in supervisor.stdout if line.startswith("pid "))
        handle = os.pidfd_open(pid)
        if frozen:
            os.kill(pid, signal.SIGSTOP)
            wait_until_true(lambda: is_frozen(pid))
        supervisor.send_signal(number)
        supervisor.wait(LIMIT)
        if frozen and not select.select([handle], [], [], 0)[0]:  # noqa: TID251
            # The kernel continues stopped orphans, but may miss one that was just about to stop.
            signal.pidfd_send_signal(handle, signal.SIGCONT)
        ended, _, _ = select.select([handle], [], [], LIMIT)  # noqa: TID251
        if not ended:
            signal.pidfd_send_signal(handle, signal.SIGKILL)
        os.close(handle)
        assert ended, "the child outlives its supervisor"


def test_a_failing_listener_does_not_hide_an_end() -> None:
    """`zteam up | head` closes the launcher's output; its processes must still be watched and stopped."""

    def on_line(_name: str, _line: str) -> None:
        raise BrokenPipeError

    with closing(Supervisor(on_line)) as supervisor:
        supervisor.start_job("child", Job([sys.executable, "-c", "print('line'); raise SystemExit(3)"]))
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)


def test_a_process_that_fails_for_ever_is_given_up(supervisor: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is started again as often as there are delays, each with its line, and is reported as failed only then; the
    rest goes on."""
    assert list(supervising.DELAYS) == sorted(supervising.DELAYS)
    monkeypatch.setattr(supervising, "DELAYS", (0.0, 0.01))
    other = supervisor.run("robot_0", WAITING)
    with captured_log() as told:
        supervisor.run("camera", FAILING, restarts=True)
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)
    words = ("exit code 1; it is started again in 0 s (1 of 2)", "in 0.01 s (2 of 2)", "it has failed 3 times in a row")
    assert all(word in line for word, line in zip(words, told.lines, strict=True))
    assert [line for name, line in supervisor.heard if name == "camera"] == ["once more", "no camera"] * 3
    assert supervisor.restarts == {"camera": 2}
    assert [process.name for process in supervisor.failures] == ["camera"]
    assert supervisor.ended == {"camera"}
    assert other.running


def test_a_failure_after_a_long_run_is_the_first_in_a_row(supervisor: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    """Then it is started again after the first delay, however often it had failed before."""
    monkeypatch.setattr(supervising, "DELAYS", (0.0,))
    monkeypatch.setattr(supervising, "STEADY", 0.0)
    supervisor.run("camera", FAILING, restarts=True)
    assert supervisor.wait(lambda: supervisor.restarts.get("camera", 0) >= 3, LIMIT)


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize("before", ["stopped", "given up"])
def test_a_start_by_hand_is_a_new_beginning(supervisor: Watched, before: str) -> None:
    """What was stopped, or given up, is started again after its next failures as often as at first."""
    supervisor.run("robot_0", WAITING if before == "stopped" else FAILING, restarts=True)
    if before == "stopped":
        supervisor.stop(["robot_0"])
    assert supervisor.wait(lambda: "robot_0" in supervisor.ended, LIMIT)
    count = supervisor.restarts.get("robot_0", 0)
    member = supervisor.restart("robot_0")
    if before == "stopped":
        member.kill()
    assert supervisor.wait(lambda: supervisor.restarts.get("robot_0", 0) > count, LIMIT)


@pytest.mark.parametrize("how", ["started", "stopped"])
def test_a_restart_that_waits_is_called_off(supervisor: Watched, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    """By a stop, and by a start: that process is not replaced when the restart would be due, and its first failure is
    the first in a row."""
    monkeypatch.setattr(supervising, "DELAYS", (LIMIT, 0.0))

    def timers() -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread.name == "restart robot_0"]

    supervisor.run("robot_0", FAILING, restarts=True)
    assert supervisor.wait(lambda: bool(timers()), LIMIT)
    (waits,) = timers()
    if how == "started":
        supervisor.run("robot_0", WAITING, restarts=True)
        os.kill(supervisor.processes["robot_0"].pid, signal.SIGKILL)
        assert supervisor.wait(lambda: bool(timers()) and timers() != [waits], LIMIT)
        supervisor.stop(["robot_0"])
    else:
        supervisor.stop(["robot_0"])
    waits.join(LIMIT / 2)
    assert not waits.is_alive()
    assert supervisor.restarts == {}


@pytest.mark.usefixtures("soon")
def test_what_a_process_reports_may_change_how_it_is_started_again(supervisor: Watched) -> None:
    """From the report on that was learned: before it, a failure of this process is final."""

    def python(code: str) -> list[str]:
        return [sys.executable, *([] if "zteam" in code else ["-S"]), "-c", f"{code}; import sys; sys.exit('no more')"]

    def learn(job: Job, report: Report) -> Job:
        return structs.replace(job, command=python(f"print({report.listening!r}, flush=True)"), restarts=True)

    supervisor.start_job("early", Job(python("pass"), learn=learn))
    listening = "from zteam.node.launcher import report; report(listening='port 3')"
    supervisor.start_job("router", Job(python(listening), learn=learn))
    assert supervisor.wait(lambda: supervisor.ended == {"early", "router"}, LIMIT)
    assert [line for name, line in supervisor.heard if name == "early"] == ["no more"]
    said = [line for name, line in supervisor.heard if name == "router"]
    assert said == ["no more", "port 3", "no more", "port 3", "no more"]


def test_a_wait_notices_a_new_member(supervisor: Watched) -> None:
    """What waits for a process to be replaced goes on at once, though the process writes nothing."""
    looked = threading.Event()

    def is_there() -> bool:
        looked.set()
        return "a" in supervisor.members

    with ThreadPoolExecutor(1) as pool:
        found = pool.submit(supervisor.wait, is_there, LIMIT)
        assert looked.wait(LIMIT)
        supervisor.start_member("a", lambda: cast(Member, SimpleNamespace(running=False)), Job(()))
        assert found.result(LIMIT / 2)


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize("number", [2, -signal.SIGTERM, -signal.SIGINT, -signal.SIGHUP])
def test_a_process_that_was_asked_to_end_is_not_started_again(supervisor: Watched, number: int) -> None:
    """Nor one that cannot run as it was started; SIGKILL is a failure to mend."""
    first = supervisor.run(
        "a",
        f"import signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL)\n"
        f"signal.signal(signal.SIGUSR1, lambda *_: sys.exit(2))\n{WAITING}",
        restarts=True,
    )
    first.signal(signal.SIGKILL)
    assert supervisor.wait(lambda: supervisor.processes["a"] is not first, LIMIT)
    second = supervisor.processes["a"]
    assert supervisor.wait(lambda: bool(second.lines), LIMIT)
    second.signal(-number if number < 0 else signal.SIGUSR1)
    assert supervisor.wait(lambda: supervisor.failures == [second], LIMIT)
    assert (second.exit_code, supervisor.restarts) == (number, {"a": 1})


ARENAS = """
import ctypes, threading
from zteam.team.launch.supervisor import Supervisor

met = threading.Barrier(13)

def hold():
    # More than Python's own memory takes: it comes from the C library.
    kept = bytearray(4096)
    met.wait()
    met.wait()

supervisor = Supervisor(lambda *_: None)
for _ in range(12):
    threading.Thread(target=hold).start()
met.wait()
ctypes.CDLL(None).malloc_stats()
met.wait()
supervisor.close()
"""
"""Has the C library say on standard error what each arena of a process with a supervisor holds."""


@pytest.mark.ci
def test_the_threads_of_a_launcher_share_one_arena() -> None:
    """The thread that reads a member's lines has no arena of its own, which would keep unused memory."""
    done = subprocess.run([sys.executable, "-c", ARENAS], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert [line for line in done.stderr.splitlines() if line.startswith("Arena")] == ["Arena 0:"], done.stderr
