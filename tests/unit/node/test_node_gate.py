"""The start gate of a user's own node: READY, then GO, by `node.run(step, gate=True)`."""

import threading
from collections.abc import Callable, Iterator

import pytest

import zteam
from support.lockstep_doubles import HarnessFactory, ScriptedMonitor
from support.played_node import play
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import DuplicateNameError
from zteam.messages import Clock, Header, Odometry, RobotState, RobotStatus, Twist, Vector3, time_from_ns
from zteam.node.stopping import StopReply
from zteam.testing import run_node

TICK = 100_000_000
ODOM = "robot_3/odom"
AHEAD = Twist(Vector3(0.5))
Make = Callable[..., zteam.Node]


def listen(hub: MemoryHub) -> list[RobotStatus]:
    """What robot 3 says of itself, as it comes."""
    heard: list[RobotStatus] = []
    hub.bus().subscribe("robot_3/status", RobotStatus, lambda _, status: heard.append(status))
    return heard


class Driving:
    """A step that drives ahead."""

    def __init__(self) -> None:
        self.steps: list[int] = []

    def __call__(self, now: int) -> Twist:
        self.steps.append(now)
        return AHEAD


def make_robot(make: Make, name: str = "robot_3") -> zteam.Node:
    """A node that needs the odometry of robot 3."""
    node = make(name)
    node.subscribe(ODOM, Odometry, lambda key, odom: None, every_tick=True)
    return node


def odometry(tick: int) -> Odometry:
    """That of a tick."""
    return Odometry(Header(time_from_ns(tick * TICK)))


def test_in_real_time_it_boots_is_ready_and_goes(hub: MemoryHub, make: Make) -> None:
    """It names the input that it waits for, then it is ready, and its step runs from the stamp of GO on."""
    heard, bus, driving = listen(hub), hub.bus(), Driving()
    clock, monitor = bus.publisher(names.CLOCK, Clock), ScriptedMonitor(hub)

    def script() -> Iterator[None]:
        yield
        assert (heard[-1].state, heard[-1].text) == (RobotState.BOOT, f"waiting for {ODOM}")
        clock.put(Clock(time_from_ns(TICK)))
        bus.publisher(ODOM, Odometry).put(odometry(1))
        yield
        status = heard[-1]
        assert (status.state, status.is_ready, status.driver) == (RobotState.READY, True, "none")
        assert status.text == "waiting for the monitor's GO (zteam-monitor)"
        for tick in range(2, 5):
            clock.put(Clock(time_from_ns(tick * TICK)))
        monitor.give_go(7, 6 * TICK)
        clock.put(Clock(time_from_ns(5 * TICK)))
        yield
        assert driving.steps == []
        clock.put(Clock(time_from_ns(6 * TICK)))
        yield
        assert driving.steps == [6 * TICK]
        status = heard[-1]
        assert (status.state, status.epoch) == (RobotState.RUNNING, 7)
        assert (status.is_ready, status.behavior) == (True, "zteam.Node")

    play(make_robot(make), driving, script(), gate=True)


@pytest.mark.usefixtures("patient")
def test_in_lock_step_its_first_step_is_that_of_the_first_tick(
    hub: MemoryHub, make: Make, new_harness: HarnessFactory
) -> None:
    """While the first tick is held it is ready and steps not once; with GO it steps in that very tick."""
    heard, odoms, driving = listen(hub), hub.bus().publisher(ODOM, Odometry), Driving()

    def script() -> Iterator[None]:
        world = new_harness("robot_3", gate=True)
        world.open(1, 3)
        world.begin()
        odoms.put(odometry(1))
        yield
        assert (heard[-1].state, driving.steps) == (RobotState.READY, [])
        ScriptedMonitor(hub).give_go(4)
        assert world.end()
        assert driving.steps == [TICK]
        assert world.lockstep.take_commands({3: None}) == {3: AHEAD}
        status = heard[-1]
        assert (status.state, status.epoch, status.driver) == (RobotState.RUNNING, 4, "behavior")

    play(make_robot(make), driving, script(), gate=True)


def test_a_stopped_robot_commands_zero_whatever_its_step_returns(hub: MemoryHub, make: Make) -> None:
    """At once, and then in the place of each command; its step is still called, and its status says so."""
    heard, bus, driving = listen(hub), hub.bus(), Driving()
    commands: list[Twist] = []
    bus.subscribe("robot_3/cmd_vel", Twist, lambda _key, command: commands.append(command))
    clock = bus.publisher(names.CLOCK, Clock)

    def script() -> Iterator[None]:
        clock.put(Clock(time_from_ns(TICK)))
        bus.publisher(ODOM, Odometry).put(odometry(1))
        ScriptedMonitor(hub).give_go(1, TICK)
        yield
        assert commands == [AHEAD]
        bus.ask("robot_3/stop/engage", StopReply)
        assert commands == [AHEAD, Twist()]
        clock.put(Clock(time_from_ns(2 * TICK)))
        yield
        assert (driving.steps, commands[2:]) == ([TICK, 2 * TICK], [Twist()])
        assert (heard[-1].is_stopped, heard[-1].reason) == (True, "stopped (zteam stop --release)")
        bus.ask("robot_3/stop/release", StopReply)
        clock.put(Clock(time_from_ns(3 * TICK)))
        yield
        assert commands[3:] == [AHEAD]
        assert (heard[-1].is_stopped, heard[-1].reason) == (False, "")

    play(make_robot(make), driving, script(), gate=True)


def test_a_stop_waits_for_no_step(hub: MemoryHub, make: Make) -> None:
    """It is confirmed, and zero is commanded, while the step still works; what that returns is zero, too."""
    bus, seen = hub.bus(), list[tuple[bool, list[Twist]]]()
    commands: list[Twist] = []
    bus.subscribe("robot_3/cmd_vel", Twist, lambda _key, command: commands.append(command))

    def step(_now: int) -> Twist:
        asker = threading.Thread(target=bus.ask, args=("robot_3/stop/engage", StopReply), daemon=True)
        asker.start()
        asker.join(5.0)
        seen.append((not asker.is_alive(), list(commands)))
        return AHEAD

    def script() -> Iterator[None]:
        bus.publisher(names.CLOCK, Clock).put(Clock(time_from_ns(TICK)))
        bus.publisher(ODOM, Odometry).put(odometry(1))
        ScriptedMonitor(hub).give_go(1, TICK)
        yield
        assert (seen, commands) == ([(True, [Twist()])], [Twist(), Twist()])

    play(make_robot(make), step, script(), gate=True)


def test_a_monitor_that_comes_is_told_at_once(hub: MemoryHub, make: Make) -> None:
    """It does not wait for the next heartbeat, and it hears of the end as a stop, not as a loss."""
    heard, bus, node = listen(hub), hub.bus(), make_robot(make)

    def script() -> Iterator[None]:
        heard.clear()
        bus.declare_token(names.token_key(names.MONITOR, bus.instance))
        assert [status.state for status in heard] == [RobotState.BOOT]
        yield

    play(node, Driving(), script(), gate=True)
    node.close()
    assert heard[-1].state == RobotState.STOPPED


def test_another_node_waits_for_go_and_says_nothing(hub: MemoryHub, make: Make) -> None:
    """A node that is no robot steps from GO on."""
    heard, clock, driving = listen(hub), hub.bus().publisher(names.CLOCK, Clock), Driving()

    def script() -> Iterator[None]:
        clock.put(Clock(time_from_ns(TICK)))
        hub.bus().publisher(ODOM, Odometry).put(odometry(1))
        yield
        assert driving.steps == []
        ScriptedMonitor(hub).give_go()
        yield
        assert driving.steps == [TICK]

    play(make_robot(make, "planner"), driving, script(), gate=True)
    assert heard == []


def test_a_second_process_says_nothing_under_the_name(hub: MemoryHub, make: Make) -> None:
    """A refused process sends neither a status nor a velocity: both would count for the robot that drives."""
    heard, commands = listen(hub), list[Twist]()

    def script() -> Iterator[None]:
        hub.bus().subscribe("robot_3/cmd_vel", Twist, lambda _key, command: commands.append(command))
        heard.clear()
        second = make_robot(make)
        with pytest.raises(DuplicateNameError, match="robot_3 is taken"):
            second.run(Driving(), gate=True)
        second.close()
        assert (commands, heard) == ([], [])
        yield

    play(make_robot(make), Driving(), script(), gate=True)


def test_a_node_under_test_has_go(hub: MemoryHub) -> None:
    """With `run_node` the first tick carries GO."""
    with run_node(lambda node: node.run(lambda now: AHEAD, gate=True), hub, name="robot_3") as running:
        assert running.tick() == AHEAD
