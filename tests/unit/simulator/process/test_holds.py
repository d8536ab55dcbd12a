"""The simulator holds the bodies of robots that are stopped."""

from collections.abc import Iterator

import pytest

from support.simulator_parts import SimulatorParts
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.messages import Twist, Vector3
from zteam.node.stopping import StopReply, serve_stop
from zteam.simulator.client import SpawnRequest

AHEAD = {i: Twist(Vector3(0.5)) for i in range(3)}


@pytest.fixture
def parts(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A simulator of three robots without a main loop."""
    made = SimulatorParts(hub)
    yield made
    made.close()


def change(bus: Bus, *robots: int, service: str = names.ENGAGE) -> list[StopReply]:
    """Stop robots, or release them."""
    return [bus.ask(names.robot_key(i, service), StopReply) for i in robots]


def moved(parts: SimulatorParts, ticks: int = 5) -> list[bool]:
    """Which robots move within so many ticks in which all are commanded ahead."""
    before = [parts.engine.truth(i) for i in range(3)]
    for _ in range(ticks):
        parts.tick(AHEAD)
    return [parts.engine.truth(i) != pose for i, pose in enumerate(before)]


def test_a_body_is_held_whatever_commands_it(hub: MemoryHub, parts: SimulatorParts) -> None:
    """From the next tick on, until the release; the others drive on, and `sim/status` names it."""
    assert moved(parts) == [True, True, True]
    assert change(hub.bus(), 1) == [StopReply("sim", True)]
    assert parts.status().stopped == [1]
    parts.tick(AHEAD)
    assert moved(parts) == [True, False, True]
    assert change(hub.bus(), 1, service=names.RELEASE) == [StopReply("sim", False)]
    assert moved(parts) == [True, True, True]
    assert parts.status().stopped == []


def test_a_reset_releases_no_robot(hub: MemoryHub, parts: SimulatorParts) -> None:
    """The world begins anew, and the robots stand in it."""
    change(hub.bus(), 0, 2)
    parts.reset()
    assert moved(parts) == [False, True, False]


def test_a_robot_that_comes_is_stopped_if_all_others_are(hub: MemoryHub, parts: SimulatorParts) -> None:
    """Else one that is taken out of the world and put back is what it was."""
    place = SpawnRequest(x=3.0, y=-3.0, force=True)
    change(hub.bus(), 0, 1)
    assert parts.spawn(place) == 3
    assert parts.status().stopped == [0, 1]
    change(hub.bus(), 2, 3)
    assert parts.spawn(place) == 4
    assert parts.status().stopped == [0, 1, 2, 3, 4]
    change(hub.bus(), 0, 4, service=names.RELEASE)
    for robot_id in (0, 1):
        parts.remove(robot_id)
    assert hub.bus().query("robot_1/stop", StopReply) == []
    for robot_id in (0, 1):
        parts.spawn(SpawnRequest(x=-3.0 + robot_id, y=3.0, id=robot_id, force=True))
    assert parts.status().stopped == [1, 2, 3]
    parts.remove(0)
    change(hub.bus(), 4)
    parts.spawn(SpawnRequest(x=-3.0, y=3.0, id=0, force=True))
    assert parts.status().stopped == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("told", "stopped"),
    [
        ({}, []),
        ({0: True, 1: False}, [0]),
        ({0: True, 1: True}, [0, 1, 2]),
        ({7: True}, [0, 1, 2]),
    ],
)
def test_a_simulator_that_begins_asks_the_robots(
    hub: MemoryHub, parts: SimulatorParts, told: dict[int, bool], stopped: list[int]
) -> None:
    """A body without a process is held if all robots with one are stopped."""
    for robot_id, held in told.items():
        serve_stop(hub.bus(), robot_id, f"robot_{robot_id}", lambda held=held: held, lambda _: None)  # type: ignore[misc]
    assert [reply for _, reply in hub.bus().query("robot_2/stop", StopReply)] == [StopReply("sim", False, False)]
    parts.node.become_present()
    assert [reply for _, reply in hub.bus().query("robot_2/stop", StopReply)] == [StopReply("sim", 2 in stopped)]
    assert parts.status().stopped == stopped
    assert moved(parts) == [i not in stopped for i in range(3)]


def test_a_query_before_the_simulator_has_asked_counts_more(hub: MemoryHub, parts: SimulatorParts) -> None:
    """What a robot was told meanwhile it stays, whether it has no process or one that says otherwise."""
    serve_stop(hub.bus(), 0, "robot_0", lambda: False, lambda _: None)
    change(hub.bus(), 0, 2)
    parts.node.become_present()
    assert parts.status().stopped == [0, 2]


def test_a_body_is_held_after_its_robots_process_has_ended(hub: MemoryHub, parts: SimulatorParts) -> None:
    """Its queries are declared anew then, as linked routers may have forgotten them."""
    robot = hub.bus()
    token = robot.declare_token(names.token_key("robot_1", robot.instance))
    change(hub.bus(), 1)
    token.close()
    assert moved(parts) == [True, False, True]
    assert change(hub.bus(), 1, service=names.RELEASE) == [StopReply("sim", False)]
