"""The start gate of a user's own node: READY, then GO, by `node.run(step, gate=True)`."""

import threading
from collections.abc import Callable

import pytest

from support.lockstep_doubles import LIMIT, HarnessFactory, ScriptedMonitor
from support.own_node import Own
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.messages import Clock, Header, Odometry, RobotState, RobotStatus, Twist, Vector3, time_from_ns
from zteam.testing import run_node

TICK = 100_000_000
ODOM = "robot_3/odom"
AHEAD = Twist(Vector3(0.5))


class Statuses:
    """What robot 3 says of itself."""

    def __init__(self, hub: MemoryHub) -> None:
        self._changed = threading.Condition()
        self.heard: list[RobotStatus] = []
        hub.bus().subscribe("robot_3/status", RobotStatus, self._take)

    def _take(self, _key: str, status: RobotStatus) -> None:
        with self._changed:
            self.heard.append(status)
            self._changed.notify_all()

    def wait_for(self, state: int, epoch: int = 0) -> RobotStatus:
        """Its newest status, when it has this state."""

        def said() -> bool:
            return bool(self.heard) and (self.heard[-1].state, self.heard[-1].epoch) == (state, epoch)

        with self._changed:
            assert wait_until(self._changed, said, LIMIT), self.heard[-1:]
            return self.heard[-1]


def make_robot(make: Callable[..., Own], name: str = "robot_3") -> Own:
    """A node that needs the odometry of robot 3, and drives ahead."""
    own = make(name, AHEAD)
    own.node.subscribe(ODOM, Odometry, lambda key, odom: None, every_tick=True)
    return own.start(gate=True)


def odometry(tick: int) -> Odometry:
    """That of a tick."""
    return Odometry(Header(time_from_ns(tick * TICK)))


def test_in_real_time_it_boots_is_ready_and_goes(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """It names the input that it waits for, then it is ready, and its step runs from the stamp of GO on."""
    statuses, bus = Statuses(hub), hub.bus()
    clock, monitor = bus.publisher(names.CLOCK, Clock), ScriptedMonitor(hub)
    own = make_robot(make)
    assert statuses.wait_for(RobotState.BOOT).text == f"waiting for {ODOM}"
    clock.put(Clock(time_from_ns(TICK)))
    bus.publisher(ODOM, Odometry).put(odometry(1))
    status = statuses.wait_for(RobotState.READY)
    assert (status.is_ready, status.driver, status.text) == (
        True,
        "none",
        "waiting for the monitor's GO (zteam-monitor)",
    )
    for tick in range(2, 5):
        clock.put(Clock(time_from_ns(tick * TICK)))
    monitor.give_go(7, 6 * TICK)
    clock.put(Clock(time_from_ns(5 * TICK)))
    assert own.steps == []
    clock.put(Clock(time_from_ns(6 * TICK)))
    own.wait_for_steps(1)
    assert own.steps == [6 * TICK]
    status = statuses.wait_for(RobotState.RUNNING, 7)
    assert (status.is_ready, status.behavior) == (True, "zteam.Node")


@pytest.mark.usefixtures("patient")
def test_in_lock_step_its_first_step_is_that_of_the_first_tick(
    hub: MemoryHub, make: Callable[..., Own], new_harness: HarnessFactory
) -> None:
    """While the first tick is held it is ready and steps not once; with GO it steps in that very tick."""
    statuses, odoms = Statuses(hub), hub.bus().publisher(ODOM, Odometry)
    own = make_robot(make)
    world = new_harness("robot_3", gate=True)
    own.wait_until_present()
    world.open(1, 3)
    world.begin()
    odoms.put(odometry(1))
    statuses.wait_for(RobotState.READY)
    assert (own.steps, world.holds) == ([], True)
    ScriptedMonitor(hub).give_go(4)
    assert world.end()
    assert own.steps == [TICK]
    assert world.lockstep.take_commands({3: None}) == {3: AHEAD}
    assert statuses.wait_for(RobotState.RUNNING, 4).driver == "behavior"


def test_a_monitor_that_comes_is_told_at_once(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """It does not wait for the next heartbeat, and it hears of the end as a stop, not as a loss."""
    statuses, bus = Statuses(hub), hub.bus()
    own = make_robot(make)
    statuses.wait_for(RobotState.BOOT)
    known = len(statuses.heard)
    bus.declare_token(names.token_key(names.MONITOR, bus.instance))
    assert len(statuses.heard) > known
    own.close()
    statuses.wait_for(RobotState.STOPPED)


def test_another_node_waits_for_go_and_says_nothing(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """A node that is no robot steps from GO on."""
    statuses, clock = Statuses(hub), hub.bus().publisher(names.CLOCK, Clock)
    own = make_robot(make, "planner")
    clock.put(Clock(time_from_ns(TICK)))
    hub.bus().publisher(ODOM, Odometry).put(odometry(1))
    own.wait_until_present()
    assert own.steps == []
    ScriptedMonitor(hub).give_go()
    own.wait_for_steps(1)
    assert statuses.heard == []


def test_a_second_process_says_nothing_under_the_name(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """A refused process sends neither a status nor a velocity: both would count for the robot that drives."""
    first = make_robot(make)
    statuses, commands = Statuses(hub), list[Twist]()
    first.wait_until_present()
    statuses.wait_for(RobotState.BOOT)
    hub.bus().subscribe("robot_3/cmd_vel", Twist, lambda _key, command: commands.append(command))
    statuses.heard.clear()
    second = make_robot(make)
    second._thread.join(LIMIT)
    assert "robot_3 is taken" in str(second.failure)
    second.close()
    assert commands == []
    assert {status.state for status in statuses.heard} <= {RobotState.BOOT}


def test_a_node_under_test_has_go(hub: MemoryHub) -> None:
    """With `run_node` the first tick carries GO."""
    with run_node(lambda node: node.run(lambda now: AHEAD, gate=True), hub, name="robot_3") as running:
        assert running.tick() == AHEAD
