"""The processes that studies start: a router, teams as users start them, and what they print."""

import multiprocessing
import os
import re
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from logging import ERROR, getLogger
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from studies.chains.recorder import NAME, Moment
from zteam.bus.options import RouterOptions
from zteam.clock import HOST_FACTOR
from zteam.config.toml_values import toml_text
from zteam.errors import ZteamError
from zteam.node.kinds import ROUTER
from zteam.node.process_options import to_line
from zteam.team.launch.plan import MEMBER
from zteam.team.launch.process import Job, Process, exit_text, zteam_command
from zteam.team.launch.supervisor import Supervisor
from zteam.team.run.report import RunReport
from zteam.team.security.certificates import ACCESS, files_of

LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for anything that takes a few."""


class Launch:
    """Processes by name, with all lines that they print."""

    def __init__(self) -> None:
        self.lines: defaultdict[str, list[str]] = defaultdict(list)
        self.supervisor = Supervisor(lambda name, line: self.lines[name].append(line))

    def start(self, name: str, *command: str, environment: Mapping[str, str] = {}) -> Process:
        """Start a command of zteam."""
        return self.supervisor.start_job(name, Job(zteam_command(*command), environment))

    def start_router(self, certificates: Path | None = None) -> str:
        """Start a router, with a folder of certificates over TLS; its endpoint. Raises ZteamError."""
        options = RouterOptions(("tcp/127.0.0.1:0",))
        if certificates is not None:
            access = str(certificates.resolve() / ACCESS)
            options = RouterOptions(("tls/127.0.0.1:0",), config=access, tls=files_of(certificates, ROUTER))
        router = self.supervisor.start_job(ROUTER, Job(MEMBER, words=to_line(ROUTER, options)))
        self.supervisor.wait(lambda: not router.running or bool(router.report.listening), LIMIT)
        if not router.report.listening:
            raise ZteamError(f"the router did not start: {self.lines[ROUTER][-1:]}")
        return router.report.listening

    def wait_for(self, name: str, pattern: str, since: int = 0) -> "re.Match[str]":
        """The first line of a process, from number `since` on, that has the pattern. Raises ZteamError."""
        process, found = self.supervisor.processes[name], list[re.Match[str]]()

        def look() -> bool:
            found[:] = filter(None, (re.search(pattern, line) for line in list(self.lines[name])[since:]))
            return bool(found) or not process.running

        self.supervisor.wait(look, LIMIT)
        if not found:
            raise ZteamError(f"{name} never printed {pattern!r}: {' | '.join(self.lines[name][-3:])}")
        return found[0]

    def wait_for_end(self, process: Process, seconds: float) -> None:
        """Wait until it has ended. Raises ZteamError unless its exit code is 0."""
        self.supervisor.wait(lambda: not process.running, seconds)
        if not process.join(LIMIT) or process.exit_code != 0:
            last = " | ".join([exit_text(process.exit_code), *self.lines[process.name][-3:]])
            raise ZteamError(f"{process.name} failed: {last}")

    def close(self) -> None:
        """End all processes, the router last: sessions that lose it try to reconnect."""
        self.supervisor.stop([name for name in self.supervisor.processes if name != ROUTER])
        self.supervisor.stop([ROUTER])
        self.supervisor.close()


def run_processes(
    team: Path, seconds: float, words: Sequence[str], nodes: Mapping[str, Sequence[str]] = {}
) -> tuple[RunReport, list[Moment]]:
    """Run a team file until `seconds` simulated seconds after GO: the report, and where the robots were.

    `words` are further words for `zteam up`, `nodes` further processes of the team by name, as commands. The router is
    at a port of its own, so no tool or node of the user joins. Raises ZteamError for a run that fails.
    """
    with TemporaryDirectory() as folder, launch() as processes:
        around, tracks, report = (Path(folder) / name for name in ("team.toml", "tracks.json", "report.json"))
        recorder = [sys.executable, "-P", "-m", "studies.chains.recorder", str(tracks)]
        lines = [f"include = {toml_text([str(team.resolve())])}"]
        for name, command in {NAME: recorder, **nodes}.items():
            lines += ["[[nodes]]", f"name = {toml_text(name)}", f"command = {toml_text(command)}", "expect = true"]
        around.write_text("\n".join(lines) + "\n")
        end = ["--for", str(seconds), "--report", str(report), "--connect", processes.start_router()]
        up = processes.start("up", "zteam", "up", str(around), *words, *end)
        processes.wait_for_end(up, 600 + 60 * seconds)
        moments = msgspec.json.decode(tracks.read_bytes(), type=list[Moment])
        return msgspec.json.decode(report.read_bytes(), type=RunReport), moments


@contextmanager
def launch() -> Iterator[Launch]:
    """Processes that end with the block."""
    processes = Launch()
    try:
        yield processes
    finally:
        processes.close()


@contextmanager
def children(jobs: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """So many child processes for calls, or one a processor. An error of the block ends them at once."""
    # Not forked: this process may have threads.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs or os.cpu_count(), context, _log_errors_alone)
    try:
        yield pool
    except BaseException:
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _log_errors_alone() -> None:
    # The warnings of dozens of teams would hide the table.
    getLogger("zteam").setLevel(ERROR)
