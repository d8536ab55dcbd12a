"""A running team at a glance, as the launcher hears and asks it."""

from collections.abc import Callable

import numpy as np

from support.lockstep_doubles import ScriptedMonitor
from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.bus.memory import MemoryHub
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus
from zteam.monitor.observer import TeamObserver
from zteam.simulator.client import SimStatus
from zteam.team.launch.progress import TeamOverview


def serve_status(bus: Bus, status: Callable[[], SimStatus]) -> None:
    """Answer `sim/status`."""
    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status())


def put_status(bus: Bus, robot_id: int, **values: object) -> None:
    """A robot's status."""
    publisher = bus.publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)
    publisher.put(RobotStatus(robot_id=robot_id, **values))  # type: ignore[arg-type]


def test_a_robot_drives_if_it_runs_without_a_reason_to_stand(hub: MemoryHub) -> None:
    """Robots that are ready, that stand, that are lost and that are not of the team do not count."""
    watch, bus = TeamOverview(TeamObserver(hub.bus()), range(5), is_simulated=False), hub.bus()
    put_status(bus, 0, state=RobotState.READY)
    put_status(bus, 1, state=RobotState.RUNNING)
    put_status(bus, 2, state=RobotState.RUNNING, reason="obstacle 0.3 m ahead")
    put_status(bus, 3, state=RobotState.RUNNING)
    put_status(bus, 7, state=RobotState.RUNNING)
    assert (watch.look().driving, watch.look().robots) == (2, 5)
    bus.publisher(names.TEAM_STATUS, TeamStatus, latched=True).put(TeamStatus(lost=np.array([3], np.int32)))
    assert watch.look().driving == 1


def test_the_time_counts_from_go(hub: MemoryHub) -> None:
    """It is unknown before GO and without a simulator."""
    watch, voice = TeamOverview(TeamObserver(hub.bus()), [0], is_simulated=True), ScriptedMonitor(hub)
    assert (watch.look().begun, watch.look().elapsed) == (False, None)
    voice.say(TeamState.WAITING)
    assert not watch.look().begun
    voice.give_go(stamp=500_000_000)
    assert watch.look().begun
    assert watch.look().elapsed is None
    serve_status(hub.bus(), lambda: SimStatus("w", [0], 100_000_000, 1, 2_000_000_000, 20, 1.0))
    assert watch.look().elapsed == 1.5


def test_a_tick_that_is_open_at_two_looks_is_held(hub: MemoryHub) -> None:
    """Every tick waits for participants; it is held if it is still the same one at the next look, and not paused."""
    status = SimStatus("w", [0], 100_000_000, 1, 0, 5, 1.0, lockstep=True, waiting_for="robot_1")
    serve_status(hub.bus(), lambda: status)
    watch = TeamOverview(TeamObserver(hub.bus()), [0], is_simulated=True)
    assert watch.look().held_by == ""
    assert watch.look().held_by == "robot_1"
    status.paused = True
    assert watch.look().held_by == ""
    status.paused, status.tick = False, 6
    assert watch.look().held_by == ""


def test_a_team_without_a_simulator_asks_for_none(hub: MemoryHub) -> None:
    """A simulator that answers all the same is not the team's."""
    asked: list[None] = []

    def answer() -> SimStatus:
        asked.append(None)
        return SimStatus("w", [0], 1, 1, 0, 5, 1.0)

    serve_status(hub.bus(), answer)
    seen = TeamOverview(TeamObserver(hub.bus()), [0], is_simulated=False).look()
    assert (seen.simulator, seen.is_simulated, asked) == (None, False, [])
