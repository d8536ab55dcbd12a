"""A set of processes: failures are told, stops are asked for, and nothing outlives its supervisor."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from zteam.clock import monotonic
from zteam.launch.process import Process
from zteam.launch.supervisor import Supervisor

LIMIT = 30.0

WAITING = "print('up', flush=True)\nimport time\ntime.sleep(600)"
"""A child that ends only when told to."""
STUBBORN = "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n" + WAITING
"""A child that SIGTERM does not end."""
OWN = (
    "from zteam.runtime.shutdown import Stop\n"
    "import threading\n"
    "stop, asked = Stop(), threading.Event()\n"
    "stop.install()\n"
    "stop.on_request(asked.set)\n"
    "print('up', flush=True)\n"
    "asked.wait(600)\n"
    "print(stop.reason, flush=True)"
)
"""A child that ends as every process of a team does."""


class Watched(Supervisor):
    """A Supervisor and everything that it told."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, str]] = []
        self.failed: list[str] = []
        super().__init__(
            lambda name, line: self.heard.append((name, line)), lambda process: self.failed.append(process.name)
        )

    def run(self, name: str, code: str) -> Process:
        """Start a Python text; return when it has said its first line."""
        process = self.start(name, [sys.executable, "-c", code])
        assert self.wait(lambda: bool(process.lines) or not process.running, LIMIT)
        return process


def test_an_end_nobody_asked_for_is_told() -> None:
    """A process that fails by itself is told at once, with its name, and is in `failures`."""
    with Watched() as supervisor:
        process = supervisor.run("robot_3", "raise SystemExit(3)")
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)
        assert supervisor.failed == ["robot_3"]
        assert supervisor.failures == [process]
        assert process.exit_code == 3


def test_a_killed_process_is_told() -> None:
    """So is one that somebody killed."""
    with Watched() as supervisor:
        process = supervisor.run("sim", WAITING)
        os.kill(process.pid, signal.SIGKILL)
        assert supervisor.wait(lambda: bool(supervisor.failures), LIMIT)
        assert supervisor.failed == ["sim"]
        assert process.exit_code == -signal.SIGKILL


def test_a_stop_is_no_failure() -> None:
    """Processes that were asked to stop are not told of, whatever their exit code."""
    with Watched() as supervisor:
        polite, rude = supervisor.run("a", OWN), supervisor.run("b", WAITING)
        supervisor.stop(["a", "b"])
        assert polite.exit_code == 0
        assert rude.exit_code == -signal.SIGTERM
        assert supervisor.heard[-1] == ("a", "SIGTERM")
    assert supervisor.failed == []


def test_only_the_named_ones_stop() -> None:
    """A group is stopped at a time: the others run on; a name that nobody has is passed over."""
    with Watched() as supervisor:
        first, second = supervisor.run("a", WAITING), supervisor.run("b", WAITING)
        supervisor.stop(["a", "nobody"])
        assert not first.running
        assert second.running


def test_what_does_not_stop_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """After the grace a process that ignores SIGTERM is killed, and stop returns with all ended."""
    monkeypatch.setattr("zteam.launch.supervisor.GRACE", 0.3)
    with Watched() as supervisor:
        stubborn = supervisor.run("a", STUBBORN)
        supervisor.stop(["a"])
        assert stubborn.exit_code == -signal.SIGKILL


def test_a_hurry_kills_without_grace(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second Ctrl+C: no grace is waited for (a limit that no test reaches)."""
    monkeypatch.setattr("zteam.launch.supervisor.GRACE", 1000.0)
    with Watched() as supervisor:
        stubborn = supervisor.run("a", STUBBORN)
        supervisor.stop(["a"], lambda: True)
        assert stubborn.exit_code == -signal.SIGKILL


def test_closing_kills_what_is_left() -> None:
    """An exception in the launcher leaves no process behind, frozen and stubborn ones included."""
    kept: list[Process] = []
    with pytest.raises(ZeroDivisionError), Watched() as supervisor:
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


def test_one_that_has_ended_can_be_started_again() -> None:
    """The name then stands for the new process."""
    with Watched() as supervisor:
        first = supervisor.run("a", "raise SystemExit(1)")
        assert first.join(LIMIT)
        second = supervisor.run("a", WAITING)
        assert supervisor.processes == {"a": second}
        assert second.running


def test_children_get_the_environment_asked_for() -> None:
    """What the team's processes are told by environment reaches them, on top of our own."""
    with Watched() as supervisor:
        code = "import os; print(os.environ['ZTEAM_NAMESPACE'], 'PATH' in os.environ)"
        supervisor.start("a", [sys.executable, "-c", code], {"ZTEAM_NAMESPACE": "t1"})
        assert supervisor.wait(lambda: bool(supervisor.heard), LIMIT)
        assert supervisor.heard == [("a", "t1 True")]


def test_measuring_covers_every_process() -> None:
    """One call brings the figures of all processes up to date."""
    with Watched() as supervisor:
        both = [supervisor.run("a", WAITING), supervisor.run("b", WAITING)]
        supervisor.measure()
        assert all(p.usage.rss_mb > 1 and p.usage.pss_mb > 1 for p in both)


def is_frozen(pid: int) -> bool:
    """Whether a process that was sent SIGSTOP stands still before long."""
    deadline = monotonic() + LIMIT
    while monotonic() < deadline:
        # Its parent is another process, so nobody tells us when the signal has taken effect.
        if (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] == "T":
            return True
    return False


SUPERVISED = f"""
import os, signal, sys
from zteam.launch.supervisor import Supervisor
supervisor = Supervisor(lambda name, line: print(name, line, flush=True), lambda process: None)
child = supervisor.start("child", [sys.executable, "-c", {OWN!r}])
supervisor.wait(lambda: bool(child.lines), 30)
print("pid", child.pid, flush=True)
signal.pause()
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("frozen", [False, True])
def test_children_end_when_their_supervisor_dies(number: signal.Signals, frozen: bool) -> None:
    """However the supervisor ends, its children notice and stop, even one that was frozen, once it goes on."""
    with subprocess.Popen([sys.executable, "-c", SUPERVISED], stdout=subprocess.PIPE, text=True) as supervisor:
        assert supervisor.stdout is not None
        for line in supervisor.stdout:
            if line.startswith("pid "):
                break
        pid = int(line.split()[1])
        handle = os.pidfd_open(pid)
        if frozen:
            os.kill(pid, signal.SIGSTOP)
            assert is_frozen(pid)
        supervisor.send_signal(number)
        supervisor.wait(LIMIT)
        if frozen and not select.select([handle], [], [], 0)[0]:
            # The kernel wakes orphans that stand still, but one that was just about to may be missed.
            signal.pidfd_send_signal(handle, signal.SIGCONT)
        ended, _, _ = select.select([handle], [], [], LIMIT)
        if not ended:
            signal.pidfd_send_signal(handle, signal.SIGKILL)
        os.close(handle)
        assert ended, "the child outlives its supervisor"


DEAF = """
import sys
from zteam.launch.supervisor import Supervisor
def on_line(name, line):
    raise BrokenPipeError
supervisor = Supervisor(on_line, lambda process: None)
supervisor.start("child", [sys.executable, "-c", "print('line'); raise SystemExit(3)"])
told = supervisor.wait(lambda: bool(supervisor.failures), 2)
supervisor.close()
raise SystemExit(0 if told else 1)
"""


def test_a_listener_that_fails_does_not_hide_an_end() -> None:
    """`zteam up | head` takes away the launcher's output; its processes must still be watched and stopped."""
    done = subprocess.run([sys.executable, "-c", DEAF], capture_output=True, timeout=LIMIT, check=False)
    assert done.returncode == 0


def test_a_running_process_is_not_forgotten() -> None:
    """A second start under a name in use is refused, or ends the first: it never leaves one running unseen."""
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
    with Watched() as supervisor:
        kept = [supervisor.run("a", "raise SystemExit(1)") for _ in range(5)]
        assert supervisor.processes["a"] is kept[-1]
    assert len(list(Path("/proc/self/fd").iterdir())) == before
