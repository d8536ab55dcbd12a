"""The nodes of a team file beside a team in one process: they are processes, and join it over the bus."""

from collections.abc import Callable, Mapping

import msgspec

from zteam.launch.plan import Plan
from zteam.launch.process import Process
from zteam.launch.progress import Watched
from zteam.launch.report import ProcessReport, report_processes
from zteam.launch.restarts import Again, log_failure
from zteam.launch.supervisor import Supervisor


class NodeProcesses:
    """Without nodes it does nothing."""

    def __init__(self, plan: Plan, on_line: Callable[[str, str], None], on_failure: Callable[[], None]) -> None:
        self._jobs, self._optional, self._beside = plan.nodes, plan.optional, plan.beside
        self._tell = on_failure
        self._supervisor = Supervisor(on_line, self._on_failure) if plan.nodes else None

    def _on_failure(self, process: Process, again: Again) -> None:
        log_failure(process.name, process.exit_code, again)
        self._tell()

    @property
    def names(self) -> list[str]:
        """Of the nodes."""
        return list(self._jobs)

    @property
    def failures(self) -> set[str]:
        """Names of those that have failed for good."""
        failures = self._supervisor.failures if self._supervisor else ()
        return {process.name for process in failures} - self._beside

    @property
    def running(self) -> dict[str, Process]:
        """The newest process of each."""
        return self._supervisor.processes if self._supervisor else {}

    @property
    def restarts(self) -> dict[str, int]:
        """How often each was started again."""
        return dict(self._supervisor.restarts.counts) if self._supervisor else {}

    def start(self, environment: Mapping[str, str]) -> None:
        """Start them; `environment` lets them join the team. Raises ZteamError."""
        if self._supervisor is not None:
            for name, job in self._jobs.items():
                self._supervisor.start_job(name, msgspec.structs.replace(job, environment=environment))

    def watched(self) -> list[Watched]:
        """Which have ended."""
        ended = self._supervisor.ended if self._supervisor else ()
        return [Watched(name, name in ended, name not in self._optional) for name in self._jobs.keys() - self._beside]

    def report(self) -> list[ProcessReport]:
        """One row for each."""
        if self._supervisor is None:
            return []
        return report_processes(self._supervisor.processes, self._supervisor.restarts.counts)

    def stop(self) -> None:
        """Ask them to stop, and wait."""
        if self._supervisor is not None:
            self._supervisor.measure()
            self._supervisor.stop(self.names)

    def close(self) -> None:
        """Kill what still runs."""
        if self._supervisor is not None:
            self._supervisor.close()
