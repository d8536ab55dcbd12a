"""Members of a run that are threads of this process, on a bus in memory, and the end of their calls that do not return.
Nodes of the team file are processes.

The launcher's part runs in a thread beside the simulator's.
"""

import ctypes
import os
import threading
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future
from contextlib import ExitStack
from functools import partial
from threading import Thread
from typing import Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import DEFAULT_ENDPOINT, RouterOptions, client_config
from zteam.bus.router import open_team_router
from zteam.errors import UsageError, ZteamError, check_call, log
from zteam.node.faults import dump_stacks, unreturned_calls, user_fault
from zteam.node.logs import KEEPER
from zteam.node.node import Node, stepping
from zteam.node.process_node import ProcessNode, run_body
from zteam.node.process_options import MonitorOptions, RobotOptions, ViewOptions
from zteam.node.shutdown import Stop
from zteam.node.working import WORK, hanging, working_for
from zteam.robot.process.inputs import TransformInputs
from zteam.team.chaos.means import no_link
from zteam.team.in_process.bridge import NodeSessions
from zteam.team.launch.plan import LaunchPlan, Pace, TeamLaunch, options_of
from zteam.team.launch.process import Job
from zteam.team.launch.supervisor import Supervisor
from zteam.team.parts import Part, monitor_part, part_of, robot_part
from zteam.team.run.processes import ROUTER_DEADLINE, lease_for, node_environment, refuse_second_team

Body = Callable[[Node], None]
"""The body of a user's own node, as for `zteam.run`."""
R = TypeVar("R")
_PERIOD = 0.5
"""Host seconds between two looks at the threads."""

Call = tuple[int, str]
"""The number of a call that is under way, and its node."""


def parts_of(launch: TeamLaunch, say: Callable[[str, str], None], nodes: Mapping[str, Body]) -> dict[str, Part]:
    """What the nodes of a simulated team and a user's own do, by name; `say(name, line)` prints a line of a node."""
    # Not in the nodes' threads: pytest parses what is imported, which two threads of Python 3.11 cannot do at once.
    import zteam.robot.process.node  # noqa: F401

    transforms, parts = TransformInputs(), dict[str, Part]()

    def run_robot(options: RobotOptions, node: Any) -> None:
        # In the node's own thread: a mistake in the user's code ends that node, and may be gone at a restart.
        robot_part(options, transforms).body(node)

    for name, options in options_of(launch).items():
        if isinstance(options, RobotOptions):
            parts[name] = Part(partial(run_robot, options), Node)
        elif isinstance(options, MonitorOptions):
            parts[name] = monitor_part(options, partial(say, name))
        elif not isinstance(options, ViewOptions):
            parts[name] = part_of(options)
    for name, body in nodes.items():
        if name in parts:
            raise UsageError(f"node {name!r}: the team has a process of this name already")
        check_call(body, 1, f"nodes[{name!r}] is {body!r:.60}: give a function 'def main(node): …'")
        parts[name] = Part(stepping(body), Node)
    return parts


def in_thread(call: Callable[[], R], name: str = "team") -> "Future[R]":
    """What `call()` returns or raises, from a thread of its own."""
    done = Future[R]()

    def work() -> None:
        try:
            done.set_result(call())
        except BaseException as error:
            done.set_exception(error)

    Thread(target=work, name=name, daemon=True).start()
    return done


class _Ended(SystemExit):
    """Raised in a call that does not return. An `except Exception` in its loop does not catch it."""

    code = 1


def end_call(thread: int) -> None:
    """End what a thread runs, such as an endless loop of a user's code, and the node that runs there.

    This is a hack. Python offers no way to end a thread; CPython's C API can only have the thread raise an exception
    at its next bytecode, wherever that is. So it can leave data half changed, and code that catches SystemExit goes
    on. A thread that waits outside of Python, as in `time.sleep`, raises when the wait is over. It is used only on a
    node that hangs: without it, one such loop takes the interpreter's lock from all that follows in the process, such
    as the rest of a pytest session.
    """
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(_Ended))


def end_user_calls() -> None:
    """End every node of this process that is in a user's code now."""
    for thread in unreturned_calls(dump_stacks()):
        if WORK[thread].node:
            end_call(thread)


class CallWatch:
    """Ends the calls of nodes that last longer than the time-out of lock-step, in which other nodes wait for them."""

    def __init__(self) -> None:
        self.hangs: dict[str, str] = {}
        """The nodes whose calls lasted too long, and where they were then, in words."""
        self._before = {*hanging()}
        """Left behind by an earlier team of this process."""
        self._calls_before = self._calls()
        """As well, and of nodes of perhaps the same names."""

    @property
    def hung(self) -> set[str]:
        """The nodes whose step does not return, or was ended."""
        return {*self.hangs, *(watch.node for watch in hanging() if watch not in self._before)}

    def _calls(self) -> dict[Call, int]:
        """The calls that others wait for now, those of other teams too, and their threads."""
        return {(work.call, work.node): thread for thread, work in WORK.copy().items() if work.node and work.call}

    def start(self, pace: Pace, *, in_real_time: bool) -> Callable[[], None]:
        """Have a thread look at the calls; returns a function that ends this. Out of lock-step such calls go on, unless
        they are to end `in_real_time` too."""
        ended = threading.Event()
        if pace.lockstep or in_real_time:
            Thread(target=self._watch, args=(pace.timeout, ended), name="calls", daemon=True).start()
        return ended.set

    def _watch(self, timeout: float, ended: threading.Event) -> None:
        looks = dict[Call, int]()
        while not ended.wait(_PERIOD):
            calls = {call: thread for call, thread in self._calls().items() if call not in self._calls_before}
            # Only calls that were seen before last long enough to be shown.
            shown = unreturned_calls(dump_stacks() if looks.keys() & calls.keys() else "")
            # Looks are counted and not seconds: a frozen process does not look, and the time in a debugger is left out.
            looks = {c: looks.get(c, 0) + 1 for c, thread in calls.items() if c not in looks or thread in shown}
            for call, count in looks.items():
                if count * _PERIOD > timeout and calls[call] in shown:
                    self._name(call[1], f"after {timeout:g} s {shown[calls[call]]}")
                    if call in self._calls():
                        end_call(calls[call])

    def _name(self, node: str, text: str) -> None:
        if node not in self.hangs:
            self.hangs[node] = f"{node} hangs: {text}"
            with working_for(node):
                log.error("%s", self.hangs[node])


class NodeThread:
    """A member that is a node in a thread of this process. `on_end(member)` is called there when it has ended."""

    lines: Collection[str] = ()
    """What it says is in the log of this process."""

    def __init__(self, name: str, part: Part, sessions: NodeSessions, on_end: Callable[["NodeThread"], None]) -> None:
        """`run` follows."""
        self.name, self._part, self._sessions, self._on_end = name, part, sessions, on_end
        self.exit_code: int | None = None
        self.error: BaseException | None = None
        """What ended it, if that was an error."""
        self.stopping = False
        self._stop, self._ended = Stop(), threading.Event()

    @property
    def running(self) -> bool:
        return self.exit_code is None

    @property
    def fault(self) -> str:
        """The text of that error; empty if there is none, or if zteam has reported it in a line."""
        return "" if self.error is None or isinstance(self.error, (ZteamError, SystemExit)) else user_fault(self.error)

    def run(self) -> None:
        name, part, code = self.name, self._part, 1
        with working_for(name):
            if name == names.SIMULATOR:
                self._sessions.delivery.deliver_in_this_thread()
            try:
                code = run_body(name, lambda: self._sessions.bus(name), self._body, self._stop, part.clock, part.make)
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
        node.in_team = True
        try:
            self._part.body(node)
        except BaseException as error:
            self.error = error
            raise

    def terminate(self) -> None:
        self.stopping = True
        self._stop.request("the team asks it to stop")

    def kill(self) -> None:
        """Nothing: a thread cannot be killed."""

    def join(self, timeout: float) -> bool:
        """Wait until it has ended; False if it still runs after `timeout` host seconds."""
        return self._ended.wait(timeout)


class Threads:
    """The members as threads of this process, and nodes of the team file as processes beside it. Use as: `with
    TeamRun(Threads(...), launch) as run: run.open(); run.members.beside_simulator(work)`, where `work` starts the run,
    watches it and finishes it."""

    def __init__(
        self,
        nodes: Mapping[str, Body] | None = None,
        options: BusOptions | None = None,
        stop: Stop | None = None,
        *,
        name: str = names.LAUNCHER,
        on_line: Callable[[str, str], None] = lambda _name, _text: None,
        ends_calls: bool = False,
        prefix_log: bool = False,
    ) -> None:
        """`nodes` are the bodies of own nodes, by name; with `options` tools find the team at a router, for which it
        waits until the `stop`. `name` is that of the caller.

        `on_line(name, text)` prints what a node writes: the monitor's events, which are in its log too. `ends_calls`:
        those that do not return, in real time too. `prefix_log` is the `prefix` of `LogKeeper.naming_nodes`.
        """
        self.supervisor = Supervisor(on_line)
        self.endpoint = ""
        self.bus: Bus | None = None
        self.tools_bus: Bus | None = None
        """This process's session at the router."""
        self.pids = {name: os.getpid()}
        self._name, self._nodes, self._options, self._on_line = name, nodes or {}, options, on_line
        self._stop, self._ends_calls, self._prefix_log = stop or Stop(), ends_calls, prefix_log
        self._environment: dict[str, str] = {}
        """What lets a process join the team."""
        self._calls = CallWatch()
        self.hangs = self._calls.hangs
        self._ends = ExitStack()

    change_link = staticmethod(no_link)

    @property
    def hung(self) -> set[str]:
        return self._calls.hung

    def plan_for(self, launch: TeamLaunch, plan: LaunchPlan) -> None:
        """Make what the nodes do. Raises what a mistake in their files raises."""
        self._plan, self._pace = plan, launch.pace
        self.parts = parts_of(launch, self._on_line, self._nodes)
        self._ends.enter_context(KEEPER.naming_nodes(names.LAUNCHER, prefix=self._prefix_log))
        self._ends.callback(self._calls.start(launch.pace, in_real_time=self._ends_calls))

    def open(self) -> None:
        """Have a session. Without `--connect` the router outside is one of this process, where `zteam up` has its own.
        Raises BusError if the team runs outside already."""
        given = self._options
        if given is not None:
            lease, self.endpoint = lease_for(self._pace, given.lease), given.connect or ""
            if not self.endpoint:
                client_config(given)
                router = open_team_router(RouterOptions((DEFAULT_ENDPOINT,), lease=lease))
                self._ends.callback(router.close)
                self.endpoint = router.endpoint
            joined = msgspec.structs.replace(given, connect=self.endpoint, lease=lease, small=False)
            self._environment = node_environment(joined)
            self.tools_bus = connect(joined, patience=ROUTER_DEADLINE, stopping=self._stop)
            self._ends.callback(self.tools_bus.close)
        self._sessions = NodeSessions(self.tools_bus)
        self._ends.callback(self._sessions.close)
        self.bus = self._sessions.bus(self._name)
        if given is not None and given.connect is not None:
            refuse_second_team(self.bus, (*self.parts, *self._plan.jobs))

    def beside_simulator(self, work: Callable[[], R]) -> R:
        """Run the simulator in this thread until it is asked to stop, and `work()` in another; return its result. In
        lock-step the behaviours run in the simulator's thread, so a debugger gets the terminal."""
        simulator = self._make(names.SIMULATOR)
        self.supervisor.start_member(names.SIMULATOR, lambda: simulator, Job(()))

        def run() -> R:
            try:
                return work()
            finally:
                simulator.terminate()

        result = in_thread(run, "launcher")
        simulator.run()
        return result.result()

    def start(self) -> None:
        """Start all nodes but a simulator that runs already, and the processes of the team file."""
        for name in self.parts:
            if name not in self.supervisor.members:
                self.supervisor.start_member(name, partial(self._begin, name), self._plan.jobs.get(name, Job(())))
        if self.tools_bus is not None:
            for name, job in self._plan.jobs.items():
                if name not in self.parts:
                    job = msgspec.structs.replace(job, environment=self._environment)
                    self.supervisor.start_job(name, job)

    def _begin(self, name: str) -> NodeThread:
        node = self._make(name)
        Thread(target=node.run, name=name, daemon=True).start()
        return node

    def _make(self, name: str) -> NodeThread:
        return NodeThread(name, self.parts[name], self._sessions, self.supervisor.on_end)

    def environment_of_new(self, _name: str) -> dict[str, str]:
        """What lets a process join from outside."""
        return self._environment

    def close(self) -> None:
        with self._ends:
            self._ends.callback(self.supervisor.close)
            if self.bus is not None:
                self.bus.close()
