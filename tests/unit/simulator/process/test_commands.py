"""The robots' commands: which robots are waited for, and what comes from outside."""

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from support.in_process_team import InProcessTeam, TeamOptions
from support.limits import LIMIT
from support.lockstep_doubles import LONG
from zteam import names
from zteam.bus import MemoryHub
from zteam.bus.memory import HubReceiver, deliver_now
from zteam.bus.transport import RawSample
from zteam.clock import wait_until
from zteam.messages import PoseStamped, Twist, TwistStamped
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.node.tokens import RECENT, Writers
from zteam.simulator.process import commands
from zteam.simulator.process.commands import RobotCommands
from zteam.simulator.process.statistics import RunStatistics


class CommandsHarness:
    """`RobotCommands` of a world with these robots, each with a living process."""

    def __init__(self, hub: MemoryHub, *robots: int) -> None:
        self.robots = {*robots}
        self._node = ProcessNode(names.SIMULATOR, hub.bus(), Stop())
        self.statistics = RunStatistics({})
        self.commands = RobotCommands(self._node, self.robots, self.statistics, lockstep=False)
        self.publishers = {}
        self.tokens = {}
        for i in robots:
            bus = hub.bus()
            self.tokens[i] = bus.declare_token(names.token_key(names.robot_name(i), bus.instance))
            self.publishers[i] = bus.publisher(names.robot_key(i, names.CMD_VEL), Twist)

    def wait(self) -> threading.Thread:
        """Wait for the answers in a thread, with a time-out that no test reaches."""
        thread = threading.Thread(target=self.commands.wait_for_answers, args=(LONG,), daemon=True)
        thread.start()
        return thread

    def close(self) -> None:
        """End."""
        self._node.close()


@pytest.fixture
def harness(hub: MemoryHub) -> Iterator[CommandsHarness]:
    """Two robots."""
    made = CommandsHarness(hub, 0, 1)
    yield made
    made.close()


def test_it_waits_for_the_robots_that_were_sent_a_scan(
    harness: CommandsHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The wait ends with the last command."""
    waits: queue.SimpleQueue[Callable[[], bool]] = queue.SimpleQueue()

    def note(changed: threading.Condition, ready: Callable[[], bool], timeout: float) -> bool:
        waits.put(ready)
        return wait_until(changed, ready, timeout)

    monkeypatch.setattr(commands, "wait_until", note)
    for i in (0, 1):
        harness.commands.scan_sent(i)
    thread = harness.wait()
    is_over = waits.get(timeout=LIMIT)
    harness.publishers[0].put(Twist())
    assert not is_over()
    harness.publishers[1].put(Twist())
    assert is_over()
    thread.join(LIMIT)
    assert not thread.is_alive()


def test_a_robot_that_left_the_world_is_not_waited_for(harness: CommandsHarness) -> None:
    """Removed before it has answered its scan, it delays no tick, though its process lives."""
    for i in (0, 1):
        harness.commands.scan_sent(i)
    harness.robots.remove(1)
    harness.publishers[1].put(Twist())
    harness.publishers[0].put(Twist())
    for _ in range(2):
        thread = harness.wait()
        thread.join(LIMIT)
        assert not thread.is_alive()
        harness.commands.scan_sent(0)
        harness.publishers[0].put(Twist())


def test_the_last_command_of_a_robot_that_left_is_its_own(harness: CommandsHarness) -> None:
    """It may come after the end of the token: it is no command from outside."""
    harness.statistics.start(0, 0, (), np.zeros((0, 3)))
    harness.tokens[0].close()
    harness.publishers[0].put(Twist())
    assert (harness.statistics.external_commands, harness.commands.writers()) == (0, {})
    assert harness.commands.drain() == {0: Twist()}


def test_only_robots_with_a_process_are_missing(harness: CommandsHarness) -> None:
    """A robot of the world whose process lives and that sent no command is late; the others are not."""
    harness.publishers[0].put(Twist())
    taken = harness.commands.drain()
    assert harness.commands.missing(taken) == [1]
    harness.tokens[1].close()
    assert harness.commands.missing(taken) == []
    assert harness.commands.missing({}) == [0]
    harness.robots.discard(0)
    assert harness.commands.missing({}) == []


def test_what_comes_from_outside_is_counted() -> None:
    """From GO on each message counts that a process sends which takes no part, if a participant reads its key, in the
    tick that carries it; what a participant sends does not."""
    messages = {names.CMD_VEL_TELEOP: Twist(), names.CMD_VEL_NAV: TwistStamped(), names.GOAL_POSE: PoseStamped()}
    with InProcessTeam(TeamOptions(paused=True)) as team:
        outside, participant = team.hub.bus(), team.nodes["robot_0"].bus
        team.step(5)
        counts = [team.report().external_commands]
        for topic, message in messages.items():
            for bus, robot_id in ((outside, 1), (outside, 1), (outside, 9), (participant, 1)):
                bus.publisher(names.robot_key(robot_id, topic), type(message)).put(message)
            team.step(1)
            counts.append(team.report().external_commands)
    # No robot of this team takes goals.
    assert counts == [0, 2, 4, 4]


def test_late_commands_are_refused_and_counted() -> None:
    """What comes more than 0.5 s later than the robot's quickest one moves nothing, and is in the report from GO on."""
    delays = [0.0, 1.6, 0.1]

    def deliver(receivers: Sequence[HubReceiver], news: Any) -> None:
        deliver_now(receivers, replace(news, delay=delays.pop(0)) if isinstance(news, RawSample) else news)

    harness = CommandsHarness(MemoryHub(deliver), 0, 1)
    try:
        harness.statistics.start(0, 1, (0, 1), np.zeros((2, 3)))
        taken = []
        while delays:
            harness.publishers[1].put(Twist())
            taken.append([*harness.commands.drain()])
        assert taken == [[1], [], [1]]
        assert [robot.late_commands for robot in harness.statistics.robots()] == [0, 1]
        refused = harness.commands._node.bus.counters.snapshot()["robot_1/cmd_vel"]
        assert (refused.received, refused.dropped, "late: its link" in refused.last_drop_reason) == (2, 1, True)
    finally:
        harness.close()


def test_writers_are_forgotten() -> None:
    """A session counts for a while after its last command; a robot has 64 at most, and those that are known stay so."""
    writers = Writers()
    for number in range(1000):
        writers.take(0, f"{number}", 10.0)
    writers.take(1, "a", 12.0)
    writers.take(0, "0", 12.0)
    assert len(writers.recent(10.0 + RECENT)[0]) == 64
    assert writers.recent(11.0 + RECENT) == {0: {"0"}, 1: {"a"}}
    assert writers.recent(13.0 + RECENT) == {}
