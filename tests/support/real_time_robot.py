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
from zteam.bus.transport import Closeable
from zteam.clock import wait_until
from zteam.config.resources import shipped_world
from zteam.geometry import Pose2
from zteam.messages import (
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
        self.bus = self._hub.bus()
        """A session of another process."""
        self.changed = threading.Condition()
        self.commands: list[Twist] = []
        self.said: list[RobotStatus] = []
        """The statuses that it has published."""
        self._robots = dict(enumerate(load_world(str(shipped_world("arena"))).robots[:2]))
        self._latched: list[Closeable] = []
        self.bus.subscribe(names.robot_key(1, names.CMD_VEL), Twist, lambda _, twist: self._note(self.commands, twist))
        self.bus.subscribe(names.robot_key(1, names.STATUS), RobotStatus, lambda _, told: self._note(self.said, told))
        self.say_fixed(laser_on(1))
        self._stop = Stop()
        self.node = node = Node(names.robot_name(1), self._hub.bus(), self._stop)
        self.failures: list[BaseException] = []
        self._waits, self._wait = threading.Event(), node.wait
        node.wait = self._note_wait  # type: ignore[method-assign]
        self.robot = RobotNode(node, kind, RobotOptions(1, kind.__name__, params, gate=gate, safety=safety))
        node.become_present()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _note(self, found: list[Any], message: Message) -> None:
        with self.changed:
            found.append(message)
            self.changed.notify_all()

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
            self.node.drive(self.robot.beat)
        except BaseException as error:
            self.failures.append(error)

    def parameters(self) -> ParametersClient:
        """A client of the robot's parameters."""
        return ParametersClient(self.bus)

    def session(self) -> Bus:
        """A further session."""
        return self._hub.bus()

    def say(self, key: str, message: Message, *, latched: bool = False) -> None:
        """A message that other processes send."""
        publisher = self.bus.publisher(key, type(message), latched=latched)
        publisher.put(message)
        (self._latched.append if latched else Closeable.close)(publisher)

    def say_world(self, *robot_ids: int) -> None:
        """A simulator serves its status: it has these robots."""
        status = SimStatus("scripted", [*robot_ids], TICK, 1, 0, 0, 1.0)
        self.bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)

    def say_team(self, status: TeamStatus) -> None:
        """What the monitor says of the team."""
        self.say(names.TEAM_STATUS, status, latched=True)

    def say_token(self, name: str) -> None:
        """The presence token of another process."""
        bus = self._hub.bus()
        bus.declare_token(names.token_key(name, bus.instance))

    def say_statics(self) -> None:
        """The fixed frames."""
        found = [
            to_messages.static_transforms(i, robot, Pose2(float(i), 0.0, 0.0)) for i, robot in self._robots.items()
        ]
        self.say(names.TF_STATIC, TFMessage([each for one in found for each in one.transforms]), latched=True)

    def say_fixed(self, fixed: TFMessage) -> None:
        """What its base publishes of its fixed frames."""
        self.say(names.robot_key(1, names.TF_STATIC), fixed, latched=True)

    def say_base_info(self) -> None:
        """What its base is."""
        self.say(names.robot_key(1, names.BASE_INFO), base_info(self._robots[1]), latched=True)

    def say_odometry(self, tick: int) -> None:
        """Where its wheels have brought it."""
        self.say(names.robot_key(1, names.ODOM), Odometry(Header(time_from_ns(tick * TICK))))

    def say_time(self, tick: int) -> None:
        """The time."""
        self.say(names.CLOCK, Clock(time_from_ns(tick * TICK)))

    def say_transforms(self, tick: int) -> None:
        """A bundle of transforms."""
        bundles = [to_messages.transforms(time_from_ns(tick * TICK), i, Pose2(0.0, 0.0, 0.0)) for i in self._robots]
        self.say(names.TF, TFMessage([each for bundle in bundles for each in bundle.transforms]))

    def say_scan(self, tick: int, distance: float = 9.0, frame: str = names.BASE_LASER_LINK) -> None:
        """A scan with something at this distance all around."""
        scan = LaserScan(
            Header(time_from_ns(tick * TICK), frame), angle_min=-1.5, angle_max=1.5, angle_increment=0.1,
            range_max=30.0, ranges=np.full(31, distance, np.float32),
        )  # fmt: skip
        self.say(names.robot_key(1, names.BASE_SCAN), scan)

    def ready(self, tick: int) -> None:
        """All that a robot waits for at its start, with the stamp of a tick."""
        self.say_base_info()
        self.say_statics()
        self.say_transforms(tick)
        self.say_odometry(tick)
        self.say_time(tick)
        self.say_scan(tick)

    def step(self, tick: int, distance: float = 9.0, frame: str = names.BASE_LASER_LINK) -> Twist:
        """Its command for a further scan."""
        count = len(self.commands)
        self.say_time(tick)
        self.say_scan(tick, distance, frame)
        self.wait_for_commands(count + 1)
        return self.commands[-1]

    def wait_for_commands(self, count: int) -> None:
        """Wait until the robot has published so many."""
        with self.changed:
            assert wait_until(self.changed, lambda: len(self.commands) >= count, LIMIT), self.commands

    def wait_for_status(self, condition: Callable[[RobotStatus], bool]) -> RobotStatus:
        """Wait until its newest status makes this true; return that status."""
        with self.changed:
            assert wait_until(self.changed, lambda: bool(self.said) and condition(self.said[-1]), LIMIT), self.said[-1:]
            return self.said[-1]

    def wait_for_text(self, text: str) -> None:
        """Wait until the robot's status says this."""
        self.wait_for_status(lambda status: status.text == text)

    def wait_for_more_statuses(self, count: int) -> RobotStatus:
        """Wait for so many further statuses; return the last."""
        before = len(self.said)
        return self.wait_for_status(lambda _: len(self.said) > before + count)

    def wait_for_waiting(self) -> None:
        """Wait until the robot has waited for the transforms of a scan; its time for that is NEVER."""
        assert self._waits.wait(LIMIT)

    def close(self) -> None:
        """End the thread."""
        self._stop.request("the test is over")
        self.join()

    def join(self) -> None:
        """Wait for the end of the main loop."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()
