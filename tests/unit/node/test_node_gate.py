"""The start gate of a user's own node: READY, then GO, by `node.run(step, gate=True)`; and its stop."""

import threading
from collections.abc import Callable, Iterator

import pytest

import zteam
from support.limits import LIMIT
from support.lockstep_doubles import HarnessFactory, ScriptedMonitor
from support.log_capture import captured_log
from support.played_node import play
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import DuplicateNameError
from zteam.messages import Clock, Header, Odometry, RobotState, RobotStatus, Tick, Twist, Vector3, time_from_ns
from zteam.node.stopping import StopReply
from zteam.testing import run_node

TICK = 100_000_000
ODOM = "robot_3/odom"
AHEAD = Twist(Vector3(0.5))
Make = Callable[..., zteam.Node]


class Team:
    """What else is on the bus of robot 3: its base, the clock and a monitor; and what the robot publishes."""

    def __init__(self, hub: MemoryHub) -> None:
        self.bus, self.monitor = hub.bus(), ScriptedMonitor(hub)
        self._clock, self._odom = self.bus.publisher(names.CLOCK, Clock), self.bus.publisher(ODOM, Odometry)
        self.statuses: list[RobotStatus] = []
        self.commands: list[Twist] = []
        self.steps: list[int] = []
        self.bus.subscribe("robot_3/status", RobotStatus, lambda _, status: self.statuses.append(status))
        self.bus.subscribe("robot_3/cmd_vel", Twist, lambda _, command: self.commands.append(command))

    def pass_to(self, tick: int) -> None:
        """The world is at this tick."""
        self._clock.put(Clock(time_from_ns(tick * TICK)))

    def observe(self, tick: int) -> None:
        """The base sends its odometry of a tick."""
        self._odom.put(Odometry(Header(time_from_ns(tick * TICK))))

    def step(self, now: int) -> Twist:
        """A step that drives ahead."""
        self.steps.append(now)
        return AHEAD


@pytest.fixture
def team(hub: MemoryHub) -> Team:
    """Of robot 3."""
    return Team(hub)


def make_robot(make: Make, name: str = "robot_3") -> zteam.Node:
    """A node that needs the odometry of robot 3."""
    node = make(name)
    node.subscribe(ODOM, Odometry, lambda key, odom: None, every_tick=True)
    return node


@pytest.mark.parametrize("name", ["robot_3", "planner"])
def test_in_real_time_it_boots_is_ready_and_goes(team: Team, make: Make, name: str) -> None:
    """It names the input that it waits for, then it is ready, and its step runs from the stamp of GO on. A node that is
    no robot says nothing."""
    is_robot = name == "robot_3"

    def said(status: RobotStatus) -> tuple[int, str]:
        assert (status.is_ready, status.driver) == (status.state == RobotState.READY, "none")
        return status.state, status.text

    def script() -> Iterator[None]:
        yield
        assert [said(status) for status in team.statuses[-1:]] == [(RobotState.BOOT, f"waiting for {ODOM}")] * is_robot
        team.pass_to(1)
        team.observe(1)
        yield
        ready = (RobotState.READY, "waiting for the monitor's GO (zteam-monitor)")
        assert [said(status) for status in team.statuses[-1:]] == [ready] * is_robot
        team.monitor.give_go(7, 6 * TICK)
        team.pass_to(5)
        yield
        assert team.steps == []
        team.pass_to(6)
        yield
        assert team.steps == [6 * TICK]
        if is_robot:
            status = team.statuses[-1]
            assert (status.state, status.epoch, status.is_ready) == (RobotState.RUNNING, 7, True)
            assert status.behavior == "zteam.Node"

    play(make_robot(make, name), team.step, script(), gate=True)
    assert bool(team.statuses) == is_robot


LACKS, IS_READY = f"boot: waiting for {ODOM}", "ready: waiting for the monitor's GO (zteam-monitor)"


@pytest.mark.parametrize(
    ("in_team", "is_late", "told"),
    [(False, False, [LACKS, IS_READY]), (True, False, []), (True, True, [LACKS])],
    ids=["by hand", "in a team", "later"],
)
def test_a_robot_of_a_team_leaves_to_the_monitor_what_it_waits_for(
    team: Team, make: Make, in_team: bool, is_late: bool, told: list[str]
) -> None:
    """And GO; one that comes later logs what it lacks. A process started by hand logs all that, and the way out."""

    def script() -> Iterator[None]:
        if is_late:
            team.monitor.give_go(7, 9 * TICK)
        team.pass_to(1)
        yield
        team.observe(1)
        yield
        team.monitor.give_go(8)
        team.pass_to(2)
        yield

    node = make_robot(make)
    node.in_team = in_team
    with captured_log() as log:
        play(node, team.step, script(), gate=True)
    assert [line for line in log.lines if "waiting for" in line][1:] == told
    assert (len(team.steps), log.count("GO: driving")) == (1, not in_team)


@pytest.mark.usefixtures("patient")
def test_in_lock_step_its_first_step_is_that_of_the_first_tick(
    team: Team, make: Make, new_harness: HarnessFactory
) -> None:
    """While the first tick is held it is ready and steps not once; with GO it steps in that very tick."""

    def script() -> Iterator[None]:
        world = new_harness("robot_3", gate=True, bus=team.bus)
        world.open(1, 3)
        world.begin()
        team.observe(1)
        yield
        assert (team.statuses[-1].state, team.steps) == (RobotState.READY, [])
        team.monitor.give_go(4)
        assert world.end()
        assert team.steps == [TICK]
        assert world.lockstep.tick.commands({3: None}) == {3: AHEAD}
        status = team.statuses[-1]
        assert (status.state, status.epoch, status.driver) == (RobotState.RUNNING, 4, "behavior")

    play(make_robot(make), team.step, script(), gate=True)


def test_a_stopped_robot_commands_zero_whatever_its_step_returns(team: Team, make: Make) -> None:
    """At once, and then in the place of each command; its step is still called, and its status says so."""

    def script() -> Iterator[None]:
        team.pass_to(1)
        team.observe(1)
        team.monitor.give_go(1, TICK)
        yield
        assert team.commands == [AHEAD]
        team.bus.ask("robot_3/stop/engage", StopReply)
        assert team.commands == [AHEAD, Twist()]
        team.pass_to(2)
        yield
        assert (team.steps, team.commands[2:]) == ([TICK, 2 * TICK], [Twist()])
        assert (team.statuses[-1].is_stopped, team.statuses[-1].reason) == (True, "stopped (zteam stop --release)")
        team.bus.ask("robot_3/stop/release", StopReply)
        team.pass_to(3)
        yield
        assert team.commands[3:] == [AHEAD]
        assert (team.statuses[-1].is_stopped, team.statuses[-1].reason) == (False, "")

    play(make_robot(make), team.step, script(), gate=True)


def test_a_stop_waits_for_no_step(team: Team, make: Make) -> None:
    """It is confirmed, and zero is commanded, while the step still works; what that returns is zero, too."""
    seen = list[tuple[bool, list[Twist]]]()

    def step(_now: int) -> Twist:
        asker = threading.Thread(target=team.bus.ask, args=("robot_3/stop/engage", StopReply), daemon=True)
        asker.start()
        asker.join(5.0)
        seen.append((not asker.is_alive(), list(team.commands)))
        return AHEAD

    def script() -> Iterator[None]:
        team.pass_to(1)
        team.observe(1)
        team.monitor.give_go(1, TICK)
        yield
        assert (seen, team.commands) == ([(True, [Twist()])], [Twist(), Twist()])

    play(make_robot(make), step, script(), gate=True)


def test_only_the_holder_of_the_name_speaks(team: Team, make: Make) -> None:
    """A monitor that comes is told at once, not with the next heartbeat. A second process is refused, and sends neither
    a status nor a velocity: both would count for the robot that drives. The end is told as a stop, not as a loss."""
    node = make_robot(make)

    def script() -> Iterator[None]:
        team.statuses.clear()
        team.bus.declare_token(names.token_key(names.MONITOR, team.bus.instance))
        assert [status.state for status in team.statuses] == [RobotState.BOOT]
        second = make_robot(make)
        with pytest.raises(DuplicateNameError):
            second.run(team.step, gate=True)
        second.close()
        assert (team.commands, len(team.statuses)) == ([], 1)
        yield

    play(node, team.step, script(), gate=True)
    node.close()
    assert team.statuses[-1].state == RobotState.STOPPED


def test_a_node_under_test_has_go(hub: MemoryHub) -> None:
    """With `run_node` the first tick carries GO. What `step` returns is no command without a robot's name."""
    for name, command in (("robot_3", AHEAD), ("planner", None)):
        with run_node(lambda node: node.run(lambda now: AHEAD, gate=True), hub, name=name, robots=(3,)) as running:
            assert running.tick() == command


def test_a_tick_that_comes_while_a_node_under_test_is_busy_is_answered(hub: MemoryHub) -> None:
    """`tick` waits for the step, which the node's own thread takes after what it does just now."""
    busy, sent = threading.Event(), threading.Event()
    with run_node(lambda node: node.run(lambda now: AHEAD), hub, name="robot_3", robots=(3,)) as running:
        hub.bus().subscribe(names.TICK, Tick, lambda *_: sent.set())
        look = threading.Thread(
            target=running.node.take_step, args=(lambda: True, lambda _: busy.set() or sent.wait(LIMIT))
        )
        look.start()
        assert busy.wait(LIMIT)
        assert running.tick() == AHEAD
        look.join(LIMIT)
