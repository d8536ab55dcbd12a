"""What others send counts for a robot from the next tick on, in whatever order it comes."""

from collections.abc import Mapping
from itertools import groupby
from random import Random
from typing import Any, NamedTuple

import numpy as np
from hypothesis import given

from support.arrivals import TICK, TICKS, Data, Opened, Sent, arrive, orders, sent_messages
from support.examples import examples
from support.lockstep_doubles import ScriptedSimulator
from support.transforms import laser_on
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.bus import MemoryHub
from zteam.messages import (
    BaseInfo,
    Done,
    Header,
    LaserScan,
    Message,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    RobotStatus,
    String,
    TFMessage,
    Twist,
    TwistStamped,
    Vector3,
    time_from_ns,
)
from zteam.node.node import Node
from zteam.node.process_options import RobotOptions
from zteam.node.shutdown import Stop
from zteam.robot.process.node import RobotNode

TOPICS = (names.CMD_VEL_TELEOP, names.CMD_VEL_NAV, names.GOAL_POSE, "orders", "/robot_7/status", "/robot_8/status")


class Listener(Behavior):
    """Drives by all that it hears, and keeps it."""

    inputs = {  # noqa: RUF012
        "goal": (names.GOAL_POSE, PoseStamped),
        "orders": ("orders", String),
        "others": ("robot_$*/status", RobotStatus),
    }

    def __init__(self, *params: Any) -> None:
        super().__init__(*params)
        self.seen: list[dict[str, Any]] = []

    def step(self, view: View) -> Twist:
        """It stands or crawls."""
        others = {robot_id: status for robot_id, status in view.inputs["others"].items() if robot_id != 0}
        self.seen.append({**view.inputs, "others": others})
        return Twist(Vector3(0.001 * len(others)))


class Outcome(NamedTuple):
    """What became of a robot."""

    answers: list[Done]
    statuses: list[RobotStatus]
    """Each one once."""
    seen: list[Mapping[str, Any]]


def message_of(sent: Sent) -> tuple[str, Message]:
    """The key and the message."""
    topic = TOPICS[sent.topic]
    header, speed = Header(time_from_ns(sent.stamp_ns)), Twist(Vector3(0.01 * sent.value))
    made: Message
    if topic == names.CMD_VEL_TELEOP:
        made = speed
    elif topic == names.CMD_VEL_NAV:
        made = TwistStamped(header, speed)
    elif topic == names.GOAL_POSE:
        made = PoseStamped(header, Pose(Point(float(sent.value))))
    elif topic == "orders":
        made = String(str(sent.value))
    else:
        made = RobotStatus(header, robot_id=int(topic[7]), text=str(sent.value))
    return names.input_key(0, topic), made


def untimely(sent: Sent) -> Sent:
    """As it is sent: a message without a header has no stamp."""
    return sent._replace(stamp="none") if TOPICS[sent.topic] in (names.CMD_VEL_TELEOP, "orders") else sent


def drive(sent: list[Sent], random: Random) -> Outcome:
    """A robot to which all this comes, and whose heart beats at any moment of the host."""
    hub = MemoryHub()
    simulator = ScriptedSimulator(hub, "robot_0")
    put = {topic: simulator.bus.publisher(names.robot_key(0, topic), kind).put for topic, kind in DATA.items()}
    node = Node("robot_0", hub.bus(), Stop())
    robot = RobotNode(node, Listener, RobotOptions(0, "Listener", gate=False, safety=False))
    simulator.appear()
    node.become_present()
    base_info = simulator.bus.publisher(names.robot_key(0, names.BASE_INFO), BaseInfo, latched=True)
    base_info.put(BaseInfo(model="cart"))
    simulator.bus.publisher(names.robot_key(0, names.TF_STATIC), TFMessage, latched=True).put(laser_on(0))
    simulator.tick(0, robots=(0,))
    statuses: list[RobotStatus] = []
    simulator.bus.subscribe(names.robot_key(0, names.STATUS), RobotStatus, lambda _, status: statuses.append(status))
    senders = [hub.bus() for _ in range(3)]
    for event in arrive(sent, random):
        if random.random() < 0.3:
            robot.status.say_again()
        if isinstance(event, Data):
            header = Header(time_from_ns(event.tick * TICK), names.BASE_LASER_LINK)
            put[names.ODOM](Odometry(header))
            put[names.BASE_SCAN](
                LaserScan(header, angle_min=-1.0, angle_increment=1.0, range_max=9.0, ranges=np.full(3, 5.0))
            )
        elif isinstance(event, Opened):
            simulator.tick(event.tick, "robot_0", robots=(0,))
        else:
            key, message = message_of(event)
            senders[event.source].publisher(key, type(message)).put(message)
    answers = [done for done in simulator.take() if done.tick]
    behavior = robot.driver.behavior
    assert isinstance(behavior, Listener)
    node.close()
    told = [status for status, _ in groupby(statuses)]
    return Outcome(answers, told, list(behavior.seen))


DATA: dict[str, type[Message]] = {names.BASE_SCAN: LaserScan, names.ODOM: Odometry}


@examples(40)
@given(sent_messages(len(TOPICS)).map(lambda found: [untimely(sent) for sent in found]), orders())
def test_the_order_of_arrival_changes_nothing(sent: list[Sent], ways: Any) -> None:
    """The same messages of three senders in two orders: the same commands, the same views, the same statuses."""
    first, second = (drive(sent, random) for random in ways)
    assert [done.tick for done in first.answers] == [*TICKS]
    assert first == second


@examples(40)
@given(sent_messages(len(TOPICS), sources=1).map(lambda found: [untimely(sent) for sent in found]), orders())
def test_it_counts_from_the_next_tick_on(sent: list[Sent], ways: Any) -> None:
    """A step sees what was last sent in the ticks before its own, and nothing of its own tick."""
    known = [s for s in sent if s.stamp != "later"]
    outcome = drive(known, ways[0])
    for tick, seen in zip(TICKS, outcome.seen, strict=True):
        for topic, name in ((names.GOAL_POSE, "goal"), ("orders", "orders")):
            due = [message_of(s)[1] for s in known if TOPICS[s.topic] == topic and s.tick < tick]
            assert seen[name] == (due[-1] if due else None), tick
