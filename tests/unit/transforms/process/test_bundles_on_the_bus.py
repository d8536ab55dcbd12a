"""When the aggregator's bundles leave, on a bus in memory."""

import pytest

from support.aggregator_desk import Base, Desk, Listener, S
from support.transforms import stamped
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Clock, TFMessage, time_from_ns


@pytest.mark.usefixtures("desk")
def test_one_robots_transforms_leave_at_once(hub: MemoryHub) -> None:
    """A single robot's message is sent on in the callback that took it, its stamp unchanged."""
    listener, base = Listener(hub), Base(hub, 4)
    for tick in range(1, 4):
        base.drive(tick * S // 10 + 7)
        assert listener.bundles[-1] == [("robot_4/base_footprint", tick * S // 10 + 7)]
    assert len(listener.bundles) == 3


@pytest.mark.usefixtures("desk")
def test_a_tick_is_one_bundle(hub: MemoryHub) -> None:
    """Once the robots are known, the callback of a tick's last robot sends the bundle, in any order."""
    listener, bases = Listener(hub), [Base(hub, i) for i in range(3)]
    for base in bases:
        base.drive(1)
    for tick, order in enumerate(([0, 1, 2], [2, 0, 1], [1, 2, 0]), start=2):
        count = len(listener.bundles)
        for i in order:
            assert len(listener.bundles) == count
            bases[i].drive(tick * S)
        assert listener.bundles[count:] == [[(f"robot_{i}/base_footprint", tick * S) for i in order]]


@pytest.mark.usefixtures("desk")
def test_a_robot_ahead_pushes_the_others_out(hub: MemoryHub) -> None:
    """A bundle that waits for a robot leaves when a newer tick comes; no transform is lost or sent twice."""
    listener, bases = Listener(hub), [Base(hub, i) for i in range(2)]
    for tick in range(1, 6):
        bases[0].drive(tick * S)
        if tick % 2:
            bases[1].drive(tick * S)
    bases[0].drive(6 * S)
    bases[0].drive(7 * S)
    sent = [pair for bundle in listener.bundles for pair in bundle]
    assert len(sent) == len(set(sent))
    assert {("robot_0/base_footprint", t * S) for t in range(1, 7)} <= set(sent)
    assert {("robot_1/base_footprint", t * S) for t in (1, 3, 5)} <= set(sent)
    for bundle in listener.bundles:
        assert len({child for child, _ in bundle}) == len(bundle)


def test_a_late_bundle_leaves_by_itself(hub: MemoryHub, desk: Desk) -> None:
    """The main loop sends a bundle that waits too long for a robot; the next one does not wait for it."""
    listener, bases = Listener(hub), [Base(hub, 0), Base(hub, 1)]
    desk.start()
    bases[0].drive(S)
    bases[1].drive(S)
    listener.wait_for_bundles(2)
    bases[1].drive(2 * S)
    listener.wait_for_bundles(3)
    bases[1].drive(3 * S)
    assert listener.bundles[2:] == [[("robot_1/base_footprint", tick * S)] for tick in (2, 3)]


def test_a_rate_bundles_by_time(hub: MemoryHub) -> None:
    """With `--rate` no bundle leaves before its time; then one holds everything since the last, stamps unchanged."""
    desk, listener, bases = Desk(hub, rate=50.0), Listener(hub), [Base(hub, 0), Base(hub, 1)]
    for tick in (1, 2, 3):
        for base in bases:
            base.drive(tick * S)
    assert listener.bundles == []
    desk.start()
    listener.wait_for_bundles(1)
    desk.end()
    assert listener.bundles == [[(f"robot_{i}/base_footprint", t * S) for t in (1, 2, 3) for i in (0, 1)]]


def test_a_rate_goes_by_simulated_time(hub: MemoryHub) -> None:
    """While the simulator's time stands still no bundle leaves; the tick that completes the period sends it."""
    desk, listener, base = Desk(hub, rate=1.0), Listener(hub), Base(hub, 0)
    clock = hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(S)))
    desk.start()
    base.drive(S)
    for tenth in range(11, 20):
        clock.put(Clock(time_from_ns(tenth * S // 10)))
        base.drive(tenth * S // 10)
    assert listener.bundles == []
    # The main loop has begun to count at 1 s, or at any of these moments.
    for tenth in range(20, 31):
        clock.put(Clock(time_from_ns(tenth * S // 10)))
    listener.wait(lambda: len(listener.bundles) > 0)
    assert listener.bundles[0][0] == ("robot_0/base_footprint", S)
    desk.end()


def test_without_a_simulator_bundles_leave_at_a_rate(hub: MemoryHub) -> None:
    """Real robots have no common tick: in wall time their transforms are gathered, not sent on one by one."""
    desk, listener, bases = Desk(hub), Listener(hub), [Base(hub, 0), Base(hub, 1)]
    desk.node.clock.use_wall()
    now = desk.node.clock.now()
    for step in range(3):
        for i, base in enumerate(bases):
            base.drive(now + step * S // 50 + i)
    assert listener.bundles == []
    desk.start()
    listener.wait_for_bundles(1)
    desk.end()
    assert len(listener.bundles[0]) == 6


@pytest.mark.usefixtures("desk")
@pytest.mark.parametrize("stamp", [1, 9])
def test_a_frame_of_another_process_delays_no_bundle(hub: MemoryHub, stamp: int) -> None:
    """A frame beside a robot, of the tick before or of the future, travels with the bundle that is being filled."""
    listener, bases = Listener(hub), [Base(hub, i) for i in range(2)]
    carrot = hub.bus().publisher("robot_0/tf", TFMessage)
    for tick in (1, 2):
        for base in bases:
            base.drive(tick * S // 100)
    count = len(listener.bundles)
    bases[0].drive(3 * S // 100)
    carrot.put(TFMessage([stamped("robot_0/base_link", "robot_0/carrot", stamp * S // 100)]))
    assert len(listener.bundles) == count
    bases[1].drive(3 * S // 100)
    bundle = [("robot_0/carrot", stamp * S // 100), ("robot_0/base_footprint", 3 * S // 100)]
    assert listener.bundles[count:] == [[*bundle, ("robot_1/base_footprint", 3 * S // 100)]]
    carrot.put(TFMessage([stamped("robot_0/base_link", "robot_0/carrot", (stamp + 1) * S // 100)]))
    assert listener.bundles[-1] == [("robot_0/carrot", (stamp + 1) * S // 100)]
