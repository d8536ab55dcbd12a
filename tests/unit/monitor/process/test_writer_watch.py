"""Which processes command a robot, and what the monitor tells of that."""

import os
import socket

import pytest

from support.log_capture import captured_log
from support.named_sessions import open_named
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.clock import Every
from zteam.messages import Odometry, TFMessage, Twist
from zteam.monitor.observer import TeamObserver
from zteam.monitor.process import watch
from zteam.monitor.process.start_gate import Gate
from zteam.monitor.process.watch import WriterWatch
from zteam.node.process_node import ProcessNode
from zteam.node.rivals import RECENT, Writers
from zteam.node.shutdown import Stop
from zteam.simulator.client import SimStatus


class Desk:
    """A monitor's watch, and what it tells."""

    def __init__(self, hub: MemoryHub) -> None:
        self.node = ProcessNode(names.MONITOR, hub.bus(), Stop())
        self._gate = Gate(None, 1)
        self.watch = WriterWatch(self.node, self._gate, TeamObserver(self.node.bus))

    def tell(self) -> list[tuple[str, int | None, str]]:
        """What the next look tells."""
        self.watch.look()
        events = self._gate.take_events()
        return [tuple(event) for event in events]


@pytest.fixture
def desk(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> Desk:
    """A watch that looks whenever it is asked to."""
    monkeypatch.setattr(watch, "LOOK", 0.0)
    return Desk(hub)


def test_writers_are_forgotten() -> None:
    """A session counts for a while after its last command."""
    writers = Writers[int]()
    writers.take(0, "a", 10.0)
    writers.take(0, "b", 12.0)
    writers.take(1, "a", 12.0)
    assert writers.recent(10.0 + RECENT) == {0: {"a", "b"}, 1: {"a"}}
    assert writers.recent(11.0 + RECENT) == {0: {"b"}, 1: {"a"}}
    assert writers.recent(13.0 + RECENT) == {}


def test_invented_sessions_take_no_memory() -> None:
    """A robot has so many writers at most, and those that are known stay known."""
    writers = Writers[int]()
    for number in range(1000):
        writers.take(0, f"{number}", 0.0)
    writers.take(0, "0", RECENT)
    assert len(writers.recent(0.0)[0]) == 64
    assert writers.recent(RECENT + 1.0) == {0: {"0"}}


def test_the_simulator_tells_which_processes_command(hub: MemoryHub, desk: Desk) -> None:
    """Each change is told once, with the names of the processes that have one."""
    simulator, status = hub.bus(), SimStatus("w", [0], 100, 1, 0, 0, 1.0)
    simulator.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    simulator.declare_token(names.token_key(names.SIMULATOR, simulator.instance))
    commanding = [open_named(hub, name) for name in ("robot_0", "joystick")]
    publishers = [bus.publisher("robot_0/cmd_vel", Twist) for bus in commanding]
    robot, joystick = (bus.instance for bus in commanding)
    place = f"(process {os.getpid()} on {socket.gethostname()})"
    assert desk.tell() == []
    status.writers = {0: [robot, "b2"]}
    text = f"is commanded by 2 processes: robot_0 {place}, session b2 (see 'zteam topic info robot_0/cmd_vel')"
    assert desk.tell() == [("writers", 0, text)]
    assert desk.tell() == []
    status.writers = {0: [robot, joystick, "c3"]}
    ((_, _, more),) = desk.tell()
    assert f"3 processes: robot_0 {place}, joystick {place}, session c3" in more
    assert len(publishers) == 2
    status.writers = {}
    assert desk.tell() == [("writers", 0, "is commanded by one process again")]
    assert desk.tell() == []


def test_two_bases_of_a_robot_are_told(hub: MemoryHub, desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """All sessions are asked what they publish: two on a sensor's key are named with host and process, and told."""
    bases = [hub.bus() for _ in range(2)]
    publishers = [bus.publisher("robot_0/odom", Odometry) for bus in bases]
    bases[0].publisher("robot_0/tf", TFMessage), bases[1].publisher("robot_0/tf", TFMessage)
    desk.node.clock.use_wall()
    assert desk.tell() == []
    monkeypatch.setattr(desk.watch, "_ask_all", Every(0.0))
    with captured_log() as log:
        ((kind, robot_id, text),) = desk.tell()
    assert (kind, robot_id) == ("writers", 0)
    assert text.startswith("has 2 publishers on odom: ") and text.count("(process ") == 2
    assert log.count("robot_0/odom is also published by ") == 2
    assert desk.watch.notes() == ["robot_0/odom has 2 publishers"]
    publishers[0].close()
    assert desk.tell() == [("writers", 0, "has one publisher again on odom")]


def test_a_simulator_that_does_not_answer_changes_nothing(hub: MemoryHub, desk: Desk) -> None:
    """Without an answer of the simulator nothing new is told."""
    hub.bus().declare_token(names.token_key(names.SIMULATOR, "s1"))
    assert desk.tell() == []


def test_without_a_simulator_the_commands_are_heard(hub: MemoryHub, desk: Desk) -> None:
    """Without a simulator the monitor subscribes to the commands itself, in wall time and not before."""
    robot, rival = open_named(hub, "robot_3"), open_named(hub, "joystick")
    publishers = [bus.publisher("robot_3/cmd_vel", Twist) for bus in (robot, rival)]
    desk.tell()
    for publisher in publishers:
        publisher.put(Twist())
    assert desk.tell() == []
    desk.node.clock.use_wall()
    assert desk.tell() == []
    publishers[0].put(Twist())
    assert desk.tell() == []
    publishers[1].put(Twist())
    ((kind, robot_id, text),) = desk.tell()
    assert (kind, robot_id) == ("writers", 3)
    assert "2 processes: robot_3 (process " in text and ", joystick (process " in text
