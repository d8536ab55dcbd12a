"""One run of a team: the router's start, the end of the run, and what ends it early."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest
from msgspec import structs

from support.limits import LIMIT
from support.lockstep_doubles import ScriptedMonitor
from support.log_capture import captured_log
from zteam import names
from zteam.bus import BusOptions, NoRequest
from zteam.bus.memory import MemoryHub
from zteam.bus.options import DEFAULT_ENDPOINT, LEASE, RouterOptions
from zteam.errors import BusError, UsageError, ZteamError
from zteam.node.kinds import ROUTER
from zteam.node.process_options import to_line
from zteam.node.shutdown import Stop
from zteam.robot.client import start_robot
from zteam.simulator.client import SimStatus
from zteam.team.file.entries import RobotEntry, Team
from zteam.team.launch.plan import MEMBER, TeamLaunch
from zteam.team.launch.process import Job, Process
from zteam.team.launch.supervisor import Supervisor
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.run.processes import Processes, node_environment
from zteam.team.run.team_run import TeamRun

WORLD = Path("/w/arena.world")
TEAM = Team(robots=[RobotEntry(id=0, behavior="forward")])


def python(code: str) -> list[str]:
    """A command that runs a Python text."""
    return [sys.executable, "-S", "-c", code]


WAIT = "import time; time.sleep(600)"


ANNOUNCE = f"""
import os
os.write(int(os.environ["ZTEAM_LAUNCHER_LINK"]), b'{{"listening": "tcp/127.0.0.1:5"}}\\n')
{WAIT}"""


class Pretend:
    """Runs of small Python texts: `router` for the router, `others` for all other processes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.router = ANNOUNCE
        self.hub = MemoryHub()
        self.others = WAIT
        self.lines: list[tuple[str, str]] = []
        self._started: list[Process] = []
        start = Supervisor.start_job

        def pretend(supervisor: Supervisor, name: str, job: Job) -> Process:
            if job.command == MEMBER:
                job = structs.replace(job, command=python(self.router if name == ROUTER else self.others))
            self._started.append(start(supervisor, name, job))
            return self._started[-1]

        monkeypatch.setattr(Supervisor, "start_job", pretend)
        # The real bus needs a real router.
        monkeypatch.setattr("zteam.team.run.processes.connect", lambda *_, **__: self.hub.bus())
        self.stop = Stop()

    def run(self, run_for: float | None = None, bus: BusOptions | None = None) -> TeamRun:
        """A run whose processes are not started yet."""
        members = Processes(
            bus or BusOptions(), WarmParent(), lambda name, line: self.lines.append((name, line)), stop=self.stop
        )
        return TeamRun(members, TeamLaunch(TEAM, WORLD, run_for=run_for), self.stop)

    def tidy(self) -> None:
        """Wait for the end of every process, also of the replaced ones."""
        assert all(process.join(LIMIT) for process in self._started)


@pytest.fixture
def pretend(monkeypatch: pytest.MonkeyPatch) -> Iterator[Pretend]:
    """A run whose router listens at once and whose other processes run until they are ended."""
    chosen = Pretend(monkeypatch)
    yield chosen
    chosen.tidy()


def test_a_file_that_names_another_router_is_refused(pretend: Pretend, tmp_path: Path) -> None:
    """The team would be at its own router, and the file's would be passed over; no process starts."""
    path = tmp_path / "a.json5"
    path.write_text('{connect: {endpoints: ["tcp/10.0.0.1:7447"]}}')
    with pretend.run(bus=BusOptions(config=str(path))) as run:
        with pytest.raises(UsageError, match="--connect"):
            run.start()
        assert not run.supervisor.processes


def test_every_process_gets_the_endpoint(pretend: Pretend) -> None:
    """The router's, which has reported it, is in the environment of all others."""
    pretend.router = f"print(input(), flush=True)\n{ANNOUNCE}"
    pretend.others = f"import os; print(os.environ['ZTEAM_CONNECT'], flush=True)\n{WAIT}"
    with pretend.run() as run:
        run.start()
        assert run.members.endpoint == "tcp/127.0.0.1:5"
        options = RouterOptions((DEFAULT_ENDPOINT,), lease=LEASE, for_team="starts")
        expected = {(ROUTER, to_line(ROUTER, options))} | {(name, "tcp/127.0.0.1:5") for name in run.plan.jobs}
        assert run.supervisor.wait(lambda: set(pretend.lines) == expected, LIMIT)
    assert not any(p.running for p in run.supervisor.processes.values())


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("on_stop", "failed"),
    [("signal.SIG_IGN", False), ("lambda *_: os._exit(3)", True)],
    ids=["slow to end", "a step that hangs"],
)
def test_only_a_step_that_hangs_at_the_end_is_a_failure(
    pretend: Pretend, monkeypatch: pytest.MonkeyPatch, on_stop: str, failed: bool
) -> None:
    """A process that says so by its exit code has failed; one that is killed because it is slow is named."""
    monkeypatch.setattr("zteam.team.launch.supervisor.GRACE", 1.0)
    pretend.others = f"import os, signal; signal.signal(signal.SIGTERM, {on_stop}); print(1, flush=True); {WAIT}"
    with captured_log() as log, pretend.run() as run:
        run.start()
        assert run.supervisor.wait(lambda: {name for name, line in pretend.lines if line == "1"} >= {"robot_0"}, LIMIT)
    assert ("robot_0" in run.failed) == failed
    assert any("robot_0 had not ended" in line for line in log.lines) != failed


def test_no_router_is_an_error(pretend: Pretend) -> None:
    """If no router starts at all, the launcher raises an error and leaves no process."""
    pretend.router = "raise SystemExit(1)"
    with pytest.raises(BusError, match="router did not start"), pretend.run() as run:
        run.start()
    assert not any(p.running for p in run.supervisor.processes.values())


@pytest.mark.parametrize("code", [WAIT, "raise SystemExit(0)"], ids=["killed", "ends with 0"])
def test_a_failure_ends_a_run_with_a_limit(pretend: Pretend, code: str) -> None:
    """A run without its simulator has no result: it ends with an error that names the simulator."""
    with pretend.run(run_for=1.0) as run:
        run.plan.jobs[names.SIMULATOR] = Job(python(code))
        run.start()
        if code == WAIT:
            run.supervisor.processes[names.SIMULATOR].kill()
        with pytest.raises(ZteamError, match=names.SIMULATOR):
            run.watch()


def stop_once_watched(run: TeamRun, stop: Stop, monkeypatch: pytest.MonkeyPatch) -> None:
    """Request a stop when `run.watch` has begun: it holds its lock from then on until it waits."""
    look = run._missing

    def look_and_stop(begun: bool) -> list[str]:
        threading.Thread(target=stop.request, args=("test",)).start()
        return look(begun)

    monkeypatch.setattr(run, "_missing", look_and_stop)


def test_a_stop_request_ends_the_wait(pretend: Pretend, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl+C ends the wait, and the run then has no report."""
    with pretend.run(run_for=1000.0) as run:
        run.start()
        stop_once_watched(run, pretend.stop, monkeypatch)
        run.watch()
        assert run.finish() is None


@pytest.mark.few(2)
@pytest.mark.parametrize("name", ["robot_0", names.AGGREGATOR, names.MONITOR])
@pytest.mark.parametrize("code", [0, 2])
def test_a_process_that_ends_before_go_ends_a_run_with_a_limit(pretend: Pretend, name: str, code: int) -> None:
    """GO waits for all processes: the error names the ended one, its exit code and its last line."""
    with pretend.run(run_for=1.0) as run:
        run.plan.jobs[name] = Job(python(f"print('no such leader'); raise SystemExit({code})"))
        run.start()
        expected = rf"{name} ended \(exit code {code}: no such leader\): the run cannot begin"
        with pytest.raises(ZteamError, match=expected):
            run.watch()


def test_a_robot_that_ends_after_go_does_not_end_the_run(pretend: Pretend, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other processes go on, as in a run without a limit."""
    with pretend.run(run_for=1000.0) as run:
        run.start()
        ScriptedMonitor(pretend.hub).give_go()
        progress = run._progress
        assert progress is not None
        assert run.supervisor.wait(lambda: progress.go_after is not None, LIMIT)
        run.supervisor.processes["robot_0"].kill()
        assert run.supervisor.wait(lambda: bool(run.supervisor.failures), LIMIT)
        stop_once_watched(run, pretend.stop, monkeypatch)
        run.watch()


@pytest.mark.ci
def test_a_node_that_ends_while_the_first_tick_waits_for_it_ends_the_run(pretend: Pretend) -> None:
    """GO does not wait for it, so it may end a moment later than that: the run would stand for ever."""
    held = SimStatus("", [0], 1, 1, 0, tick=1, real_time_factor=0.0, lockstep=True, waiting_for="goals")
    pretend.hub.bus().serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: held)
    with pretend.run(run_for=1.0) as run:
        run.plan.jobs["goals"] = Job(python(WAIT))
        run.start()
        ScriptedMonitor(pretend.hub).give_go()
        progress = run._progress
        assert progress is not None
        assert run.supervisor.wait(lambda: progress.go_after is not None, LIMIT)
        run.supervisor.processes["goals"].kill()
        with pytest.raises(ZteamError, match=r"goals ended \(.*\): the run cannot begin"):
            run.watch()


@pytest.mark.gate
@pytest.mark.parametrize("gone", [False, True])
def test_a_run_that_does_not_begin_is_given_up(pretend: Pretend, gone: bool) -> None:
    """Without GO in time the wait ends with an error; with GO it lasts until the processes have ended."""
    pretend.others = "input()" if gone else WAIT
    pretend.router = ANNOUNCE.replace("600", "1")
    with pretend.run() as run:
        if gone:
            ScriptedMonitor(pretend.hub).give_go()
        run.start()
        with nullcontext() if gone else pytest.raises(ZteamError, match=r"no GO within 0\.01 s"):
            run.watch(0.01)
        assert run.supervisor.ended.issuperset(run.plan.jobs) == gone


@pytest.mark.parametrize("namespace", [None, "mine"])
def test_processes_get_every_option_of_the_connection(monkeypatch: pytest.MonkeyPatch, namespace: str | None) -> None:
    """Whatever the environment says, every process uses the launcher's connection, with and without a namespace."""
    monkeypatch.setenv("ZTEAM_NAMESPACE", "of_the_environment")
    monkeypatch.setenv("ZTEAM_CONFIG", "/of/the/environment")
    bus = BusOptions(connect="-", namespace=namespace, lease=3.0)
    for name, value in node_environment(bus).items():
        monkeypatch.setenv(name, value)
    chosen = BusOptions.from_environment()
    assert chosen == bus


def test_a_second_team_is_refused_in_one_line(pretend: Pretend) -> None:
    """The error names the first launcher's process id and start; no process starts; later the namespace is free."""
    bus = BusOptions(connect="tcp/127.0.0.1:5")
    told = rf"^a team is already running here \(pid {os.getpid()}, since \d\d:\d\d:\d\d\); stop it, or use --namespace$"
    with pretend.run(1.0, bus) as first:
        first.start()
        with pretend.run(1.0, bus) as second, pytest.raises(BusError, match=told):
            second.start()
        assert second.supervisor.processes == {}
        assert all(process.running for process in first.supervisor.processes.values())
    with pretend.run(1.0, bus) as third:
        third.start()


def test_a_robot_of_the_team_is_needed_unless_it_was_ended_on_request(pretend: Pretend) -> None:
    """When it is started again, the run needs it as before."""
    with pretend.run(1.0) as run:
        run.start()
        asking = pretend.hub.bus()
        for is_ended in (True, False):
            start_robot(asking, 0, ends=is_ended)
            assert (run.failed, "robot_0" in run.plan.unawaited) == (set(), is_ended)
        run.supervisor.processes["robot_0"].kill()
        assert run.supervisor.wait(lambda: "robot_0" in run.supervisor.ended, LIMIT)
        assert run.failed == {"robot_0"}


def test_a_robot_is_started_on_request(pretend: Pretend) -> None:
    """Once: a second process of its name is refused. The team does not need it, and ends it on request too."""
    with pretend.run() as run:
        run.start()
        asking = pretend.hub.bus()
        start_robot(asking, 5, "wander")
        started = run.supervisor.processes["robot_5"]
        assert started.running
        with pytest.raises(BusError, match="robot_5 has a process already"):
            start_robot(asking, 5, "wander")
        started.kill()
        assert run.supervisor.wait(lambda: "robot_5" in run.supervisor.ended, LIMIT)
        assert run.failed == set()
        start_robot(asking, 5, "wander")
        start_robot(asking, 5, ends=True)
        start_robot(asking, 5)
        assert run.supervisor.processes["robot_5"].running
        start_robot(asking, 5, ends=True)
        assert not run.supervisor.processes["robot_5"].running
        assert run.failed == set()
        with pytest.raises(BusError, match="zteam up has not started robot_6"):
            start_robot(asking, 6, ends=True)
        with pytest.raises(BusError, match="zteam up has not started robot_6"):
            start_robot(asking, 6)
    assert not any(p.running for p in run.supervisor.processes.values())
