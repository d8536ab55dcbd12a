"""Several publishers on a key that has one."""

import pytest

from support.log_capture import captured_log
from support.named_sessions import open_named
from zteam.bus import MemoryHub
from zteam.bus.graph import tell_rivals
from zteam.messages import LaserScan
from zteam.messages.topics import has_one_writer
from zteam.node.rivals import RECENT, RivalWatch, Writers

SCAN = "robot_0/base_scan"


def test_publishers_that_take_turns_are_found() -> None:
    """Two that are heard in turn, until one of them has been silent for a while."""
    writers = Writers[str]()
    for number in range(6):
        writers.take(SCAN, "ab"[number % 2], float(number))
    writers.take("robot_0/odom", "a", 5.0)
    assert writers.rivals(5.0) == {SCAN: {"a", "b"}}
    assert writers.rivals(5.0 + RECENT) == {}


def test_a_process_that_was_started_anew_is_no_second_one() -> None:
    """The session before it is not heard again."""
    writers = Writers[str]()
    for number, session in enumerate("aaabbb"):
        writers.take(SCAN, session, 0.1 * number)
    assert writers.rivals(0.6) == {}


def test_all_terminals_say_which_processes_publish(hub: MemoryHub) -> None:
    """The receiver of the scans logs it once, and so does each of their publishers; no other process does."""
    first, second, robot, other = (open_named(hub, name) for name in ("sim", "base_0", "robot_0", "view"))
    publishers = [bus.publisher(SCAN, LaserScan) for bus in (first, second)]
    other.publisher("robot_1/base_scan", LaserScan)
    watch = RivalWatch(robot)
    robot.subscribe_from(SCAN, LaserScan, lambda key, _, source: watch.take(key, source))
    with captured_log() as log:
        for _ in range(3):
            for publisher in publishers:
                publisher.put(LaserScan())
            watch.look()
        log.wait_for(" has 2 publishers: ")
    told = sorted(line for line in log.lines)
    assert len(told) == 3, told
    assert sum(line.startswith(f"{SCAN} has 2 publishers: ") for line in told) == 1
    by = [line for line in told if line.startswith(f"{SCAN} is also published by ")]
    assert sorted(line.split(" by ")[1].split(" ")[0] for line in by) == ["base_0", "sim"]
    assert all("(process " in line for line in told)


def test_a_forged_session_accuses_nobody(hub: MemoryHub) -> None:
    """The session in a time stamp is what the sender wrote: one that does not publish on the key is not named."""
    sim, tf = open_named(hub, "sim"), open_named(hub, "tf")
    publisher = sim.publisher(SCAN, LaserScan)
    texts = tell_rivals(hub.bus(), SCAN, [sim.instance, tf.instance, "f0"])
    assert [text.split(" (")[0] for text in texts] == ["sim", "session f0", "a sender with forged time stamps"]
    publisher.close()


@pytest.mark.parametrize("topic", ["base_scan", "base_scan_1", "odom", "sonar_3", "cmd_vel_teleop", "base_info"])
def test_keys_with_one_publisher(topic: str) -> None:
    """Sensors, the base, and each source of a velocity."""
    assert has_one_writer(f"robot_0/{topic}")


@pytest.mark.parametrize("key", ["robot_0/tf", "robot_0/goal_pose", "robot_0/plan", "map", "clock", "base_scan"])
def test_keys_with_several_publishers(key: str) -> None:
    """Transforms are merged, any process sends a goal, and what belongs to no robot has rules of its own."""
    assert not has_one_writer(key)
