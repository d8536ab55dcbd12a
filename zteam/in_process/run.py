"""One run of a whole team in this process, from start to end: nodes, GO, time limit, report, stop in order.

It has the methods of `zteam.launch.run.Run`. The launcher's part runs in a thread beside the simulator's.
"""

import logging
import os
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import ExitStack
from threading import Thread
from typing import TYPE_CHECKING, TypeVar

from zteam import names
from zteam.clock import monotonic
from zteam.errors import UsageError
from zteam.in_process.endings import Endings
from zteam.in_process.hub import TeamHub
from zteam.in_process.logs import naming_nodes
from zteam.in_process.member import Member, own_part
from zteam.in_process.node_processes import NodeProcesses
from zteam.in_process.parts import parts_of
from zteam.in_process.user_calls import CallWatch, UserCall
from zteam.launch.kinds import TeamLaunch
from zteam.launch.overview import TeamOverview
from zteam.launch.plan import plan_team, stop_order
from zteam.launch.process import exit_text
from zteam.launch.progress import Progress, Watched
from zteam.launch.report import RunReport, make_report, measure_processes, read_counts, seconds_since_start
from zteam.launch.restarts import Restarts, serve_restarts
from zteam.launch.supervisor import GRACE
from zteam.nodes.bodies import Part
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop

if TYPE_CHECKING:
    from zteam.in_process.outside import Outside

log = logging.getLogger("zteam")

Body = Callable[[Node], None]
"""The body of a user's own node, as for `zteam.run`."""
R = TypeVar("R")


def _parts(launch: TeamLaunch, on_line: Callable[[str, str], None], nodes: Mapping[str, Body]) -> dict[str, Part]:
    parts = parts_of(launch, on_line)
    for name, body in nodes.items():
        if name in parts:
            raise UsageError(f"node {name!r}: the team has a process of this name already")
        parts[name] = own_part(body)
    return parts


class InProcessRun:
    """Use as: `with InProcessRun(...) as run: run.beside_simulator(work)`, where `work` starts, watches, finishes."""

    def __init__(
        self,
        launch: TeamLaunch,
        stop: Stop,
        on_line: Callable[[str, str], None],
        nodes: Mapping[str, Body] | None = None,
        since_start: Callable[[], float] = seconds_since_start,
        on_failure: Callable[[Member], None] = lambda _member: None,
        outside: "Outside | None" = None,
        take_hang: Callable[[UserCall], bool] | None = None,
    ) -> None:
        """`on_line(name, text)` prints what a node writes; `nodes` are the bodies of own nodes, by name.

        `on_failure(member)` is called when a node has ended without being asked to; `take_hang` is that of CallWatch.
        Tools `outside` find the team.
        """
        self._launch = launch
        self._stop = stop
        self._since_start = since_start
        self._progress: Progress | None = None
        plan = plan_team(launch)
        self.processes = NodeProcesses(plan, on_line, self._wake)
        """The nodes of the team file, which are processes."""
        self._restarts = Restarts(self.restart_node, (name for name, job in plan.own.items() if job.restarts))
        self.endings = Endings(self._restarts, on_failure)
        self._outside = outside
        self.hub = TeamHub(None if outside is None else outside.bus)
        self.calls = CallWatch(launch.pace, self.hub.delivery, take_hang)
        self.bus = self.hub.bus(names.LAUNCHER)
        serve_restarts(self.bus, self._counts)
        parts = _parts(launch, on_line, nodes or {})
        self.members = {name: Member(name, part, self.hub, self._on_end) for name, part in parts.items()}
        stop.on_request(self._wake)

    def __enter__(self) -> "InProcessRun":
        self._log = ExitStack()
        self._log.enter_context(naming_nodes())
        self._log.enter_context(self.calls.watching())
        if self._outside is not None:
            self._outside.hold_namespace(self.bus, (*self.members, *self.processes.names), self._stop)
        return self

    def __exit__(self, *_: object) -> None:
        self._stop_all()
        self.processes.close()
        if self._outside is not None:
            self._outside.release()
        self._log.close()
        if self._progress is not None:
            self._progress.close()
        self.bus.close()
        self.hub.close()

    def _wake(self) -> None:
        if self._progress is not None:
            self._progress.wake()

    def _on_end(self, member: Member) -> None:
        self.endings.take(member)
        self._wake()

    def beside_simulator(self, work: Callable[[], R]) -> R:
        """Run the simulator in this thread until it is asked to stop, and `work()` in another; return its result.

        In lock-step the behaviours run in the simulator's thread, so a debugger gets the terminal.
        """
        simulator, result = self.members[names.SIMULATOR], Future[R]()
        simulator.begin()

        def run() -> None:
            try:
                result.set_result(work())
            except BaseException as error:
                result.set_exception(error)
            finally:
                simulator.terminate()

        Thread(target=run, name="launcher", daemon=True).start()
        self._run(simulator)
        return result.result()

    def start(self) -> None:
        """Start all nodes but the simulator."""
        self._progress = Progress(self.bus, self._launch.has_end, self._since_start)
        for name in self.members:
            if name != names.SIMULATOR:
                self.start_node(name)
        if self._outside is not None:
            self.processes.start(self._outside.environment)
        if self._stop.requested:
            self._wake()

    def start_node(self, name: str) -> None:
        """Start one node, in a thread of its own."""
        member = self.members[name]
        member.begin()
        self.endings.note_start(name)
        Thread(target=self._run, args=(member,), name=name, daemon=True).start()

    def restart_node(self, name: str) -> None:
        """Start a node once more that has ended."""
        self.members[name] = self.members[name].again()
        self.start_node(name)

    def _run(self, member: Member) -> None:
        if member.name == names.SIMULATOR:
            self.hub.delivery.deliver_in_this_thread()
        member.run()

    def team_overview(self) -> TeamOverview:
        """A watch on the team that was started."""
        return TeamOverview(self.bus, [robot.id for robot in self._launch.team.robots], is_simulated=True)

    def watch(self, go_timeout: float | None = None) -> None:
        """Wait for the end of the run or for the stop request.

        Raises ZteamError if the run cannot reach its end, or without GO within `go_timeout` host seconds.
        """
        assert self._progress is not None
        self._progress.watch(self._stop, self._watched, self._last_words, go_timeout)

    def _last_words(self, name: str) -> str:
        return exit_text((self.members.get(name) or self.processes.running[name]).exit_code)

    def _watched(self) -> list[Watched]:
        return [*(Watched(name, name in self.endings) for name in self.members), *self.processes.watched()]

    def finish(self) -> RunReport | None:
        """Collect the counts, stop everything in order, and report; None after a stop."""
        progress = self._progress
        counts = None if self._stop.requested else read_counts(self.bus)
        own = measure_processes({names.LAUNCHER: os.getpid()})
        restarts = self._counts()
        self._stop_all()
        if counts is None or progress is None:
            return None
        rows, wall = [*self.processes.report(), *own], progress.wall or self._since_start()
        return make_report(counts, wall, progress.go_after, rows, restarts, sorted(self.calls.hung))

    def _counts(self) -> dict[str, int]:
        return {**self._restarts.counts, **self.processes.restarts}

    def _stop_all(self) -> None:
        self._restarts.end()
        # Before the robots: a node may drive one of them.
        self.processes.stop()
        _stop_in_order(self.members)


def _stop_in_order(members: Mapping[str, Member]) -> None:
    for group in stop_order(members):
        for name in group:
            members[name].terminate()
        deadline = monotonic() + GRACE
        for name in group:
            members[name].join(max(0.0, deadline - monotonic()))
