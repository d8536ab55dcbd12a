"""A set of processes: failures are reported, stops are in order, and no process outlives its supervisor."""

import os
import select
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from msgspec import structs

from support.limits import LIMIT
from support.transports import wait_until_true
from zteam.node.launcher import Report
from zteam.team.launch import supervisor as supervising
from zteam.team.launch.process import Process
from zteam.team.launch.supervisor import Again, Job, Member, Supervisor

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
ARENAS = """
import ctypes
import threading
from zteam.team.launch.supervisor import Supervisor

THREADS = 12
met = threading.Barrier(THREADS + 1)


def hold() -> None:
    # More than Python's own memory takes: it comes from the C library.
    kept = bytearray(4096)
    met.wait()
    met.wait()


supervisor = Supervisor(lambda *_: None, lambda *_: None)
for _ in range(THREADS):
    threading.Thread(target=hold).start()
met.wait()
ctypes.CDLL(None).malloc_stats()
met.wait()
supervisor.close()
"""
"""Has the C library say on standard error what each arena of a process with a supervisor holds."""


class Watched(Supervisor):
    """A Supervisor that records its callbacks."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, str]] = []
        self.failed: list[str] = []
        super().__init__(
            lambda name, line: self.heard.append((name, line)),
            lambda process, _again: self.failed.append(process.name),
        )

    def run(self, name: str, code: str) -> Process:
        """Start a Python text; return when it has written its first line."""
        process = self.start(name, [sys.executable, "-c", code])
        assert self.wait(lambda: bool(process.lines) or not process.running, LIMIT)
        return process


def test_an_unexpected_end_is_reported() -> None:
    """A process that fails is reported at once with its name, and is in `failures`."""
    with closing(Watched()) as supervisor:
        process = supervisor.run("robot_3", "raise SystemExit(3)")
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)
        assert supervisor.failed == ["robot_3"]
        assert supervisor.failures == [process]
        assert process.exit_code == 3


def test_a_killed_process_is_reported() -> None:
    """A process that another program kills counts as failed."""
    with closing(Watched()) as supervisor:
        process = supervisor.run("sim", WAITING)
        os.kill(process.pid, signal.SIGKILL)
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)
        assert supervisor.failed == ["sim"]
        assert process.exit_code == -signal.SIGKILL


def test_a_failure_is_told_before_the_end_is_seen() -> None:
    """What is done about a failure, such as a stop with its reason, comes before a process counts as ended."""
    seen: list[bool] = []
    with closing(
        Supervisor(lambda *_: None, lambda process, _: seen.append(process.name in supervisor.ended))
    ) as supervisor:
        supervisor.start("robot_3", [sys.executable, "-c", "raise SystemExit(3)"])
        assert supervisor.wait(lambda: "robot_3" in supervisor.ended, LIMIT)
    assert seen == [False]


def test_a_stop_is_no_failure() -> None:
    """Processes that were asked to stop are not reported, whatever their exit code."""
    with closing(Watched()) as supervisor:
        polite, rude = supervisor.run("a", OWN), supervisor.run("b", WAITING)
        supervisor.stop(["a", "b"])
        assert polite.exit_code == 0
        assert rude.exit_code == -signal.SIGTERM
        assert supervisor.heard[-1] == ("a", "SIGTERM")
    assert supervisor.failed == []


def test_only_the_named_ones_stop() -> None:
    """The other processes run on; a name without a process is skipped."""
    with closing(Watched()) as supervisor:
        first, second = supervisor.run("a", WAITING), supervisor.run("b", WAITING)
        supervisor.stop(["a", "unknown"])
        assert not first.running
        assert second.running


def test_what_does_not_stop_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that ignores SIGTERM is killed after GRACE, and `stop` returns when all have ended."""
    monkeypatch.setattr("zteam.team.launch.supervisor.GRACE", 0.3)
    with closing(Watched()) as supervisor:
        stubborn = supervisor.run("a", STUBBORN)
        supervisor.stop(["a"])
        assert stubborn.exit_code == -signal.SIGKILL


def test_a_hurry_kills_without_grace(monkeypatch: pytest.MonkeyPatch) -> None:
    """With `hurry` a process is killed at once (GRACE is set to a limit that no test reaches)."""
    monkeypatch.setattr("zteam.team.launch.supervisor.GRACE", 1000.0)
    with closing(Watched()) as supervisor:
        stubborn = supervisor.run("a", STUBBORN)
        supervisor.stop(["a"], lambda: True)
        assert stubborn.exit_code == -signal.SIGKILL


def test_closing_kills_what_is_left() -> None:
    """An exception in the launcher leaves no process behind, frozen and stubborn ones included."""
    kept: list[Process] = []
    with pytest.raises(ZeroDivisionError), closing(Watched()) as supervisor:
        kept += [supervisor.run("a", WAITING), supervisor.run("b", STUBBORN), supervisor.run("c", OWN)]
        kept[2].signal(signal.SIGSTOP)
        raise ZeroDivisionError
    assert [process.running for process in kept] == [False] * 3
    assert supervisor.failed == []


def test_closing_twice_is_harmless() -> None:
    """The second close finds nothing to do and no descriptor to close."""
    supervisor = Watched()
    supervisor.run("a", WAITING)
    supervisor.close()
    supervisor.close()


def test_an_ended_process_can_be_started_again() -> None:
    """The name then stands for the new process."""
    with closing(Watched()) as supervisor:
        first = supervisor.run("a", "raise SystemExit(1)")
        assert first.join(LIMIT)
        second = supervisor.run("a", WAITING)
        assert supervisor.processes == {"a": second}
        assert second.running


def test_children_get_the_environment_asked_for() -> None:
    """The given variables reach the child, besides those of this process."""
    with closing(Watched()) as supervisor:
        code = "import os; print(os.environ['ZTEAM_NAMESPACE'], 'PATH' in os.environ)"
        supervisor.start("a", [sys.executable, "-c", code], {"ZTEAM_NAMESPACE": "t1"})
        assert supervisor.wait(lambda: bool(supervisor.heard), LIMIT)
        assert supervisor.heard == [("a", "t1 True")]


def test_measuring_covers_every_process() -> None:
    """One call updates the figures of all processes."""
    with closing(Watched()) as supervisor:
        both = [supervisor.run("a", WAITING), supervisor.run("b", WAITING)]
        supervisor.measure()
        assert all(p.usage.rss_mb > 1 and p.usage.pss_mb > 1 for p in both)


def is_frozen(pid: int) -> bool:
    """Whether a process is stopped. Only its parent is notified of that."""
    return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] == "T"


SUPERVISED = f"""
import os, signal, sys
from zteam.team.launch.supervisor import Again, Job, Supervisor
supervisor = Supervisor(lambda name, line: print(name, line, flush=True), lambda process, delay: None)
child = supervisor.start("child", [sys.executable, "-c", {OWN!r}])
supervisor.wait(lambda: bool(child.lines), {LIMIT})
print("pid", child.pid, flush=True)
signal.pause()
"""


@pytest.mark.few(2)
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("frozen", [False, True])
def test_children_end_when_their_supervisor_dies(number: signal.Signals, frozen: bool) -> None:
    """However the supervisor ends, its children stop, and a frozen one stops when it goes on."""
    with subprocess.Popen([sys.executable, "-c", SUPERVISED], stdout=subprocess.PIPE, text=True) as supervisor:
        assert supervisor.stdout is not None
        for line in supervisor.stdout:
            if line.startswith("pid "):
                break
        pid = int(line.split()[1])
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


DEAF = f"""
import sys
from zteam.team.launch.supervisor import Again, Job, Supervisor
def on_line(name, line):
    raise BrokenPipeError
supervisor = Supervisor(on_line, lambda process, delay: None)
supervisor.start("child", [sys.executable, "-c", "print('line'); raise SystemExit(3)"])
told = supervisor.wait(lambda: bool(supervisor.failures), {LIMIT})
supervisor.close()
raise SystemExit(0 if told else 1)
"""


def test_a_failing_listener_does_not_hide_an_end() -> None:
    """`zteam up | head` closes the launcher's output; its processes must still be watched and stopped."""
    done = subprocess.run([sys.executable, "-c", DEAF], capture_output=True, timeout=LIMIT, check=False)
    assert done.returncode == 0


def test_a_running_process_is_not_forgotten() -> None:
    """A second start under the same name never leaves the first process running without a supervisor."""
    supervisor = Watched()
    first = supervisor.run("a", WAITING)
    try:
        supervisor.start("a", [sys.executable, "-c", WAITING])
    except ValueError:
        pass
    finally:
        supervisor.close()
        left = first.running
        first.kill()
        first.join(LIMIT)
    assert not left


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_starting_again_leaves_no_descriptor_open() -> None:
    """A process that is restarted a hundred times does not use up the launcher's descriptors."""
    before = len(list(Path("/proc/self/fd").iterdir()))
    with closing(Watched()) as supervisor:
        kept = [supervisor.run("a", "raise SystemExit(1)") for _ in range(5)]
        assert supervisor.processes["a"] is kept[-1]
    assert len(list(Path("/proc/self/fd").iterdir())) == before


FAILING = "import sys; print('once more', flush=True); sys.exit('no camera')"


def test_a_process_that_fails_for_ever_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is started again as often as there are delays, and counts as failed only then; the rest goes on."""
    monkeypatch.setattr(supervising, "DELAYS", (0.0, 0.0))
    with closing(Watched()) as supervisor:
        other = supervisor.run("robot_0", WAITING)
        supervisor.start_job("camera", Job([sys.executable, "-c", FAILING], restarts=True, may_end=True))
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)
        assert [line for name, line in supervisor.heard if name == "camera"] == ["once more", "no camera"] * 3
        assert supervisor.restarts.counts == {"camera": 2}
        assert [process.name for process in supervisor.failures] == ["camera"]
        assert supervisor.ended == {"camera"}
        assert other.running


def test_a_start_takes_the_place_of_a_restart_that_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """The new process is not replaced when the restart would be due, and its first failure is the first in a row."""
    monkeypatch.setattr(supervising, "DELAYS", (LIMIT, 0.0))

    def restarts() -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread.name == "restart robot_0"]

    with closing(Watched()) as supervisor:
        supervisor.start_job("robot_0", Job([sys.executable, "-c", FAILING], restarts=True))
        assert supervisor.wait(lambda: bool(restarts()), LIMIT)
        (waits,) = restarts()
        supervisor.start_job("robot_0", Job([sys.executable, "-c", WAITING], restarts=True))
        waits.join(LIMIT / 2)
        assert not waits.is_alive()
        assert supervisor.restarts.take_failure("robot_0") == Again(LIMIT, 1)


def test_what_a_process_reports_may_change_how_it_is_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the report on that was learned: before it, a failure of this process is final."""
    monkeypatch.setattr(supervising, "DELAYS", (0.0, 0.0))

    def learn(job: Job, report: Report) -> Job:
        return structs.replace(job, command=python(f"print({report.listening!r}, flush=True)"), restarts=True)

    def python(code: str) -> list[str]:
        return [sys.executable, "-c", f"{code}; import sys; sys.exit('no more')"]

    with closing(Watched()) as supervisor:
        supervisor.start_job("early", Job(python("pass"), learn=learn))
        listening = "from zteam.node.launcher import report; report(listening='port 3')"
        supervisor.start_job("router", Job(python(listening), learn=learn))
        assert supervisor.wait(lambda: supervisor.ended == {"early", "router"}, LIMIT)
        assert [line for name, line in supervisor.heard if name == "early"] == ["no more"]
        said = [line for name, line in supervisor.heard if name == "router"]
        assert said == ["no more", "port 3", "no more", "port 3", "no more"]


def test_a_wait_notices_a_new_member() -> None:
    """What waits for a process to be replaced goes on at once, though the process writes nothing."""
    looked = threading.Event()

    def is_there() -> bool:
        looked.set()
        return "a" in supervisor.members

    with closing(Watched()) as supervisor, ThreadPoolExecutor(1) as pool:
        found = pool.submit(supervisor.wait, is_there, LIMIT)
        assert looked.wait(LIMIT)
        supervisor.start_member("a", lambda: cast(Member, SimpleNamespace(running=False)))
        assert found.result(LIMIT / 2)


def test_a_usage_error_is_final(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that cannot run as it was started says so once."""
    monkeypatch.setattr(supervising, "DELAYS", (0.0, 0.0))
    with closing(Watched()) as supervisor:
        supervisor.start_job(
            "view", Job([sys.executable, "-c", "print('no host'); raise SystemExit(2)"], restarts=True)
        )
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)
        assert (supervisor.heard, supervisor.restarts.counts) == ([("view", "no host")], {})


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_process_that_was_asked_to_end_is_not_started_again(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """A signal that asks for the end is no failure to mend; SIGKILL is."""
    monkeypatch.setattr(supervising, "DELAYS", (0.0, 0.0))
    job = Job(
        [sys.executable, "-c", f"import signal; signal.signal(signal.SIGINT, signal.SIG_DFL)\n{WAITING}"], restarts=True
    )
    with closing(Watched()) as supervisor:
        first = supervisor.start_job("a", job)
        assert supervisor.wait(lambda: bool(first.lines), LIMIT)
        first.signal(signal.SIGKILL)
        assert supervisor.wait(lambda: supervisor.processes["a"] is not first, LIMIT)
        second = supervisor.processes["a"]
        assert supervisor.wait(lambda: bool(second.lines), LIMIT)
        second.signal(number)
        assert supervisor.wait(lambda: supervisor.failures == [second], LIMIT)
        assert supervisor.restarts.counts == {"a": 1}


def test_the_threads_of_a_launcher_share_one_arena() -> None:
    """The thread that reads a member's lines has no arena of its own, which would keep unused memory."""
    done = subprocess.run([sys.executable, "-c", ARENAS], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert [line for line in done.stderr.splitlines() if line.startswith("Arena")] == ["Arena 0:"], done.stderr
