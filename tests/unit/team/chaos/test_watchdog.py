"""Robots that move on without commands are found."""

import pytest

from zteam import names
from zteam.bus.memory import MemoryHub
from zteam.messages import Clock, Odometry, TeamState, TeamStatus, Twist, Vector3, time_from_ns
from zteam.monitor.observer import TeamObserver
from zteam.team.chaos import carry_out as module
from zteam.team.chaos.carry_out import ON_ITS_WAY, Violation, Watchdog

TENTH = 10**8


class Driven:
    """A watchdog over robot 1, which moves at 0.5 m/s; time is the test's."""

    def __init__(self, hub: MemoryHub, *, lockstep: bool) -> None:
        self.watchdog, bus = Watchdog(TeamObserver(hub.bus()), lockstep=lockstep), hub.bus()
        self._clock = bus.publisher(names.CLOCK, Clock)
        self._truth = bus.publisher(names.robot_key(1, names.GROUND_TRUTH), Odometry)
        self._command = bus.publisher(names.robot_key(1, names.CMD_VEL), Twist)
        self._status = bus.publisher(names.TEAM_STATUS, TeamStatus)

    def tick(self, tenths: int, *, commanded: bool = False, speed: float = 0.5) -> None:
        """One tick of 0.1 s."""
        self._clock.put(Clock(time_from_ns(tenths * TENTH)))
        truth = Odometry()
        truth.header.stamp, truth.twist.twist = time_from_ns(tenths * TENTH), Twist(Vector3(speed))
        self._truth.put(truth)
        if commanded:
            self._command.put(Twist())

    def go(self) -> None:
        """The monitor gives GO."""
        self._status.put(TeamStatus(state=TeamState.GO))


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The host's clock, a list of one number."""
    now = [100.0]
    for each in ("zteam.monitor.observer.monotonic", f"{module.__name__}.monotonic"):
        monkeypatch.setattr(each, lambda: now[0])
    return now


def test_a_robot_may_move_for_the_time_of_its_watchdog(hub: MemoryHub, host: list[float]) -> None:
    """0.2 s and the tick that its command was under way; each truth in which it moves on after that is a violation."""
    driven = Driven(hub, lockstep=True)
    host[0] += 10.0
    for tenths in range(1, 8):
        driven.tick(tenths, commanded=tenths == 2)
    assert driven.watchdog.violations == [Violation("robot_1", 0.6, 0.4, 0.5), Violation("robot_1", 0.7, 0.5, 0.5)]


@pytest.mark.parametrize(("waited", "found"), [(0.9 * ON_ITS_WAY, 0), (1.1 * ON_ITS_WAY, 2)])
def test_in_real_time_a_command_may_be_on_its_way(hub: MemoryHub, host: list[float], waited: float, found: int) -> None:
    """As long as a command may not have reached the simulator yet, nothing is found."""
    driven = Driven(hub, lockstep=False)
    for tenths in range(1, 8):
        driven.tick(tenths, commanded=tenths == 2)
        host[0] += waited if tenths == 2 else 0.0
    assert len(driven.watchdog.violations) == found


def test_time_counts_from_go_in_all_worlds(hub: MemoryHub) -> None:
    """A reset takes nothing away; before the first tick after GO nothing is reached."""
    watchdog = (driven := Driven(hub, lockstep=True)).watchdog
    driven.tick(1)
    driven.tick(2)
    driven.go()
    assert not watchdog.reaches(0.0)
    for tenths in (3, 4, 1, 2):
        driven.tick(tenths)
    assert watchdog.elapsed == pytest.approx(0.3)
    assert watchdog.reaches(0.3 - 1e-6) and not watchdog.reaches(0.4)
