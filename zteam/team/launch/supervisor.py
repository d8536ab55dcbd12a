"""Starts, watches and ends the members of a team, which are processes, or nodes of this process, and starts those again
that have failed. No process outlives the supervisor, however that ends."""

import signal
import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from typing import Protocol

import msgspec

from zteam.bus.options import share_arenas
from zteam.clock import HOST_FACTOR, later, monotonic, wait_until
from zteam.errors import ZteamError, log
from zteam.node.faults import shortage_text
from zteam.node.launcher import Report
from zteam.team.launch.process import Job, Process, StartChild, exit_text, spawn

GRACE = 2.0 * HOST_FACTOR
"""Seconds from SIGTERM until SIGKILL; the processes end themselves after 1.5."""
_SAMPLE_PERIOD = 5.0
"""Seconds between measurements: reading a process's PSS walks its page tables, which delays it by milliseconds."""


_FINAL = frozenset({0, 2, -signal.SIGHUP, -signal.SIGINT, -signal.SIGTERM, -signal.SIGPIPE})
"""Exit codes of a process that has not failed, was asked to end (as for systemd), or cannot run as it was started."""


DELAYS = (0.1, 1.0, 2.0, 4.0, 8.0)
"""Host seconds before each restart in a row; after as many it is given up."""
STEADY = 10.0
"""A process that ran for so many host seconds has recovered: its next failure is the first in a row."""


class Member(Protocol):
    """What the supervisor needs of a member of a team; `Process` is one, and says what each of these is."""

    name: str
    stopping: bool

    @property
    def lines(self) -> Collection[str]: ...
    @property
    def fault(self) -> str: ...
    @property
    def exit_code(self) -> int | None: ...
    @property
    def running(self) -> bool: ...
    def terminate(self) -> None: ...
    def kill(self) -> None: ...
    def join(self, timeout: float) -> bool: ...


class _Place(msgspec.Struct, eq=False):
    """How the member of one name begins, and what becomes of it."""

    begin: Callable[[], Member]
    job: Job
    in_row: int = 0
    """Its failures in a row."""
    begun: float = 0.0
    """When it was started last, in host time."""
    take_back: Callable[[], None] | None = None
    """Calls off the restart that is due."""
    is_called_off: bool = False
    """Whether it is not started again by itself any more."""

    def call_off(self) -> None:
        self.is_called_off = True
        if self.take_back is not None:
            self.take_back()
            self.take_back = None


class Supervisor:
    """Members of a team by name. When this process ends, its children read the end of their links and stop."""

    def __init__(self, on_line: Callable[[str, str], None], start_child: StartChild = spawn) -> None:
        # Before there is a thread for the lines of each member.
        share_arenas()
        self._on_line, self._start_child = on_line, start_child
        self.on_failure: Callable[[Member, bool], None] = lambda _member, _again: None
        """`on_failure(member, again)`: it has failed, and whether it is started again."""
        self.members: dict[str, Member] = {}
        self._places: dict[str, _Place] = {}
        self.changed = threading.Condition()
        """Notified when a process writes a line or a report, and when a member is started or ends."""
        self.failures: list[Member] = []
        """Those that ended without being asked to, and are not started again."""
        self.ended: set[str] = set()
        """Names of those that have ended and are not started again."""
        self.restarts: dict[str, int] = {}
        """How often each was started again after a failure."""
        self._restarting = threading.Lock()
        self._closing = threading.Event()
        self._sampler: threading.Thread | None = None
        """None before there is a process."""

    @property
    def processes(self) -> dict[str, Process]:
        return {name: member for name, member in list(self.members.items()) if isinstance(member, Process)}

    def start_job(self, name: str, job: Job) -> Process:
        """Start a process. Raises ZteamError if the command cannot be started."""
        process = self.start_member(name, partial(self._spawn, name), job)
        assert isinstance(process, Process)
        return process

    def start_member(self, name: str, begin: Callable[[], Member], job: Job) -> Member:
        """Start a member with `begin()`, which has `on_end` called when it ends; it replaces one of the same name.
        The `job` says whether it may end, and is started again."""
        # A restart that waits for its time would replace the new member.
        self._call_restarts_off([name])
        self._places[name] = _Place(begin, job)
        return self.restart(name)

    def restart(self, name: str) -> Member:
        """Start a member again as at first, in place of a restart that waits for its time."""
        with self._restarting:
            place = self._places[name]
            place.call_off()
            self._places[name] = _Place(place.begin, place.job)
            return self._begin(name)

    def _begin(self, name: str) -> Member:
        if name in self.members:
            self.members[name].stopping = True
            self.members[name].kill()
            self.members[name].join(GRACE)
        self.ended.discard(name)
        self._places[name].begun = monotonic()
        member = self._places[name].begin()
        with self.changed:
            self.members[name] = member
            self.changed.notify_all()
        return member

    def _spawn(self, name: str) -> Process:
        job = self._places[name].job
        try:
            process = Process(name, job, self._receive_line, self._receive_report, self.on_end, self._start_child)
        except OSError as error:
            reason = shortage_text(error) or error.strerror or error
            raise ZteamError(f"{name}: cannot start {job.command[0]}: {reason}") from None
        if self._sampler is None:
            self._sampler = threading.Thread(target=self._sample, name="usage", daemon=True)
            self._sampler.start()
        return process

    def _receive_line(self, process: Process, line: str) -> None:
        self._on_line(process.name, line)
        self.wake()

    def _receive_report(self, process: Process, report: Report) -> None:
        place = self._places[process.name]
        if place.job.learn is not None and (learned := place.job.learn(place.job, report)) is not None:
            place.job = learned
        self.wake()

    def wake(self) -> None:
        """Have what waits look again."""
        with self.changed:
            self.changed.notify_all()

    def on_end(self, member: Member) -> None:
        name, code = member.name, member.exit_code
        place = self._places[name]
        failed = not member.stopping and not (code == 0 and place.job.may_end)
        again = failed and self._restart_later(member, place)
        if failed:
            # First: what waits for the end finds the reason there.
            self.on_failure(member, again)
        with self.changed:
            if not again:
                self.ended.add(name)
                if failed:
                    self.failures.append(member)
            self.changed.notify_all()

    def _restart_later(self, member: Member, place: _Place) -> bool:
        """A member has failed: whether it is started again."""
        told = f"{member.name} ended: {exit_text(member.exit_code)}"
        with self._restarting:
            if member.exit_code in _FINAL or place.is_called_off or not place.job.restarts:
                log.error("%s; it is not started again", told)
                return False
            place.in_row = 1 if monotonic() - place.begun >= STEADY else place.in_row + 1
            if place.in_row > len(DELAYS):
                log.error("%s; it is not started again: it has failed %d times in a row", told, place.in_row)
                return False
            delay = DELAYS[place.in_row - 1]
            log.warning("%s; it is started again in %g s (%d of %d)", told, delay, place.in_row, len(DELAYS))
            # Host time: a restart is due at host time, while the launcher waits for the end of the run.
            act = partial(self._restart_now, member.name, place)
            place.take_back = later(delay, act, f"restart {member.name}")
        return True

    def _restart_now(self, name: str, place: _Place) -> None:
        # All of it under the lock: what is called off cannot start any more.
        with self._restarting:
            if place.take_back is None:
                return
            place.take_back = None
            self.restarts[name] = self.restarts.get(name, 0) + 1
            try:
                self._begin(name)
            except ZteamError as error:
                log.error("%s; it is not started again", error)
                with self.changed:
                    self.failures.append(self.members[name])
                    self.ended.add(name)
                    self.changed.notify_all()

    def _call_restarts_off(self, names: Iterable[str]) -> None:
        with self._restarting:
            for place in filter(None, map(self._places.get, names)):
                place.call_off()

    def wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Wait until `ready()`, checked when `changed` is notified, for at most `timeout` s."""
        with self.changed:
            return wait_until(self.changed, ready, timeout)

    def stop(self, names: Sequence[str], hurry: Callable[[], bool] = lambda: False) -> None:
        """Ask these members to stop, all at once; kill the rest after GRACE, or as soon as `hurry()`."""
        self._call_restarts_off(names)
        chosen = [self.members[name] for name in names if name in self.members]
        for member in chosen:
            member.terminate()
        self.wait(lambda: hurry() or not any(m.running for m in chosen), GRACE)
        for member in chosen:
            if member.running:
                member.kill()
            # A thread cannot be killed; GRACE is over.
            if isinstance(member, Process) or not member.running:
                member.join(GRACE)

    def close(self) -> None:
        """Kill every process that still runs."""
        self._call_restarts_off([*self.members])
        for member in self.members.values():
            member.stopping = True
            if member.running:
                member.kill()
        for process in self.processes.values():
            process.join(GRACE)
        self._closing.set()
        if self._sampler is not None:
            self._sampler.join(GRACE)

    def measure(self) -> None:
        """Update the memory and processor time of every process."""
        for process in self.processes.values():
            if process.running:
                process.usage.measure()

    def _sample(self) -> None:
        while not self._closing.wait(_SAMPLE_PERIOD):
            self.measure()
