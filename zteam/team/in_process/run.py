"""A run whose members are threads of this process, on a bus in memory; nodes of the team file are processes beside it.

The launcher's part runs in a thread beside the simulator's.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from functools import partial
from threading import Thread
from typing import NamedTuple, Self, TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import DEFAULT_ENDPOINT, RouterOptions
from zteam.bus.router import open_team_router
from zteam.errors import UsageError
from zteam.node.kinds import KINDS
from zteam.node.node import Node, stepping
from zteam.node.process_node import ProcessNode, run_body
from zteam.node.process_options import MonitorOptions, ProcessOptions, RobotOptions
from zteam.node.shutdown import Stop
from zteam.robot.process.inputs import TransformInputs
from zteam.team.chaos.links import no_link
from zteam.team.in_process.bridge import NodeSessions
from zteam.team.in_process.delivery import marks_owner
from zteam.team.in_process.user_calls import CallWatch, UserCall, naming_nodes
from zteam.team.launch.run import (
    ROUTER_DEADLINE,
    TeamRun,
    lease_for,
    node_environment,
    refuse_second_team,
)
from zteam.team.launch.starts import RobotStarts
from zteam.team.launch.supervisor import Again, Member, Supervisor
from zteam.team.launch.team_launch import Pace, TeamLaunch, options_of
from zteam.team.parts import Part, part_of, printing_monitor, robot_part

log = logging.getLogger("zteam")

Body = Callable[[Node], None]
"""The body of a user's own node, as for `zteam.run`."""
R = TypeVar("R")


def _part(options: ProcessOptions, transforms: TransformInputs, say: Callable[[str], None]) -> Part:
    if isinstance(options, MonitorOptions):
        return printing_monitor(options, say)
    if isinstance(options, RobotOptions):
        # Not in the nodes' threads: pytest parses what is imported, which two threads of Python 3.11 cannot do at once.
        import zteam.robot.process.node  # noqa: F401

        robot = options
        # In the node's own thread: a mistake in the user's code ends that node, and may be gone at a restart.
        return Part(lambda node: robot_part(robot, transforms).body(node), Node)
    return part_of(options)


def parts_of(
    launch: TeamLaunch, say: Callable[[str, str], None], nodes: Mapping[str, Body] | None = None
) -> dict[str, Part]:
    """What the nodes of a simulated team and a user's own do, by name; `say(name, line)` prints a line of a node."""
    transforms = TransformInputs()
    parts = {
        name: _part(options, transforms, partial(say, name))
        for kind in KINDS
        if not kind.beside
        for name, options in options_of(kind, launch).items()
    }
    for name, body in (nodes or {}).items():
        if name in parts:
            raise UsageError(f"node {name!r}: the team has a process of this name already")
        parts[name] = Part(stepping(body), Node)
    return parts


class NodeThread:
    """A member that is a node in a thread of this process. `on_end(member)` is called there when it has ended."""

    def __init__(self, name: str, part: Part, sessions: NodeSessions, on_end: Callable[["NodeThread"], None]) -> None:
        """`run` follows."""
        self.name = name
        self.exit_code: int | None = None
        """As of a process; None while it runs."""
        self.error: BaseException | None = None
        """What ended it, if that was an error."""
        self.lines: deque[str] = deque()
        """None: what it says is in the log of this process."""
        self.stopping = False
        """Whether it was asked to end."""
        self._stop = Stop()
        self._part = part
        self._sessions = sessions
        self._on_end = on_end
        self._ended = threading.Event()

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self.exit_code is None

    @marks_owner
    def run(self) -> None:
        """Run the node in this thread."""
        owner, part = self.name, self._part
        code = 1
        if owner == names.SIMULATOR:
            self._sessions.delivery.deliver_in_this_thread()
        try:
            code = run_body(owner, lambda: self._sessions.bus(owner), self._body, self._stop, part.clock, part.make)
        except SystemExit as error:
            code = error.code if isinstance(error.code, int) else int(error.code is not None)
        except BaseException as error:
            # Such as that of a debugger whose user quits.
            log.error("ended by %s", type(error).__name__)
        finally:
            self.exit_code = code
            # First: what `join` waits for has an end that is known.
            self._on_end(self)
            self._ended.set()

    def _body(self, node: ProcessNode) -> None:
        try:
            self._part.body(node)
        except BaseException as error:
            self.error = error
            raise

    def terminate(self) -> None:
        """Ask it to stop."""
        self.stopping = True
        self._stop.request("the team asks it to stop")

    def kill(self) -> None:
        """Nothing: a thread cannot be killed."""

    def join(self, timeout: float) -> bool:
        """Wait until it has ended; False if it still runs after `timeout` host seconds."""
        return self._ended.wait(timeout)


class Outside(NamedTuple):
    """Where tools find a team in one process: at a router, in this process's session there."""

    endpoint: str
    given: str | None
    """The router that the user named."""
    environment: dict[str, str]
    """What lets a process join the team."""
    bus: Bus


@contextmanager
def open_outside(options: BusOptions, pace: Pace) -> Iterator[Outside]:
    """Without `--connect` the router is one of this process, where `zteam up` has its own as well."""
    lease, endpoint = lease_for(pace, options.lease), options.connect
    with ExitStack() as ends:
        if endpoint is None:
            router = open_team_router(RouterOptions((DEFAULT_ENDPOINT,), lease=lease))
            ends.callback(router.close)
            endpoint = router.endpoint
        bus = connect(
            msgspec.structs.replace(options, connect=endpoint, lease=lease, small=False), patience=ROUTER_DEADLINE
        )
        ends.callback(bus.close)
        yield Outside(endpoint, options.connect, node_environment(endpoint, options, pace), bus)


class InProcessRun(TeamRun):
    """Use as: `with InProcessRun(...) as run: run.beside_simulator(work)`, where `work` starts, watches, finishes."""

    def __init__(
        self,
        launch: TeamLaunch,
        stop: Stop,
        nodes: Mapping[str, Body] | None = None,
        outside: Outside | None = None,
        *,
        on_line: Callable[[str, str], None] = lambda _name, _text: None,
        since_start: Callable[[], float] | None = None,
        on_end: Callable[[NodeThread], None] = lambda _node: None,
        take_hang: Callable[[UserCall], bool] | None = None,
    ) -> None:
        """`nodes` are the bodies of own nodes, by name; tools `outside` find the team.

        `on_line(name, text)` prints what a node writes: the monitor's events, which are in its log too. `on_end(node)`
        is called when a node has ended for good without being asked to; `take_hang` is that of CallWatch.
        """
        self.parts = parts_of(launch, on_line, nodes)
        super().__init__(launch, stop, Supervisor(on_line, self._on_failure), since_start)
        self._tell_end = on_end
        self._outside = outside
        self.endpoint = "" if outside is None else outside.endpoint
        self.sessions = NodeSessions(None if outside is None else outside.bus)
        self.calls = CallWatch(launch.pace, self.sessions.delivery, take_hang)
        self.bus = self.sessions.bus(names.LAUNCHER)
        self._watch_recoveries(self.bus)

    def __enter__(self) -> Self:
        self._ends.enter_context(naming_nodes())
        self._ends.enter_context(self.calls.watching())
        return self

    def __exit__(self, *error: object) -> None:
        try:
            super().__exit__(*error)
        finally:
            self.sessions.close()

    def _on_failure(self, member: Member, again: Again) -> None:
        super()._on_failure(member, again)
        if again.delay is None and isinstance(member, NodeThread):
            self._tell_end(member)

    @property
    def failures(self) -> list[NodeThread]:
        """The nodes of this process that ended for good without being asked to."""
        return [member for member in self.supervisor.failures if isinstance(member, NodeThread)]

    def beside_simulator(self, work: Callable[[], R]) -> R:
        """Run the simulator in this thread until it is asked to stop, and `work()` in another; return its result.

        In lock-step the behaviours run in the simulator's thread, so a debugger gets the terminal. Raises BusError if
        another team runs outside.
        """
        if self._outside is not None:
            assert self.bus is not None
            if self._outside.given is not None:
                refuse_second_team(self.bus, (*self.parts, *self.plan.jobs))
            self._hold_namespace()
            self._open_log(self.bus)
        simulator, result = self._make(names.SIMULATOR), Future[R]()
        self.supervisor.start_member(names.SIMULATOR, lambda: simulator)

        def run() -> None:
            try:
                result.set_result(work())
            except BaseException as error:
                result.set_exception(error)
            finally:
                simulator.terminate()

        Thread(target=run, name="launcher", daemon=True).start()
        simulator.run()
        return result.result()

    def start(self) -> None:
        """Start all nodes but the simulator."""
        self._begin_progress()
        for name in self.parts:
            if name != names.SIMULATOR:
                self.start_node(name)
        if self._outside is not None:
            environment = self._outside.environment
            others = {name: job for name, job in self.plan.jobs.items() if name not in self.parts}
            self._start_processes(others, lambda name: environment)
            self._signals.serve(self._outside.bus)
            self._starts = RobotStarts(
                self.launch, self.plan, self.supervisor, self._outside.bus, lambda name: environment
            )
        self._begin_faults(no_link)
        if self._stop.requested:
            self._wake()

    def start_node(self, name: str) -> None:
        """Start one node, in a thread of its own."""

        def begin() -> NodeThread:
            node = self._make(name)
            Thread(target=node.run, name=name, daemon=True).start()
            return node

        job = self.plan.own.get(name)
        self.supervisor.start_member(name, begin, restarts=job is not None and job.restarts)

    def _make(self, name: str) -> NodeThread:
        return NodeThread(name, self.parts[name], self.sessions, self.supervisor.take_end)

    def _stop_all(self) -> None:
        self._hung |= self.calls.hung
        super()._stop_all()
