"""A team whose processes are killed one after the other, and what was commanded while a part of it was away."""

import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.clock import monotonic, pause
from zteam.config.resources import find_team
from zteam.messages import Odometry, RobotState, TeamState, Twist, Vector3, ns_from_time
from zteam.monitor.observer import TeamObserver
from zteam.node.kinds import ROUTER
from zteam.node.process_options import ViewOptions
from zteam.robot.client import StopClient
from zteam.simulator.client import SimulatorClient
from zteam.team.file.reading import read_team_file
from zteam.team.launch import supervisor as supervising
from zteam.team.launch.check import check_team
from zteam.team.launch.plan import Pace, TeamLaunch
from zteam.team.run import processes as running
from zteam.team.run.processes import ANY_PORT, Processes
from zteam.team.run.team_run import TeamRun
from zteam.team.testing.team import WARM_PARENT
from zteam.team.testing.watch import OBSERVED

pytestmark = [pytest.mark.team, pytest.mark.gate]

ROBOTS = [0, 1, 2, 3]
KILLED = (ROUTER, "robot_1", names.AGGREGATOR, names.MONITOR, names.VIEW, names.SIMULATOR)
"""The router first: then every process has seen it go and come."""
LEASE = 30.0
"""Host seconds: on a crowded machine no process looks dead that lives."""
MOVES = 0.01
"""m/s."""
TICK = 100_000_000
"""Simulated ns."""
TICKS = 10
"""In which nothing may move."""


class Line:
    """The shipped line of four robots and a view, as `zteam up line restart=on-failure --view` has them."""

    def __init__(self, run: TeamRun, lines: list[tuple[str, str]], bus: Bus) -> None:
        self.run, self.lines, self.bus = run, lines, bus
        self.seen = TeamObserver(bus, *OBSERVED)
        self.moved: dict[int, int] = {}
        """By robot: the stamp of the newest truth in which it moved."""

    def on_truth(self, key: str, truth: Odometry) -> None:
        """Take each truth: a look at the newest one may come too late."""
        target = names.split_robot_key(key)
        if target is not None and abs(truth.twist.twist.linear.x) > MOVES:
            self.moved[target[0]] = ns_from_time(truth.header.stamp)

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()`, which is looked at with every message and token."""
        deadline = monotonic() + LIMIT
        while not condition():
            assert monotonic() < deadline, "\n".join(f"[{name}] {line}" for name, line in self.lines)
            self.seen.wait_for_news(self.seen.version, 0.1)

    def speeds(self) -> list[float]:
        """m/s of each robot ahead, by the ground truth."""
        truths = [self.seen.robot(robot_id).truth for robot_id in ROBOTS]
        return [0.0 if truth is None else truth.twist.twist.linear.x for truth in truths]

    def wait_until_all_drive(self) -> None:
        """Wait until each robot has moved by a truth that comes from now on."""
        before = [self.seen.robot(robot_id).truth for robot_id in ROBOTS]
        driven: set[int] = set()

        def look() -> bool:
            for robot_id, speed in zip(ROBOTS, self.speeds(), strict=True):
                if abs(speed) > MOVES and self.seen.robot(robot_id).truth is not before[robot_id]:
                    driven.add(robot_id)
            return len(driven) == len(ROBOTS)

        self.wait_for(look)

    def wait_for_ticks(self, count: int) -> list[list[float]]:
        """Wait until so many ticks have passed; the speeds after each."""
        begin, found = self.seen.now, dict[int, list[float]]()

        def look() -> bool:
            found[self.seen.now] = self.speeds()
            return self.seen.now >= begin + count * TICK

        self.wait_for(look)
        return list(found.values())

    def kill(self, name: str) -> int:
        """Kill a process and wait until it has ended; truths of a later stamp than this returns came after the kill."""
        process = self.run.supervisor.processes[name]
        # Those of the next tick may be on their way.
        since = self.seen.now + 2 * TICK
        process.signal(signal.SIGKILL)
        self.wait_for(lambda: not process.running)
        return since

    def kill_and_wait(self, name: str) -> None:
        """Kill a process and wait until it is back; how soon is a figure of the study `recovery`."""
        progress = self.run._progress
        assert progress is not None
        self.run.supervisor.processes[name].signal(signal.SIGKILL)
        self.wait_for(lambda: name in progress.away)

    def said(self, name: str, text: str) -> list[str]:
        """The lines of a process that have this text."""
        return [line for process, line in self.lines if process == name and text in line]


@contextmanager
def started(monkeypatch: pytest.MonkeyPatch, pace: Pace) -> Iterator[Line]:
    """The line at a router of its own, with GO and all robots driving."""
    monkeypatch.setattr(running, "DEFAULT_ENDPOINT", ANY_PORT)
    file = read_team_file(find_team("line"), {"restart": "on-failure"})
    view = ViewOptions(port=0, browser=False, name=names.VIEW)
    launch = TeamLaunch(file.team, check_team(file), team_file=file.path, pace=pace, view=view)
    lines: list[tuple[str, str]] = []
    with ExitStack() as stack:
        members = Processes(BusOptions(lease=LEASE), WARM_PARENT, lambda name, line: lines.append((name, line)))
        run = stack.enter_context(TeamRun(members, launch))
        run.start()
        bus = connect(BusOptions(connect=members.endpoint, lease=LEASE))
        stack.callback(bus.close)
        line = Line(run, lines, bus)
        bus.subscribe(names.all_robots_key(names.GROUND_TRUTH), Odometry, line.on_truth)
        line.wait_until_all_drive()
        line.wait_for(lambda: bool(line.said(names.VIEW, "the view is at")))
        yield line


@pytest.mark.parametrize("pace", [pytest.param(Pace(), marks=pytest.mark.real_time), Pace(lockstep=True, speed="5")])
def test_a_team_recovers_from_the_death_of_each_of_its_processes(monkeypatch: pytest.MonkeyPatch, pace: Pace) -> None:
    """Each comes back, all robots drive again, the router's loss is said once by each process, the view stays where it
    is, and another simulator has another epoch."""
    with started(monkeypatch, pace) as line:
        others = [name for name in line.run.supervisor.processes if name != ROUTER]
        for name in KILLED:
            line.kill_and_wait(name)
            if name not in (names.MONITOR, names.VIEW):
                line.wait_until_all_drive()
            if name == ROUTER:
                line.wait_for(lambda: all(line.said(other, "router is back") for other in others))
        line.wait_for(lambda: getattr(line.seen.team_status, "epoch", 0) == 2)
        assert line.seen.team_status is not None
        assert line.seen.team_status.state == TeamState.GO
        line.wait_for(lambda: all(getattr(line.seen.robot(i).status, "epoch", 0) == 2 for i in ROBOTS))
        assert {line.seen.robot(i).status.state for i in ROBOTS} == {RobotState.RUNNING}
        assert line.run.supervisor.restarts == dict.fromkeys(KILLED, 1)
        for other in others:
            assert len(line.said(other, "router lost: waiting")) == 1
            assert len(line.said(other, "warning: router is back")) == 1
        first, again = line.said(names.VIEW, "the view is at")
        assert first == again
        assert line.run.failed == set()


@pytest.mark.parametrize("pace", [pytest.param(Pace(), marks=pytest.mark.real_time), Pace(lockstep=True, speed="5")])
def test_robots_that_are_stopped_stand_whatever_is_killed(monkeypatch: pytest.MonkeyPatch, pace: Pace) -> None:
    """While each process ends and comes back no robot moves, and in the end simulator and robots still say that all are
    stopped; released, they drive."""
    with started(monkeypatch, pace) as line:
        others, bus = [name for name in line.run.supervisor.processes if name != ROUTER], line.run.members.bus
        assert bus is not None
        client, world = StopClient(bus), SimulatorClient(bus)
        assert [result.is_done for result in client.engage()] == [True] * len(ROBOTS)
        line.wait_for(lambda: not any(line.speeds()))
        moved = dict(line.moved)
        for name in KILLED:
            before = line.seen.now
            line.kill_and_wait(name)
            if name == ROUTER:
                line.wait_for(lambda: all(line.said(other, "router is back") for other in others))
            if name == names.SIMULATOR:
                line.wait_for(lambda before=before: line.seen.now < before)  # type: ignore[misc]
            line.wait_for_ticks(TICKS)
            assert (name, line.moved, world.status().stopped) == (name, moved, ROBOTS)
        line.wait_for(lambda: all(getattr(line.seen.robot(i).status, "is_stopped", False) for i in ROBOTS))
        assert [result.is_done for result in client.release()] == [True] * len(ROBOTS)
        line.wait_until_all_drive()


@pytest.mark.real_time
def test_the_others_drive_on_while_a_process_is_away(monkeypatch: pytest.MonkeyPatch) -> None:
    """While monitor, view or the last robot is away all other robots drive on by the ground truth; when the aggregator
    ends too they drive on with the transforms that they have."""
    # None comes back.
    monkeypatch.setattr(supervising, "DELAYS", (10 * LIMIT,))
    with started(monkeypatch, Pace()) as line:
        for name, others in ((names.MONITOR, ROBOTS), (names.VIEW, ROBOTS), ("robot_3", ROBOTS[:3])):
            since = line.kill(name)
            line.wait_for(lambda since=since, others=others: all(line.moved[i] > since for i in others))  # type: ignore[misc]
        line.wait_for(lambda: all(abs(speed) > MOVES for speed in line.speeds()[:3]))
        since = line.kill(names.AGGREGATOR)
        line.wait_for(lambda: any(line.moved[i] > since for i in ROBOTS[:3]))
        assert line.run.supervisor.restarts == {}


@pytest.mark.real_time
def test_what_was_commanded_meanwhile_is_not_obeyed(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the simulator is frozen for 5 s another process commands a robot. Afterwards nothing moves as long as the
    robots themselves are frozen: time has stood still, and no tick is made up for."""
    with started(monkeypatch, Pace()) as line:
        processes, bus, seen = line.run.supervisor.processes, line.run.members.bus, line.seen
        assert bus is not None
        simulator, commands = processes[names.SIMULATOR], bus.publisher(names.robot_key(0, names.CMD_VEL), Twist)
        # How old the messages of a session are is known from an earlier one.
        commands.put(Twist())
        line.wait_for(lambda: SimulatorClient(bus).report().external_commands > 0)
        for robot_id in ROBOTS:
            processes[names.robot_name(robot_id)].signal(signal.SIGSTOP)
        simulator.signal(signal.SIGSTOP)
        line.wait_for(lambda: "T (stopped)" in Path(f"/proc/{simulator.pid}/status").read_text())
        for _ in range(40):
            commands.put(Twist(Vector3(-0.4)))
            pause(0.1)
        # After a second no command in the queue is new.
        pause(1.0)
        stamp, begin = seen.now, monotonic()
        simulator.signal(signal.SIGCONT)
        line.wait_for(lambda: seen.now > stamp)
        assert seen.now - stamp <= 2 * TICK
        speeds = line.wait_for_ticks(TICKS)
        assert monotonic() - begin > 0.05 * TICKS
        assert speeds[0][0] > -0.05, speeds
        # A robot's own last command holds for 0.2 s of this time.
        assert all(abs(speed) <= MOVES for at_once in speeds[4:] for speed in at_once), speeds
