"""The robot's main loop in real time, on a bus in memory: what wakes it, and what it does without."""

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import ClassVar

import numpy as np
import pytest

from zteam import names
from zteam.behaviors import Behavior, View, decide, load_behavior
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.geometry import Pose2
from zteam.messages import Clock, Header, LaserScan, Odometry, TFMessage, Twist, time_from_ns
from zteam.nodes.robot import node as module
from zteam.nodes.robot.node import RobotNode, RobotOptions
from zteam.resources import shipped_world
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop
from zteam.sim import to_messages
from zteam.world import load_world

LIMIT = 20.0
TICK = 100_000_000
NEVER = 600.0
"""Host seconds: a patience that no test lives to see the end of."""


FOLLOW = partial(load_behavior, "follow", {"leader": 0}, 1)


class Team:
    """A follower, robot 1, in a thread, and by hand what it hears."""

    def __init__(self, make_behavior: Callable[[], Behavior] = FOLLOW) -> None:
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
        self.failures: list[BaseException] = []
        self._robot = RobotNode(node, make_behavior, RobotOptions(1, gate=False))
        node.become_present()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._robot.run()
        except BaseException as error:
            self.failures.append(error)

    def _on_command(self, _key: str, _command: Twist) -> None:
        with self.changed:
            self.commands += 1
            self.changed.notify_all()

    def say_statics(self) -> None:
        """The frames that stay."""
        fixed = [
            transform
            for i, robot in self._robots.items()
            for transform in to_messages.static_transforms(i, robot, Pose2(float(i), 0.0, 0.0)).transforms
        ]
        self._publishers[names.TF_STATIC].put(TFMessage(fixed))

    def say_time(self, tick: int) -> None:
        """The clock."""
        self._publishers[names.CLOCK].put(Clock(time_from_ns(tick * TICK)))

    def say_transforms(self, tick: int) -> None:
        """A bundle."""
        found = [
            t for i in self._robots for t in to_messages.transforms(tick * TICK, i, Pose2(0.0, 0.0, 0.0)).transforms
        ]
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

    def wait_for_waiting(self) -> None:
        """Wait until it waits for transforms."""
        changed = self._robot._node.changed
        with changed:
            # The thread that begins to wait notifies no other.
            for _ in range(2000):
                if self._robot._waiting:
                    return
                changed.wait(0.01)
        raise AssertionError("it does not wait")

    def close(self) -> None:
        """End the thread."""
        self._stop.request("the test is over")
        self.join()

    def join(self) -> None:
        """Wait for the end of the main loop."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()


class Watched(Behavior):
    """Notes the times of its views, and what is done to it while it steps."""

    made = 0
    stepping = False
    overlaps = 0
    times: ClassVar[list[int]] = []
    entered: ClassVar[threading.Event]
    disturbed: ClassVar[threading.Event]

    def __init__(self, params: object) -> None:
        super().__init__(params)
        Watched.made += 1
        Watched.overlaps += Watched.stepping
        Watched.disturbed.set()

    def step(self, view: View) -> Twist:
        """Take so long that a jump in time falls into it, if it can."""
        Watched.times.append(view.now)
        Watched.stepping = True
        Watched.disturbed.clear()
        Watched.entered.set()
        Watched.disturbed.wait(0.2)
        Watched.stepping = False
        return Twist()


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> type[Watched]:
    """Fresh notes."""
    for name, value in {"made": 0, "stepping": False, "overlaps": 0, "times": []}.items():
        monkeypatch.setattr(Watched, name, value)
    for name in ("entered", "disturbed"):
        monkeypatch.setattr(Watched, name, threading.Event(), raising=False)
    return Watched


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


def test_a_behaviour_is_not_made_anew_while_it_steps(watched: type[Watched]) -> None:
    """Time that jumps back in the middle of a step is told when the step is over."""
    team = Team(lambda: watched(None))
    try:
        team.say_statics()
        team.say_time(50)
        team.say_scan(50)
        assert watched.entered.wait(LIMIT)
        team.say_time(1)
        team.say_scan(1)
        team.wait_for_commands(2)
        assert (watched.made, watched.overlaps) == (2, 0)
    finally:
        team.close()


def test_nothing_of_the_old_time_is_done_after_a_jump(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that waits for the transforms of a scan when time jumps back does not act on that scan any more."""
    times: list[int] = []

    def note(behavior: Behavior, view: View) -> tuple[Twist, str]:
        times.append(view.now // TICK)
        return decide(behavior, view)

    monkeypatch.setattr(module, "decide", note)
    monkeypatch.setattr(module, "TF_PATIENCE", NEVER)
    team = Team()
    try:
        team.say_statics()
        team.say_time(50)
        team.say_transforms(50)
        team.say_scan(50)
        team.wait_for_commands(1)
        # Its transforms do not come.
        team.say_time(51)
        team.say_scan(51)
        team.wait_for_waiting()
        team.say_time(1)
        team.say_transforms(1)
        team.say_scan(1)
        team.wait_for_commands(2)
        assert times == [50, 1]
    finally:
        team.close()


class Broken(Behavior):
    """Fails where it is told to."""

    fails_in: ClassVar[str]
    made = 0

    def __init__(self, params: object) -> None:
        super().__init__(params)
        Broken.made += 1
        if Broken.made == 2:
            self._fail("made anew")

    def _fail(self, where: str) -> None:
        if Broken.fails_in == where:
            raise ValueError(where)

    def step(self, view: View) -> Twist:
        """A velocity."""
        self._fail("step")
        return Twist()


@pytest.mark.parametrize("where", ["step", "made anew"])
def test_an_error_of_the_behaviour_ends_the_robot(monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    """It is raised in the main loop, wherever it happened."""
    monkeypatch.setattr(Broken, "made", 0)
    monkeypatch.setattr(Broken, "fails_in", where, raising=False)
    team = Team(lambda: Broken(None))
    try:
        team.say_statics()
        team.say_time(50)
        team.say_scan(50)
        if where == "made anew":
            team.wait_for_commands(1)
            team.say_time(1)
        team.join()
        assert [str(error) for error in team.failures] == [where]
    finally:
        team.close()
