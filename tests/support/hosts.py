"""Two hosts on one machine: network namespaces with a switch between them, each with a folder and its own clock."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from support.limits import LIMIT
from zteam.clock import wait_until

ADDRESSES = {"a": "10.0.0.1", "b": "10.0.0.2"}
"""Of the hosts, which call themselves host-a and host-b."""
_KEPT = {"ZTEAM_PATIENCE"}
"""Of zteam's variables of the test's own environment."""
_ENTER = 'hostname "$0" && exec "$@"'


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, timeout=LIMIT)


def why_no_hosts() -> str:
    """Why hosts cannot be made here; empty if they can."""
    if not shutil.which("ip"):
        return "there is no command 'ip'"
    probe = f"zteam-{os.getpid()}-probe"
    try:
        _ip("netns", "add", probe)
    except subprocess.CalledProcessError as error:
        return f"network namespaces are not permitted: {error.stderr.decode().strip()}"
    try:
        _ip("netns", "exec", probe, "unshare", "--uts", "sh", "-c", _ENTER, "host", "true")
    except subprocess.CalledProcessError as error:
        return f"namespaces cannot be entered: {error.stderr.decode().strip()}"
    finally:
        _ip("netns", "del", probe)
    return ""


class Started:
    """A process on a host, and the lines that it has written."""

    def __init__(self, command: list[str], folder: Path, environment: Mapping[str, str]) -> None:
        self._changed = threading.Condition()
        self._lines: list[str] = []
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as output:
            for line in output:
                with self._changed:
                    self._lines.append(line.rstrip("\n"))
                    self._changed.notify_all()

    @property
    def lines(self) -> list[str]:
        """A copy."""
        with self._changed:
            return list(self._lines)

    def wait_for(self, wanted: Callable[[str], object], after: int = 0) -> int:
        """Wait for a line, not counting the first `after` ones; the number of lines up to it."""
        found: list[int] = []

        def look() -> bool:
            found[:] = [i for i, line in enumerate(self._lines[after:], after + 1) if wanted(line)]
            return bool(found)

        with self._changed:
            assert wait_until(self._changed, look, LIMIT), "\n".join(self._lines[-20:])
        return found[0]

    def finish(self) -> int:
        """Wait for its end; its exit code."""
        code = self.process.wait(LIMIT)
        self._reader.join(LIMIT)
        return code

    def stop(self) -> int:
        """Interrupt it and all that it has started, as Ctrl+C does; its exit code."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGINT)
        return self.finish()


class Hosts:
    """The two hosts; what was started on them is stopped at the end, the last one first."""

    def __init__(self, folder: Path, clock: Path | None = None, offset: float = 0.0) -> None:
        """The clock of host b is `offset` seconds ahead, by the library `clock`."""
        self._prefix = f"zteam-{os.getpid()}"
        self._started: list[Started] = []
        self.folders = {host: folder / host for host in ADDRESSES}
        self._environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith("ZTEAM_") or name in _KEPT},
            "PATH": os.pathsep.join((str(folder / "bin"), str(Path(sys.executable).parent), os.environ["PATH"])),
        }
        self._far = {"LD_PRELOAD": str(clock), "CLOCK_OFFSET_NS": str(round(offset * 1e9))} if clock else {}

    def _name(self, host: str) -> str:
        return f"{self._prefix}-{host}"

    def __enter__(self) -> Self:
        try:
            for host in (*ADDRESSES, "switch"):
                _ip("netns", "add", self._name(host))
                _ip("-n", self._name(host), "link", "set", "lo", "up")
            switch = self._name("switch")
            _ip("-n", switch, "link", "add", "dev", "bridge0", "type", "bridge")
            _ip("-n", switch, "link", "set", "dev", "bridge0", "up")
            for host, address in ADDRESSES.items():
                self.folders[host].mkdir(parents=True)
                port = ("link", "add", "dev", f"port-{host}", "type", "veth", "peer", "name", "net0")
                _ip("-n", switch, *port, "netns", self._name(host))
                _ip("-n", switch, "link", "set", "dev", f"port-{host}", "master", "bridge0", "up")
                _ip("-n", self._name(host), "address", "add", f"{address}/24", "dev", "net0")
                _ip("-n", self._name(host), "link", "set", "dev", "net0", "up")
        except BaseException:
            self._remove()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            for started in reversed(self._started):
                started.stop()
        finally:
            self._remove()

    def _remove(self) -> None:
        for host in (*ADDRESSES, "switch"):
            with contextlib.suppress(subprocess.CalledProcessError):
                _ip("netns", "del", self._name(host))

    def start(self, host: str, *command: str, **environment: str) -> Started:
        """Start a command on a host, in its folder."""
        enter = ["ip", "netns", "exec", self._name(host), "unshare", "--uts", "sh", "-c", _ENTER, f"host-{host}"]
        far = [f"{name}={value}" for name, value in self._far.items()] if host == "b" else []
        state = {"XDG_STATE_HOME": str(self.folders[host] / "state")}
        started = Started(
            [*enter, "env", *far, *command], self.folders[host], {**self._environment, **state, **environment}
        )
        self._started.append(started)
        return started

    def run(self, host: str, *command: str, **environment: str) -> list[str]:
        """Run a command to its end; its lines."""
        started = self.start(host, *command, **environment)
        started.finish()
        return started.lines

    def connect(self, whole: bool) -> None:
        """Plug in host b's cable, or pull it: neither host is told."""
        _ip("-n", self._name("switch"), "link", "set", "dev", "port-b", "up" if whole else "down")
