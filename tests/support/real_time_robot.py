"""A robot in real time on a bus in memory: its main loop in a thread, and by hand what it hears."""

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from support.limits import LIMIT
from support.transforms import laser_on
from zteam import names
from zteam.behaviors import Behavior
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.clock import wait_until
from zteam.config.resources import shipped_world
from zteam.geometry import Pose2
from zteam.messages import (
    BaseInfo,
    Clock,
    Header,
    LaserScan,
    Message,
    Odometry,
    RobotStatus,
    TeamStatus,
    TFMessage,
    Twist,
    time_from_ns,
)
from zteam.node.node import Node
from zteam.node.process_options import RobotOptions
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.follow import Follow
from zteam.robot.client import ParametersClient
from zteam.robot.process.node import RobotNode
from zteam.simulator.client import SimStatus
from zteam.simulator.core import to_messages
from zteam.simulator.world.model import base_info
from zteam.world import load_world

TICK = 100_000_000
"""Nanoseconds."""
NEVER = 600.0
"""Host seconds: a patience that ends in no test."""


class RealTimeRobot:
    """Robot 1, by default a follower, in a thread; `say_*` publishes, and returns when that is handled."""

    def __init__(
        self, kind: type[Behavior] = Follow, *, gate: bool = False, safety: bool = True, **params: Any
    ) -> None:
        if kind is Follow:
            params.setdefault("leader", 0)
        self._hub = MemoryHub()
        self._bus = self._hub.bus()
        self.changed = threading.Condition()
        self.commands: list[Twist] = []
        self.said: list[RobotStatus] = []
        world = load_world(str(shipped_world("arena")))
        self._robots = dict(enumerate(world.robots[:2]))
        self._publishers = {
            key: self._bus.publisher(key, kind, latched=kind is BaseInfo or key == names.TF_STATIC)
            for key, kind in (
                (names.CLOCK, Clock),
                (names.TF, TFMessage),
                (names.TF_STATIC, TFMessage),
                (names.robot_key(1, names.BASE_INFO), BaseInfo),
                (names.robot_key(1, names.ODOM), Odometry),
                (names.robot_key(1, names.BASE_SCAN), LaserScan),
            )
        }
        self._hub.bus().subscribe(names.robot_key(1, names.CMD_VEL), Twist, self._on_command)
        self._hub.bus().subscribe(names.robot_key(1, names.STATUS), RobotStatus, self._on_status)
        self._fixed = self._bus.publisher(names.robot_key(1, names.TF_STATIC), TFMessage, latched=True)
        self.say_fixed(laser_on(1))
        self._team = self._bus.publisher(names.TEAM_STATUS, TeamStatus, latched=True)
        self._stop = Stop()
        self._node = node = Node(names.robot_name(1), self._hub.bus(), self._stop)
        self.failures: list[BaseException] = []
        self._waits, self._wait = threading.Event(), node.wait
        node.wait = self._note_wait  # type: ignore[method-assign]
        self.robot = RobotNode(node, kind, RobotOptions(1, kind.__name__, params, gate=gate, safety=safety))
        node.become_present()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _note_wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        def watched() -> bool:
            found = ready()
            if timeout == NEVER and not found:
                # Under the node's lock: messages from here on find it waiting.
                self._waits.set()
            return found

        return self._wait(watched, timeout)

    def _run(self) -> None:
        try:
            self._node.drive(self.robot.watch.beat)
        except BaseException as error:
            self.failures.append(error)

    def _on_command(self, _key: str, command: Twist) -> None:
        with self.changed:
            self.commands.append(command)
            self.changed.notify_all()

    def _on_status(self, _key: str, status: RobotStatus) -> None:
        with self.changed:
            self.said.append(status)
            self.changed.notify_all()

    @property
    def statuses(self) -> int:
        """How often it has published its status."""
        return len(self.said)

    @property
    def text(self) -> str:
        """Of its newest status."""
        return self.said[-1].text if self.said else ""

    def wait_for_status(self, condition: Callable[[RobotStatus], bool]) -> RobotStatus:
        """Wait until its newest status makes this true; return that status."""
        with self.changed:
            assert wait_until(self.changed, lambda: bool(self.said) and condition(self.said[-1]), LIMIT), self.said[-1:]
            return self.said[-1]

    def say_world(self, *robot_ids: int) -> None:
        """A simulator serves its status: it has these robots."""
        status = SimStatus("scripted", [*robot_ids], TICK, 1, 0, 0, 1.0)
        self._bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)

    def say_team(self, status: TeamStatus) -> None:
        """What the monitor says of the team."""
        self._team.put(status)

    def parameters(self) -> ParametersClient:
        """A client of the robot's parameters."""
        return ParametersClient(self._hub.bus())

    def session(self) -> Bus:
        """A session of another process."""
        return self._hub.bus()

    def say_monitor(self) -> None:
        """The presence token of a monitor."""
        self.say_token(names.MONITOR)

    def say_statics(self) -> None:
        """The fixed frames."""
        fixed = [
            transform
            for i, robot in self._robots.items()
            for transform in to_messages.static_transforms(i, robot, Pose2(float(i), 0.0, 0.0)).transforms
        ]
        self._publishers[names.TF_STATIC].put(TFMessage(fixed))

    def say_fixed(self, fixed: TFMessage) -> None:
        """What its base publishes of its fixed frames."""
        self._fixed.put(fixed)

    def say_base_info(self) -> None:
        """What its base is."""
        self._publishers[names.robot_key(1, names.BASE_INFO)].put(base_info(self._robots[1]))

    def say_odometry(self, tick: int) -> None:
        """Where its wheels have brought it."""
        self._publishers[names.robot_key(1, names.ODOM)].put(Odometry(Header(time_from_ns(tick * TICK))))

    def say(self, key: str, message: Message) -> None:
        """A message that other processes send."""
        self._bus.publisher(key, type(message)).put(message)

    def say_token(self, name: str) -> None:
        """The presence token of another process."""
        bus = self._hub.bus()
        bus.declare_token(names.token_key(name, bus.instance))

    def ready(self, tick: int) -> None:
        """All that a robot waits for at its start, with the stamp of a tick."""
        self.say_base_info()
        self.say_statics()
        self.say_transforms(tick)
        self.say_odometry(tick)
        self.say_time(tick)
        self.say_scan(tick)

    def say_time(self, tick: int) -> None:
        """The time."""
        self._publishers[names.CLOCK].put(Clock(time_from_ns(tick * TICK)))

    def say_transforms(self, tick: int) -> None:
        """A bundle of transforms."""
        found = [
            t for i in self._robots for t in to_messages.transforms(tick * TICK, i, Pose2(0.0, 0.0, 0.0)).transforms
        ]
        self._publishers[names.TF].put(TFMessage(found))

    def say_scan(self, tick: int, distance: float = 9.0, frame: str = names.BASE_LASER_LINK) -> None:
        """A scan with something at this distance all around."""
        header = Header(time_from_ns(tick * TICK), frame)
        scan = LaserScan(
            header, angle_min=-1.5, angle_max=1.5, angle_increment=0.1, range_max=30.0,
            ranges=np.full(31, distance, np.float32),
        )  # fmt: skip
        self._publishers[names.robot_key(1, names.BASE_SCAN)].put(scan)

    def wait_for_text(self, text: str) -> None:
        """Wait until the robot's status says this."""
        with self.changed:
            assert wait_until(self.changed, lambda: text == self.text, LIMIT), self.text

    def wait_for_commands(self, count: int) -> None:
        """Wait until the robot has published so many."""
        with self.changed:
            assert wait_until(self.changed, lambda: len(self.commands) >= count, LIMIT), self.commands

    def wait_for_waiting(self) -> None:
        """Wait until the robot has waited for the transforms of a scan; its time for that is NEVER."""
        assert self._waits.wait(LIMIT)

    def halt(self) -> None:
        """What the process does last."""
        self._node.halt()

    def close(self) -> None:
        """End the thread."""
        self._stop.request("the test is over")
        self.join()

    def join(self) -> None:
        """Wait for the end of the main loop."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()
