"""A robot's first tick of lock-step: what it waits for."""

from collections.abc import Iterator
from typing import ClassVar

import pytest

from support.lockstep_doubles import INTERVAL, ScriptedSimulator
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.bus import MemoryHub
from zteam.messages import BaseInfo, Header, LaserScan, Message, Odometry, Twist, time_from_ns
from zteam.nodes.robot.node import RobotNode, RobotOptions
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop


class Seen(Behavior):
    """Notes the models of the bases that it sees."""

    models: ClassVar[list[str]] = []

    def step(self, view: View) -> Twist:
        """Stand."""
        self.models.append(view.base.model)
        return Twist()


@pytest.fixture
def simulator(hub: MemoryHub) -> ScriptedSimulator:
    """A simulator in lock-step."""
    return ScriptedSimulator(hub, "robot_0")


@pytest.fixture
def models(hub: MemoryHub, simulator: ScriptedSimulator) -> Iterator[list[str]]:
    """What the behaviour of robot 0 saw. The robot takes part in tick 2, which is open."""
    Seen.models.clear()
    node = Node("robot_0", hub.bus(), Stop())
    RobotNode(node, Seen, RobotOptions(0, "Seen", gate=False))
    simulator.appear()
    node.become_present()
    simulator.tick(1, robots=(0,))
    simulator.tick(2, "robot_0", robots=(0,))
    simulator.take()
    yield Seen.models
    node.close()


def test_it_waits_for_the_base_also_where_that_comes_last(
    hub: MemoryHub, simulator: ScriptedSimulator, models: list[str]
) -> None:
    """With scan and odometry there the robot does not answer; with `base_info` it does, and the behaviour sees it."""

    def put(topic: str, message: Message, *, latched: bool = False) -> None:
        hub.bus().publisher(names.robot_key(0, topic), type(message), latched=latched).put(message)

    header = Header(time_from_ns(2 * INTERVAL))
    put(names.BASE_SCAN, LaserScan(header, angle_min=-1.0, angle_increment=1.0, range_max=9.0, ranges=[5.0] * 3))
    put(names.ODOM, Odometry(header))
    assert (simulator.take(), models) == ([], [])
    put(names.BASE_INFO, BaseInfo(model="cart"), latched=True)
    assert [done.tick for done in simulator.take()] == [2]
    assert models == ["cart"]
