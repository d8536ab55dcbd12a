"""A team of real processes for a test: own router, own namespace, everything in view, nothing left behind.

The team works in lock-step, and its world stands still but for what the test asks it to run: what a test sees depends
on nothing but the seed. Time limits named `within` are simulated seconds, so a slow machine makes a test slow and not
wrong; what has no simulated time (a process coming up) has a generous limit on the host's clock.
"""

import itertools
import os
import signal
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import LEASE
from zteam.clock import monotonic
from zteam.errors import BusError, UsageError, ZteamError
from zteam.launch.check import check_team
from zteam.launch.plan import LOCKSTEP_TIMEOUT, ROUTER, Pace, Plan, plan_team
from zteam.launch.process import exit_text, zteam_command
from zteam.launch.run import lease_for
from zteam.launch.supervisor import Supervisor
from zteam.messages import Message
from zteam.resources import shipped_team, shipped_world
from zteam.services.simulator import SimReport, SimStatus, StepRequest
from zteam.services.simulator_client import SimulatorClient
from zteam.team_file import RobotEntry, Team, read_team_file
from zteam.testing.view import RobotView, TeamView

START_LIMIT = 60.0
"""Host seconds for processes to come up: many times what a crowded machine was seen to need."""
STALL_LIMIT = 60.0
"""Host seconds without any news after which a wait gives up: simulated time stands still then."""

_SLICE = 50
"""Ticks that one question runs."""

_numbers = itertools.count(1)


class TeamTimeout(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
    """A condition did not come true in time."""


class TeamFixture:
    """What the `team` fixture gives a test."""

    def __init__(self) -> None:
        self.namespace = f"test_{os.getpid()}_{next(_numbers)}"
        """Key prefix of this team alone."""
        self.endpoint = ""
        """Where its router listens."""
        self.bus: Bus
        """A session in the team's namespace."""
        self.log: list[tuple[str, str]] = []
        """(process, line) as they came, for the report of a failed test."""
        self._supervisor = Supervisor(self._take_line, lambda _process: None)
        self._view: TeamView
        self._plan = Plan({})
        self._interval = 0
        """Simulated ns of a tick in lock-step; 0 while the team is not."""
        self._lease: float | None = None

    def _take_line(self, name: str, line: str) -> None:
        self.log.append((name, line))

    def open(self) -> None:
        """Start the router and open the test's own session."""
        router = self._supervisor.start(
            ROUTER, zteam_command("zteam-router", "--listen", "tcp/127.0.0.1:0", "--announce")
        )
        self._supervisor.wait(
            lambda: not router.running or any(line.startswith("tcp/") for line in router.lines), START_LIMIT
        )
        announced = [line for line in router.lines if line.startswith("tcp/")]
        if not announced:
            raise TeamTimeout(f"the router did not start ({exit_text(router.exit_code)}): {list(router.lines)}")
        self.endpoint = announced[0]
        self.bus = connect(BusOptions(connect=self.endpoint, namespace=self.namespace), patience=START_LIMIT)
        self._view = TeamView(self.bus, self._listen)

    def close(self) -> None:
        """Stop everything, in order."""
        try:
            for group in [*self._plan.stop_order(), sorted(self._supervisor.processes)]:
                self._supervisor.stop(group)
        finally:
            if hasattr(self, "bus"):
                self.bus.close()
            self._supervisor.close()

    @property
    def environment(self) -> dict[str, str]:
        """Environment that makes any zteam command join this team."""
        given = {} if self._lease is None else {"ZTEAM_LEASE": str(self._lease)}
        return {"ZTEAM_CONNECT": self.endpoint, "ZTEAM_NAMESPACE": self.namespace, **given}

    def launch(
        self,
        team: str | Path,
        *,
        world: str | Path | None = None,
        lockstep: bool = True,
        lockstep_timeout: float = LOCKSTEP_TIMEOUT,
    ) -> None:
        """Start a team file (or shipped team), and wait until all its processes are there; `lockstep` as in `start`."""
        path = Path(team) if Path(team).is_file() else shipped_team(str(team))
        if path is None:
            raise UsageError(f"team {str(team)!r}: no such file, nor a shipped team")
        file = read_team_file(path)
        chosen = check_team(file, _find_world(world) if world is not None else None)
        pace = Pace(lockstep=lockstep and chosen is not None, timeout=lockstep_timeout, paused=lockstep)
        self._launch(plan_team(file.team, chosen, (), team_file=path.resolve(), pace=pace), pace)

    def start(
        self,
        world: str | Path = "arena",
        robots: int | Sequence[int] = 1,
        *,
        behavior: str = "wander",
        follow: Mapping[int, int] | None = None,
        params: Mapping[int, Mapping[str, Any]] | None = None,
        seed: int = 1,
        lockstep: bool = True,
        lockstep_timeout: float = LOCKSTEP_TIMEOUT,
        expect: Sequence[str] = (),
    ) -> None:
        """Start a team in `world` and wait until all its processes are there.

        `robots` is a number or a list of ids; those in `follow` follow the robot named there, the others run
        `behavior`; `params` gives behaviour parameters by robot. With `lockstep` the world stands until `run`, `until`
        or `at` let it go on, as fast as the processes can; own nodes in `expect` take part from the first tick on; a
        process that lives and does not answer is left behind after `lockstep_timeout` host seconds. Without, it runs in
        real time.
        """
        ids = range(robots) if isinstance(robots, int) else robots
        leaders, given = follow or {}, params or {}
        entries = [
            RobotEntry(
                id=i,
                follow=leaders.get(i),
                behavior=None if i in leaders else behavior,
                params=dict(given.get(i, {})),
            )
            for i in ids
        ]
        pace = Pace(lockstep=lockstep, timeout=lockstep_timeout, expect=tuple(expect), paused=lockstep)
        self._launch(plan_team(Team(robots=entries), _find_world(world), (), seed=seed, pace=pace), pace)

    def _launch(self, plan: Plan, pace: Pace) -> None:
        self._plan = Plan({**self._plan.commands, **plan.commands})
        self._lease = lease_for(pace, LEASE) if pace.lockstep else None
        for name, command in plan.commands.items():
            self._supervisor.start(name, command, self.environment)
        self.wait_for_processes(*plan.commands)
        if names.SIMULATOR in plan.commands:
            known = self.sim_status.robots
            # From here on a test may read any robot's pose.
            if not self._wait(lambda: all(self.robot(i).truth is not None for i in known), START_LIMIT):
                raise TeamTimeout(f"the simulator shows no pose of some robot of {known}")

    def spawn(self, command: str, *arguments: str, name: str | None = None) -> str:
        """Start one command (`zteam-robot`, `zteam-sim`, `zteam`, …) in this team; the process's name.

        Nothing is waited for: see `wait_for_processes`.
        """
        chosen = name or f"{command} #{next(_numbers)}"
        self._plan.commands[chosen] = zteam_command(command, *arguments)
        self._supervisor.start(chosen, self._plan.commands[chosen], self.environment)
        return chosen

    def command(self, *arguments: str, timeout: float = START_LIMIT) -> "subprocess.CompletedProcess[str]":
        """Run `zteam ARGUMENTS` against this team and wait for its end."""
        return subprocess.run(
            zteam_command("zteam", *arguments),
            env={**os.environ, **self.environment},
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    def robot(self, robot_id: int) -> RobotView:
        """What the bus says about a robot."""
        return self._view.robot(robot_id)

    def _listen(self, key: str, kind: type[Message], arrived: Callable[[], bool]) -> None:
        """Listen to what a test asks for from now on; a world that stands still sends it again."""
        self._view.listen(key, kind)
        if self._interval and self.alive(names.SIMULATOR):
            self.sim.repeat()
            self._wait(arrived, START_LIMIT)

    @property
    def now(self) -> float:
        """Simulated seconds."""
        return self._view.now / 1e9

    @property
    def is_go(self) -> bool:
        """Whether the monitor has given GO."""
        return self._view.is_go

    @property
    def status(self) -> Any:
        """The newest TeamStatus, or None."""
        return self._view.team_status

    def alive(self, name: str) -> bool:
        """Whether a process holds this name on the bus."""
        return self._view.alive(name)

    def pid(self, name: str) -> int:
        """Process id of a process of this team."""
        return self._supervisor.processes[name].pid

    def exit_code(self, name: str) -> int | None:
        """Exit code of a process, negative for a signal, None while it runs."""
        return self._supervisor.processes[name].exit_code

    def lines(self, name: str) -> list[str]:
        """What a process has written so far."""
        return [line for process, line in self.log if process == name]

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; one that ends instead fails the test at once."""

        def ended() -> list[str]:
            known = self._supervisor.processes
            return [n for n in processes if n in known and not known[n].running]

        self._wait(lambda: bool(ended()) or all(self.alive(n) for n in processes), START_LIMIT)
        if ended():
            first = ended()[0]
            said = "\n".join(self.lines(first)[-5:])
            raise TeamTimeout(f"{first} ended ({exit_text(self.exit_code(first))}):\n{said}")
        missing = [n for n in processes if not self.alive(n)]
        if missing:
            raise TeamTimeout(f"{', '.join(missing)} did not come up within {START_LIMIT:g} s")
        if names.SIMULATOR in processes:
            status = self.sim_status
            self._interval = status.interval if status.lockstep else 0

    def wait_for_go(self) -> None:
        """Wait until the monitor has given GO; in lock-step, until it holds for everybody at the first tick."""
        if not self._wait(lambda: self.is_go, START_LIMIT):
            raise TeamTimeout("no GO: " + "; ".join(self.lines(names.MONITOR)[-3:]))
        if self._interval and not self._wait(lambda: self.report.ticks > 0, START_LIMIT):
            raise TeamTimeout(f"the first tick is held: waiting for {self.sim_status.waiting_for}")

    def wait_for_line(self, name: str, text: str) -> None:
        """Wait until a process has written a line that holds `text`."""
        if not self._supervisor.wait(lambda: any(text in line for line in self.lines(name)), START_LIMIT):
            raise TeamTimeout(f"{name} never said {text!r}; its last lines: {self.lines(name)[-3:]}")

    def wait_for_exit(self, name: str) -> int:
        """Wait until a process has ended; its exit code."""
        process = self._supervisor.processes[name]
        if not process.join(START_LIMIT):
            raise TeamTimeout(f"{name} still runs after {START_LIMIT:g} s")
        assert process.exit_code is not None
        return process.exit_code

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` by the host's clock: for what processes say or do while the world stands still."""
        if not self._wait(condition, START_LIMIT):
            raise TeamTimeout(f"not true within {START_LIMIT:g} s")

    def until(self, condition: Callable[[], bool], within: float) -> None:
        """Let the world go on until `condition()`, looked at after every tick; fail after `within` simulated seconds.

        In real time it is looked at whenever something arrives. Simulated time that stands still for STALL_LIMIT host
        seconds fails too.
        """
        end = self.now + within
        if not self._interval:
            self._watch(condition, end, within)
            return
        while not condition():
            if self.now >= end:
                raise TeamTimeout(f"not true within {within:g} simulated seconds (now {self.now:.1f} s)")
            self._step(1)

    def _watch(self, condition: Callable[[], bool], end: float, within: float) -> None:
        last, quiet_since = self.now, monotonic()
        while True:
            # Not under the view's lock: a condition may ask the bus, whose thread may need the lock to go on.
            seen = self._view.version
            if condition():
                return
            if self.now > end:
                raise TeamTimeout(f"not true within {within:g} simulated seconds (now {self.now:.1f} s)")
            if self.now != last:
                last, quiet_since = self.now, monotonic()
            elif monotonic() - quiet_since > STALL_LIMIT:
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s")
            self._view.wait_for_news(seen, 1.0)

    def run(self, seconds: float) -> None:
        """Let `seconds` of simulated time pass: in lock-step to the tick."""
        if self._interval:
            self._step(round(seconds * 1e9 / self._interval))
            return
        end = self.now + seconds
        self._watch(lambda: self.now >= end, end, seconds)

    def at(self, tick: int) -> "TeamFixture":
        """Let the world go on until it stands at `tick` (lock-step), for what is to happen exactly there."""
        if not self._interval:
            raise UsageError("at() needs lock-step: in real time no tick is waited for")
        ahead = tick - self.tick
        if ahead < 0:
            raise UsageError(f"the world is at tick {self.tick} already, beyond {tick}")
        self._step(ahead)
        return self

    @property
    def sim(self) -> SimulatorClient:
        """The simulator's queries as calls: pause, resume, speed, reset, spawn, remove, move."""
        return SimulatorClient(self.bus, START_LIMIT)

    @property
    def tick(self) -> int:
        """The tick at which the world stands."""
        return self.sim_status.tick

    @property
    def sim_status(self) -> SimStatus:
        """What the simulator says of itself: pace, participants, who holds it."""
        return self.sim.status()

    @property
    def report(self) -> SimReport:
        """The simulator's own count of the run from GO on, with `trajectory_sha256`."""
        return self.sim.report()

    def _step(self, ticks: int) -> None:
        """Let so many ticks pass, and wait until what was sent at the last one is in view."""
        while ticks > 0:
            slice_ = min(ticks, _SLICE)
            ticks -= slice_
            try:
                key = names.service_key(names.SIMULATOR, "step")
                status = self.bus.ask(key, SimStatus, StepRequest(slice_), timeout=STALL_LIMIT)
            except BusError as error:
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s: {error}") from error
            if not self._view.reaches(status.now, status.robots):
                # Nothing was lost in tens of thousands of ticks, but nothing on the bus promises that.
                self.sim.repeat()
                if not self._wait(lambda now=status.now, ids=status.robots: self._view.reaches(now, ids), START_LIMIT):  # type: ignore[misc]
                    raise TeamTimeout(f"what the simulator sent at {status.now / 1e9:.1f} s did not arrive")

    def _wait(self, condition: Callable[[], bool], limit: float) -> bool:
        deadline = monotonic() + limit
        while True:
            seen = self._view.version
            if condition():
                return True
            if monotonic() >= deadline:
                return False
            # Ends of processes are told elsewhere, so look again now and then.
            self._view.wait_for_news(seen, min(0.2, max(0.0, deadline - monotonic())))

    def kill(self, name: str) -> None:
        """End a process the hard way (SIGKILL) and wait until it is gone."""
        process = self._supervisor.processes[name]
        process.stopping = True
        process.kill()
        process.join(START_LIMIT)

    def stop(self, name: str) -> int:
        """Ask a process to stop (SIGTERM); its exit code."""
        self._supervisor.processes[name].terminate()
        return self.wait_for_exit(name)

    def pause_process(self, name: str) -> None:
        """Freeze a process (SIGSTOP)."""
        self._supervisor.processes[name].signal(signal.SIGSTOP)

    def resume_process(self, name: str) -> None:
        """Let a frozen process go on (SIGCONT)."""
        self._supervisor.processes[name].signal(signal.SIGCONT)

    def restart(self, name: str) -> None:
        """Start a process again with the same command (one that still runs is ended first); wait until it is there."""
        if self._supervisor.processes[name].running:
            self.kill(name)
        self._wait(lambda: not self.alive(name), START_LIMIT)
        self._supervisor.start(name, self._plan.commands[name], self.environment)
        self.wait_for_processes(name)
        if self._interval and (names.robot_id_of(name) is not None or name == names.AGGREGATOR):
            self._wait_for_participant(name)

    def _wait_for_participant(self, name: str) -> None:
        """Wait until a process takes part in lock-step from the next tick on."""

        def takes_part() -> bool:
            status = self.sim_status
            return name in status.joining or name in status.participants

        if not self._wait(takes_part, START_LIMIT):
            raise TeamTimeout(f"{name} does not take part in lock-step within {START_LIMIT:g} s")

    def report_log(self) -> str:
        """Everything the processes wrote, for a failed test's report."""
        return "\n".join(f"[{name}] {line}" for name, line in self.log)


def _find_world(world: str | Path) -> Path:
    path = Path(world)
    found = path.resolve() if path.is_file() else shipped_world(str(world))
    if found is None:
        raise UsageError(f"world {str(world)!r}: no such file, nor a shipped world")
    return found
