"""Which processes command a robot or are its base, and what the monitor tells of that."""

import os
import socket

import pytest

from support.named_sessions import open_named
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.bus.graph import name_publishers
from zteam.clock import Every
from zteam.messages import LaserScan, Odometry, TFMessage, Twist
from zteam.messages.topics import has_one_writer
from zteam.monitor.observer import TeamObserver
from zteam.monitor.process import watch
from zteam.monitor.process.start_gate import Gate
from zteam.monitor.process.watch import WriterWatch
from zteam.node.process_node import ProcessNode
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
        return [tuple(event) for event in self._gate.take_events()]


@pytest.fixture
def desk(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> Desk:
    """A watch that looks, and asks all sessions, whenever it is asked to."""
    monkeypatch.setattr(watch, "LOOK", 0.0)
    made = Desk(hub)
    monkeypatch.setattr(made.watch, "_ask_all", Every(0.0))
    return made


def test_the_simulator_tells_which_processes_command(hub: MemoryHub, desk: Desk) -> None:
    """Each change is told once, with the names of the processes that have one; without an answer nothing changes."""
    simulator, status = hub.bus(), SimStatus("w", [0], 100, 1, 0, 0, 1.0)
    simulator.declare_token(names.token_key(names.SIMULATOR, simulator.instance))
    commanding = [open_named(hub, name) for name in ("robot_0", "joystick")]
    publishers = [bus.publisher("robot_0/cmd_vel", Twist) for bus in commanding]
    robot, joystick = (bus.instance for bus in commanding)
    place = f"(process {os.getpid()} on {socket.gethostname()})"
    assert desk.tell() == []
    simulator.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    status.writers = {0: [robot, "b2"]}
    text = f"has 2 publishers on cmd_vel: robot_0 {place}, session b2 (see 'zteam topic info robot_0/cmd_vel')"
    assert desk.tell() == [("writers", 0, text)]
    assert desk.tell() == []
    status.writers = {0: [robot, joystick, "c3"]}
    ((_, _, more),) = desk.tell()
    assert f"3 publishers on cmd_vel: robot_0 {place}, joystick {place}, session c3" in more
    assert len(publishers) == 2
    status.writers = {}
    assert desk.tell() == [("writers", 0, "has one publisher again on cmd_vel")]


@pytest.mark.parametrize(
    ("topic", "kind", "found", "over"),
    [
        (names.ODOM, Odometry, "has 2 publishers on odom: ", "has one publisher again on odom"),
        (names.CMD_VEL, Twist, "has 2 publishers on cmd_vel: ", "has one publisher again on cmd_vel"),
    ],
)
def test_two_publishers_are_told(
    hub: MemoryHub, desk: Desk, topic: str, kind: type[Odometry | Twist], found: str, over: str
) -> None:
    """All sessions are asked what they publish, without a simulator also of commands: two are named with host and
    process."""
    bases = [hub.bus() for _ in range(2)]
    publishers = [bus.publisher(f"robot_0/{topic}", kind) for bus in bases]
    bases[0].publisher("robot_0/tf", TFMessage), bases[1].publisher("robot_0/tf", TFMessage)
    ((event, robot_id, text),) = desk.tell()
    assert (event, robot_id) == ("writers", 0)
    assert text.startswith(found) and text.count("(process ") == 2
    assert desk.watch.notes() == [f"robot_0/{topic} has 2 publishers"]
    publishers[0].close()
    assert desk.tell() == [("writers", 0, over)]


def test_without_a_simulator_the_commands_of_any_program_are_heard(hub: MemoryHub, desk: Desk) -> None:
    """A session that declares nothing, such as a plain Zenoh program, is named beside the robot; in wall time."""
    robot, plain = open_named(hub, "robot_3"), hub.bus()
    desk.node.clock.use_wall()
    assert desk.tell() == []
    robot.publisher("robot_3/cmd_vel", Twist).put(Twist())
    publisher = plain.transport.declare_publisher("robot_3/cmd_vel", "", False)
    publisher.put(b"any")
    ((kind, robot_id, text),) = desk.tell()
    assert (kind, robot_id) == ("writers", 3)
    assert "2 publishers on cmd_vel: " in text and "robot_3 (process " in text


def test_an_answer_of_lock_step_is_no_second_command(hub: MemoryHub, desk: Desk) -> None:
    """The simulator publishes it on `cmd_vel`, beside the robot."""
    robot, simulator = (open_named(hub, name) for name in ("robot_0", names.SIMULATOR))
    for bus in (robot, simulator):
        bus.publisher("robot_0/cmd_vel", Twist)
    simulator.serve(
        names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: SimStatus("w", [0], 100, 1, 0, 0, 1.0)
    )
    simulator.declare_token(names.token_key(names.SIMULATOR, simulator.instance))
    assert desk.tell() == []


def test_a_forged_session_accuses_nobody(hub: MemoryHub) -> None:
    """The session in a time stamp is what the sender wrote: one that does not publish on the key is not named."""
    sim, tf = open_named(hub, "sim"), open_named(hub, "tf")
    publisher = sim.publisher("robot_0/base_scan", LaserScan)
    texts = name_publishers(hub.bus(), "robot_0/base_scan", [sim.instance, tf.instance, "f0"])
    assert [text.split(" (")[0] for text in texts] == ["sim", "session f0", "a sender with forged time stamps"]
    publisher.close()


def test_keys_with_one_publisher() -> None:
    """Sensors, the base, and each source of a velocity; not goals, transforms, and what belongs to no robot."""
    topics = ["base_scan", "base_scan_1", "odom", "sonar_3", "cmd_vel_teleop", "base_info"]
    others = ["robot_0/tf", "robot_0/goal_pose", "robot_0/plan", "map", "clock", "base_scan"]
    assert [key for key in (*others, *(f"robot_0/{topic}" for topic in topics)) if has_one_writer(key)] == [
        f"robot_0/{topic}" for topic in topics
    ]
