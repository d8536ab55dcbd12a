"""A robot's first tick of lock-step: what it waits for."""

from collections.abc import Iterator, Mapping
from typing import ClassVar

import pytest

from support.lockstep_doubles import INTERVAL, ScriptedSimulator
from support.transforms import laser_on, stamped
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.bus import MemoryHub
from zteam.messages import BaseInfo, Header, LaserScan, Message, Odometry, RobotStatus, TFMessage, Twist, time_from_ns
from zteam.node.node import Node
from zteam.node.process_options import RobotOptions
from zteam.node.shutdown import Stop
from zteam.robot.process.node import RobotNode


class Seen(Behavior):
    """Notes the models of the bases that it sees, and whose bases and statuses."""

    models: ClassVar[list[str]]
    told: ClassVar[list[list[int]]]
    bases: ClassVar[list[list[int]]]
    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = {
        "statuses": (names.all_robots_key(names.STATUS), RobotStatus)
    }

    def step(self, view: View) -> Twist:
        """Stand."""
        self.models.append(view.base.model)
        self.told.append(sorted(view.inputs["statuses"]))
        self.bases.append([*view.bases])
        return Twist()


@pytest.fixture
def simulator(hub: MemoryHub) -> ScriptedSimulator:
    """A simulator in lock-step."""
    return ScriptedSimulator(hub, "robot_0")


@pytest.fixture
def robot(hub: MemoryHub, simulator: ScriptedSimulator, monkeypatch: pytest.MonkeyPatch) -> Iterator[RobotNode]:
    """Robot 0, which takes part in tick 2. That is open."""
    monkeypatch.setattr(Seen, "models", [], raising=False)
    monkeypatch.setattr(Seen, "told", [], raising=False)
    monkeypatch.setattr(Seen, "bases", [], raising=False)
    put(hub, names.TF_STATIC, laser_on(0), latched=True)
    node = Node("robot_0", hub.bus(), Stop())
    made = RobotNode(node, Seen, RobotOptions(0, "Seen", gate=False))
    simulator.appear()
    node.become_present()
    simulator.tick(1, robots=(0,))
    simulator.tick(2, "robot_0", robots=(0,))
    simulator.take()
    yield made
    node.close()


def test_it_waits_for_the_base_also_where_that_comes_last(
    hub: MemoryHub, simulator: ScriptedSimulator, robot: RobotNode
) -> None:
    """With scan and odometry there the robot does not answer; with `base_info` it does, and the behaviour sees it. A
    heartbeat of the host then sends the last status again, and says nothing new."""
    heard: list[RobotStatus] = []
    hub.bus().subscribe(names.robot_key(0, names.STATUS), RobotStatus, lambda _key, status: heard.append(status))
    put_inputs(hub, 2)
    assert (simulator.take(), Seen.models) == ([], [])
    put(hub, names.BASE_INFO, BaseInfo(model="cart"), latched=True)
    assert [done.tick for done in simulator.take()] == [2]
    assert Seen.models == ["cart"]
    count = len(heard)
    robot.status.say_again()
    assert heard[count:] == [heard[count - 1]]


def put(hub: MemoryHub, topic: str, message: Message, *, robot: int = 0, latched: bool = False) -> None:
    """Publish for a robot."""
    hub.bus().publisher(names.robot_key(robot, topic), type(message), latched=latched).put(message)


def put_inputs(hub: MemoryHub, tick: int) -> None:
    """Scan and odometry of a tick."""
    header = Header(time_from_ns(tick * INTERVAL), names.BASE_LASER_LINK)
    put(hub, names.BASE_SCAN, LaserScan(header, angle_min=-1.0, angle_increment=1.0, range_max=9.0, ranges=[5.0] * 3))
    put(hub, names.ODOM, Odometry(header))


def test_a_robot_that_joins_and_those_that_are_there_know_each_other_from_the_next_tick_on(
    hub: MemoryHub, simulator: ScriptedSimulator, robot: RobotNode
) -> None:
    """What a robot has heard before it joins does not count: chance says what that is. Each robot tells its status in
    the tick in which others have joined or gone, so a heartbeat of the host's time decides nothing. The base of a robot
    that is not in the tick's world does not count, whenever it comes, and neither does its status: any program can
    invent robots.
    """
    heard: list[RobotStatus] = []
    hub.bus().subscribe(names.robot_key(0, names.STATUS), RobotStatus, lambda _key, status: heard.append(status))
    put(hub, names.BASE_INFO, BaseInfo(), latched=True)
    for robot_id in (7, 8):
        put(hub, names.BASE_INFO, BaseInfo(), robot=robot_id, latched=True)
        put(hub, names.STATUS, RobotStatus(robot_id=robot_id), robot=robot_id)
    told = []
    for tick, team in enumerate((["robot_0"], ["robot_0"], ["robot_0", "robot_1"], ["robot_0", "robot_1"]), 2):
        simulator.tick(tick, *team, robots=(0, 7))
        before = len(heard)
        put_inputs(hub, tick)
        told.append(len(heard) > before)
    assert [7 in robots for robots in Seen.told] == [False, True, True, True]
    assert told == [True, False, True, False]
    assert not any(8 in robots for robots in Seen.told)
    assert Seen.bases == [[0, 7]] * 4


def test_what_comes_late_of_an_ended_time_has_no_part_in_the_new_one(
    hub: MemoryHub, simulator: ScriptedSimulator, robot: RobotNode
) -> None:
    """A robot that has not heard of a reset may repeat its last status, and the aggregator its last bundle. Such a
    status does not hold back those of the new time, and such a bundle is not the one that a step waits for."""
    for robot_id in (0, 7):
        put(hub, names.BASE_INFO, BaseInfo(), robot=robot_id, latched=True)
    put_inputs(hub, 2)
    simulator.tick(9, "robot_0", "tf", robots=(0, 7))
    put_bundle(hub, 9)
    put_inputs(hub, 9)
    assert [done.tick for done in simulator.take()] == [2, 9]
    simulator.tick(1, "robot_0", "tf", robots=(0, 7))
    put_bundle(hub, 9)
    put_status(hub, 9)
    put_inputs(hub, 1)
    assert simulator.take() == []
    put_bundle(hub, 1)
    put_status(hub, 1)
    assert [done.tick for done in simulator.take()] == [1]
    Seen.told.clear()
    simulator.tick(2, "robot_0", robots=(0, 7))
    put_inputs(hub, 2)
    assert [7 in robots for robots in Seen.told] == [True]


def put_bundle(hub: MemoryHub, tick: int) -> None:
    """The bundle of a tick."""
    base = stamped("robot_0/odom", "robot_0/base_footprint", tick * INTERVAL)
    hub.bus().publisher(names.TF, TFMessage).put(TFMessage([base]))


def put_status(hub: MemoryHub, tick: int) -> None:
    """The status of robot 7, of a tick."""
    put(hub, names.STATUS, RobotStatus(Header(time_from_ns(tick * INTERVAL)), robot_id=7), robot=7)
