"""Faults as events in simulated time: which processes a tick leaves out, and which commands arrive."""

import pytest

from zteam.config.fault import Fault
from zteam.messages import Twist, Vector3
from zteam.simulator.faults import FaultPlan, is_simulated

TICK, OLDEST = 100_000_000, 200_000_000
"""Simulated ns of a tick, and of the oldest command that is obeyed."""


def plan(*faults: Fault) -> FaultPlan:
    """A plan for ticks of 0.1 s."""
    return FaultPlan(faults, TICK, OLDEST)


def twist(speed: float) -> Twist:
    """A command."""
    return Twist(Vector3(speed))


def test_a_paused_or_cut_process_is_out_of_the_ticks_of_its_fault() -> None:
    """It is out from the first tick of its time on, and back in the first one after it."""
    faults = plan(
        Fault(at=0.2, fault="pause", name="robot_1", seconds=0.2), Fault(at=0.3, fault="cut", name="nav_0", seconds=0.1)
    )
    told = [sorted(faults.absent(k * TICK)) for k in range(6)]
    assert told == [[], [], ["robot_1"], ["nav_0", "robot_1"], [], []]
    assert faults.absent(None) == frozenset(), "before GO nothing happens"


def test_a_kill_is_not_the_simulators() -> None:
    """A plan of a run has kills too, which happen to processes."""
    kill = Fault(at=0.0, fault="kill", name="robot_1")
    assert plan(kill).absent(0) == frozenset()
    assert not is_simulated(kill)


def test_commands_on_a_slow_link_arrive_later_in_their_order() -> None:
    """Each command of a slow robot arrives one tick later, those of others at once, and what is held ends with it."""
    faults = plan(Fault(at=0.1, fault="slow", name="robot_0", seconds=0.3, delay=0.1))
    got = [faults.deliver(k * TICK, {0: twist(k), 1: twist(10 + k)}) for k in range(6)]
    assert [told[1].linear.x for told in got] == [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]
    assert [told[0].linear.x if 0 in told else None for told in got] == [0.0, None, 1.0, 2.0, 4.0, 5.0]


def test_a_command_that_is_too_old_moves_nothing() -> None:
    """With a delay of 0.3 s no command arrives in time, and none comes afterwards."""
    faults = plan(Fault(at=0.0, fault="slow", name="robot_0", seconds=0.5, delay=0.3))
    assert [dict(faults.deliver(k * TICK, {0: twist(k)})) for k in range(7)] == [
        {}, {}, {}, {}, {}, {0: twist(5)}, {0: twist(6)},
    ]  # fmt: skip


def test_a_reset_forgets_the_commands_under_way() -> None:
    """What was held of the old time does not arrive in the new one."""
    faults = plan(Fault(at=0.0, fault="slow", name="robot_0", seconds=1.0, delay=0.1))
    faults.deliver(0, {0: twist(1.0)})
    faults.start_anew()
    assert faults.deliver(TICK, {}) == {}


@pytest.mark.parametrize(
    ("fault", "name", "simulated"),
    [
        ("pause", "robot_3", True), ("cut", "robot_3", True), ("slow", "robot_3", True), ("pause", "nav_0", True),
        ("slow", "nav_0", False), ("pause", "planner", True), ("pause", "tf", False), ("cut", "sim", False),
        ("pause", "router", False), ("kill", "robot_3", False),
    ],
)  # fmt: skip
def test_the_simulator_carries_out_what_the_ticks_can_go_on_without(fault: str, name: str, simulated: bool) -> None:
    """Robots, their navigation and own nodes can be left out of a tick; what every tick needs cannot."""
    made = Fault(at=0.0, fault=fault, name=name)  # type: ignore[arg-type]
    assert is_simulated(made) is simulated
