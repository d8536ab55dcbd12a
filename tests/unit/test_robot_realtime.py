"""The robot's main loop in real time, on a bus in memory: what wakes it, and what it does without."""

import threading
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pytest

from zteam import names
from zteam.behaviors import load_behavior
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.geometry import Pose2
from zteam.messages import Clock, Header, LaserScan, Odometry, TFMessage, Twist, time_from_ns
from zteam.nodes import robot as module
from zteam.nodes.node import Node
from zteam.nodes.robot import RobotNode, RobotOptions
from zteam.nodes.stopping import Stop
from zteam.shipped import shipped_world
from zteam.sim import reports
from zteam.world import load_world

LIMIT = 20.0
TICK = 100_000_000
NEVER = 600.0
"""Host seconds: a patience that no test lives to see the end of."""


class Team:
    """A follower, robot 1, in a thread, and by hand what it hears."""

    def __init__(self) -> None:
        self._hub = MemoryHub()
        self._bus = self._hub.bus()
        self.changed = threading.Condition()
        self.commands = 0
        world = load_world(str(shipped_world("arena")))
        self._robots = dict(enumerate(world.robots[:2]))
        self._publishers = {
            key: self._bus.publisher(key, kind, latched=key == names.TF_STATIC)
            for key, kind in (
                (names.CLOCK, Clock),
                (names.TF, TFMessage),
                (names.TF_STATIC, TFMessage),
                (names.robot_key(1, names.ODOM), Odometry),
                (names.robot_key(1, names.BASE_SCAN), LaserScan),
            )
        }
        self._hub.bus().subscribe(names.robot_key(1, names.CMD_VEL), Twist, self._on_command)
        self._stop = Stop()
        node = Node(names.robot_name(1), self._hub.bus(), self._stop)
        self._robot = RobotNode(node, partial(load_behavior, "follow", {"leader": 0}, 1), RobotOptions(1, gate=False))
        node.become_present()
        self._thread = threading.Thread(target=self._robot.run, daemon=True)
        self._thread.start()

    def _on_command(self, _key: str, _command: Twist) -> None:
        with self.changed:
            self.commands += 1
            self.changed.notify_all()

    def say_statics(self) -> None:
        """The frames that stay."""
        fixed = [
            transform
            for i, robot in self._robots.items()
            for transform in reports.static_transforms(i, robot, Pose2(float(i), 0.0, 0.0)).transforms
        ]
        self._publishers[names.TF_STATIC].put(TFMessage(fixed))

    def say_time(self, tick: int) -> None:
        """The clock."""
        self._publishers[names.CLOCK].put(Clock(time_from_ns(tick * TICK)))

    def say_transforms(self, tick: int) -> None:
        """A bundle."""
        found = [t for i in self._robots for t in reports.transforms(tick * TICK, i, Pose2(0.0, 0.0, 0.0)).transforms]
        self._publishers[names.TF].put(TFMessage(found))

    def say_scan(self, tick: int) -> None:
        """A scan with nothing near."""
        header = Header(time_from_ns(tick * TICK), names.robot_frame(1, names.BASE_LASER_LINK))
        scan = LaserScan(
            header, angle_min=-1.5, angle_max=1.5, angle_increment=0.1, range_max=30.0,
            ranges=np.full(31, 9.0, np.float32),
        )  # fmt: skip
        self._publishers[names.robot_key(1, names.BASE_SCAN)].put(scan)

    def wait_for_commands(self, count: int) -> None:
        """Wait until it has said so many."""
        with self.changed:
            assert wait_until(self.changed, lambda: self.commands >= count, LIMIT), self.commands

    def close(self) -> None:
        """End the thread."""
        self._stop.request("the test is over")
        self._thread.join(LIMIT)


@pytest.fixture
def team() -> Iterator[Team]:
    """A team whose follower knows where everything is."""
    made = Team()
    made.say_statics()
    made.say_time(1)
    yield made
    made.close()


def test_transforms_wake_a_robot_that_waits_for_them(team: Team, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scan without its transforms is held for them, and the command follows when they come, not only later."""
    waits = threading.Event()
    usual = Node.wait

    def wait(self: Node, ready: Callable[[], bool], timeout: float) -> bool:
        def watched() -> bool:
            found = ready()
            if timeout == NEVER and not found:
                # Under the node's lock: what is said from here on finds it waiting.
                waits.set()
            return found

        return usual(self, watched, timeout)

    monkeypatch.setattr(module, "TF_PATIENCE", NEVER)
    monkeypatch.setattr(Node, "wait", wait)
    team.say_scan(1)
    assert waits.wait(LIMIT)
    team.say_transforms(1)
    team.wait_for_commands(1)


def test_a_robot_does_without_transforms_that_stay_away(team: Team) -> None:
    """Scans alone are answered too: the wheels have to be told to stand still."""
    team.say_scan(1)
    team.say_transforms(1)
    team.wait_for_commands(1)
    for tick in range(2, 8):
        team.say_time(tick)
        team.say_scan(tick)
        team.wait_for_commands(tick)


def test_a_robot_acts_once_a_scan(team: Team) -> None:
    """Neither the clock nor a second bundle makes it act on the same scan again."""
    for tick in range(1, 6):
        team.say_scan(tick)
        team.say_transforms(tick)
        team.say_time(tick)
        team.say_transforms(tick)
        team.wait_for_commands(tick)
    assert team.commands == 5
