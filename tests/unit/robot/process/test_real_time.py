"""The robot's main loop in real time: what wakes it, what it drives by, jumps of time, parameters, and errors."""

import threading
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import msgspec
import pytest

from support.limits import LIMIT
from support.real_time_robot import NEVER, TICK, RealTimeRobot
from support.transforms import stamped
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.bus.lateness import Lateness
from zteam.errors import UsageError
from zteam.messages import (
    Header,
    Pose,
    PoseStamped,
    RobotDriver,
    RobotState,
    RobotStatus,
    String,
    TeamState,
    TeamStatus,
    TFMessage,
    Twist,
    TwistStamped,
    Vector3,
    time_from_ns,
)
from zteam.robot.client import SET
from zteam.robot.process import inputs
from zteam.robot.process import node as robot_module
from zteam.robot.process.inputs import SOURCES

Start = Callable[..., RealTimeRobot]
GO = TeamStatus(state=TeamState.GO, epoch=1, go_stamp=time_from_ns(2 * TICK))


class CruiseParams(msgspec.Struct):
    """Of `Cruise`; unknown fields are not forbidden."""

    speed: Annotated[float, msgspec.Meta(ge=0.0, le=1.0, description="m/s")] = 0.1
    turn: float = 0.0


class Cruise(Behavior):
    """Drives at its speed, and turns by its speed at the end of a step. A step may wait, and fail."""

    Params = CruiseParams
    inputs = {  # noqa: RUF012
        "goal": ("goal_pose", PoseStamped),
        "others": ("robot_$*/status", RobotStatus),
        "of_robot_0": ("robot_0/orders", String),
        "all": ("/orders", String),
    }
    made: list["Cruise"]
    entered: threading.Event
    gate: threading.Event
    fails_in = ""

    def __init__(self, params: CruiseParams) -> None:
        super().__init__(params)
        self.views: list[View] = []
        self.changes, self.steps_under_way = 0, 0
        if self.made and self.fails_in == "made anew":
            raise ValueError(self.fails_in)
        assert not any(other.steps_under_way for other in self.made)
        self.made.append(self)

    def on_params(self) -> None:
        self.changes += 1

    def step(self, view: View) -> Twist:
        """The speed of both reads differs only if the parameters change within the step."""
        self.views.append(view)
        before, self.steps_under_way = self.params.speed, 1
        if self.fails_in == "step":
            raise ValueError(self.fails_in)
        self.entered.set()
        assert self.gate.wait(LIMIT)
        self.steps_under_way = 0
        return Twist(Vector3(before), Vector3(z=self.params.speed))


@pytest.fixture
def cruise(monkeypatch: pytest.MonkeyPatch) -> Iterator[type[Cruise]]:
    """The behaviour, whose steps run through."""
    for name, value in {"made": [], "entered": threading.Event(), "gate": threading.Event()}.items():
        monkeypatch.setattr(Cruise, name, value, raising=False)
    Cruise.gate.set()
    yield Cruise
    Cruise.gate.set()


def test_a_scan_waits_for_its_transforms(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    """A follower's command follows as soon as they come; without them it acts all the same, to stop; once a scan."""
    robot = start()
    robot.say_statics()
    robot.say_time(1)
    robot.say_transforms(1)
    for tick in range(1, 4):
        robot.step(tick)
        robot.say_time(tick)
    robot.say_transforms(3)
    assert len(robot.commands) == 3
    monkeypatch.setattr(robot_module, "TF_LIMIT", NEVER)
    robot.say_scan(4)
    robot.wait_for_waiting()
    robot.say_transforms(4)
    robot.wait_for_commands(4)


def test_a_step_knows_how_long_ago_the_last_one_was(start: Start, cruise: type[Cruise]) -> None:
    """`view.dt` is 0 in the first step after GO, which comes after the robot is ready, and then the time between."""
    robot = start(cruise, gate=True)
    robot.ready(2)
    robot.wait_for_status(lambda status: status.is_ready)
    robot.say_team(GO)
    for steps, tick in enumerate((3, 4, 6), 1):
        robot.ready(tick)
        robot.wait_for_commands(steps)
    assert [view.dt for view in cruise.made[0].views] == [0.0, 0.1, 0.2]


@pytest.mark.parametrize("told", [True, False])
def test_a_robot_is_ready_with_its_base(told: bool, start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    """With all else there it waits for `base_info`; a base that does not publish it is waited for only so long."""
    monkeypatch.setattr(inputs, "BASE_INFO_LIMIT", NEVER)
    robot = start(gate=True)
    robot.say_statics()
    robot.say_odometry(1)
    for tick in (1, 2):
        if tick == 2 and told:
            robot.say_base_info()
        elif tick == 2:
            monkeypatch.setattr(inputs, "BASE_INFO_LIMIT", 0.0)
        robot.say_time(tick)
        robot.say_transforms(tick)
        robot.say_scan(tick)
        lacks = "its footprint (robot_1/base_info)" if tick == 1 else "the monitor's GO (zteam-monitor"
        robot.wait_for_status(lambda status, lacks=lacks: status.text.startswith(f"waiting for {lacks}"))  # type: ignore[misc]


LACKS = "its laser's frame robot_1/eye (robot_1/tf_static, from its base)"


def say_eye(robot: RealTimeRobot, parent: str) -> None:
    """Its base publishes where its laser is."""
    robot.say_fixed(TFMessage([stamped(parent, "eye", 0, 0.2)]))


@pytest.mark.parametrize("safety", [True, False])
def test_a_robot_stands_while_it_is_not_known_where_its_laser_is(
    safety: bool, start: Start, cruise: type[Cruise]
) -> None:
    """Before GO it is not ready and says why; it drives when its base says so, and stands when the frame is lost."""
    robot = start(cruise, gate=True, safety=safety)
    robot.say_base_info()
    robot.say_statics()
    robot.say_odometry(1)
    robot.say_transforms(1)
    for tick, frame, lacks in ((1, "eye", LACKS), (2, "", "a frame_id in the header of its scans"), (3, "eye", LACKS)):
        robot.say_time(tick)
        robot.say_scan(tick, frame=frame)
        robot.wait_for_status(lambda status, lacks=lacks: status.reason == f"waiting for {lacks}")  # type: ignore[misc]
    say_eye(robot, "base_link")
    robot.say_fixed(TFMessage([stamped("base_footprint", "base_link", 0)]))
    robot.say_time(4)
    robot.say_scan(4, frame="eye")
    robot.wait_for_status(lambda status: status.state == RobotState.READY)
    robot.say_team(GO)
    assert robot.step(5, frame="eye").linear.x == 0.1
    say_eye(robot, "nowhere")
    for tick in range(6, 10):
        command = robot.step(tick, frame="eye")
    assert command == Twist()
    robot.wait_for_status(lambda status: status.reason == f"needs {LACKS}")
    say_eye(robot, "base_footprint")
    robot.step(10, frame="eye")
    robot.wait_for_status(lambda status: status.reason == "")


def test_a_long_step_keeps_no_message_waiting(start: Start, cruise: type[Cruise]) -> None:
    """While the behaviour works, no thread of the bus waits for it, and nothing that it goes by changes. What has come
    meanwhile, parameters too, counts from the next step on."""
    cruise.gate.clear()
    robot = start(cruise)
    robot.say_statics()
    robot.say_time(1)
    robot.say_scan(1)
    assert cruise.entered.wait(LIMIT)
    statuses = len(robot.said)
    robot.say_time(2)
    robot.say_scan(2)
    assert robot.parameters().set("robot_1", {"speed": 0.5}) == {"speed": 0.5, "turn": 0.0}
    assert not robot.commands
    cruise.gate.set()
    robot.wait_for_commands(2)
    assert [(each.linear.x, each.angular.z) for each in robot.commands] == [(0.1, 0.1), (0.5, 0.5)]
    assert len(robot.said) > statuses
    assert [each.changes for each in cruise.made] == [1]


def test_several_values_are_set_together_or_not_at_all(start: Start, cruise: type[Cruise]) -> None:
    """A refused value or name keeps all others from being set, and is named; a wildcard sets nothing."""
    robot = start(cruise, further=1)
    client = robot.parameters()
    for values, text in (
        ({"turn": 0.2, "speed": 3.0}, "robot_1: behaviour Cruise: speed: a number of at most 1"),
        ({"turn": None}, "turn: a number is expected, not null"),
        ({"sped": 0.2}, "sped: unknown key"),
    ):
        with pytest.raises(UsageError, match=text):
            client.set("robot_1", values)
    (reply,) = robot.bus.transport.get(names.service_key("*", SET), b'{"parameters": {"speed": 1}}', LIMIT)
    assert reply.error
    told = client.describe("robot_1")
    assert (told.behavior, told.values) == ("Cruise", {"speed": 0.1, "turn": 0.0})
    assert [(each.name, each.type, each.limits, each.description) for each in told.parameters] == [
        ("speed", "float", {"ge": 0.0, "le": 1.0}, "m/s"),
        ("turn", "float", {}, ""),
    ]
    client.set("robot_1", {"turn": 0.2, "speed": 0.3})
    assert client.describe_all()["robot_1"].values == {"speed": 0.3, "turn": 0.2}


def test_after_a_jump_back_the_behaviour_is_made_anew(start: Start, cruise: type[Cruise]) -> None:
    """Between two steps, with the parameters that were set; a jump within a step is taken after it."""
    cruise.gate.clear()
    robot = start(cruise)
    robot.say_statics()
    # The scan first: after half a second without one the robot acts, to stop.
    robot.say_scan(50)
    robot.say_time(50)
    assert cruise.entered.wait(LIMIT)
    robot.parameters().set("robot_1", {"speed": 0.5})
    robot.say_time(1)
    robot.say_scan(1)
    assert len(cruise.made) == 1
    cruise.gate.set()
    robot.wait_for_commands(2)
    first, second = cruise.made
    assert [view.now // TICK for view in first.views + second.views] == [50, 1]
    assert (second.params.speed, second.changes, second.views[0].dt) == (0.5, 0, 0.0)


@pytest.mark.parametrize("is_late", [True, False])
def test_nothing_of_the_old_time_has_a_part_in_a_step(
    is_late: bool, start: Start, cruise: type[Cruise], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a scan that waits for its transforms when time jumps back, nor a bundle that comes late."""
    monkeypatch.setattr(robot_module, "TF_LIMIT", NEVER)
    monkeypatch.setattr(cruise, "uses_tf", True)
    robot = start(cruise)
    robot.say_statics()
    robot.say_transforms(50)
    robot.say_scan(50)
    robot.say_time(50)
    robot.wait_for_commands(1)
    if not is_late:
        robot.say_time(51)
        robot.say_scan(51)
        robot.wait_for_waiting()
    robot.say_time(1)
    if is_late:
        robot.say_transforms(50)
        robot.say_scan(1)
        robot.wait_for_waiting()
    robot.say_transforms(1)
    if not is_late:
        robot.say_scan(1)
    robot.wait_for_commands(2)
    assert [view.now // TICK for each in cruise.made for view in each.views] == [50, 1]


@pytest.mark.parametrize("where", ["step", "made anew"])
def test_an_error_of_the_behaviour_ends_the_robot(
    where: str, start: Start, cruise: type[Cruise], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The main loop raises it, whether the behaviour steps or is made anew."""
    monkeypatch.setattr(cruise, "fails_in", where)
    robot = start(cruise)
    robot.say_statics()
    robot.say_time(50)
    robot.say_scan(50)
    if where == "made anew":
        robot.wait_for_commands(1)
        robot.say_time(1)
        robot.say_scan(1)
    robot.join()
    assert [str(error) for error in robot.failures] == [where]


def test_a_robot_hears_what_its_behaviour_declares(start: Start, cruise: type[Cruise]) -> None:
    """Own topics, keys of other robots, topics of every robot and keys of the team come to a running robot's view."""
    robot = start(cruise)
    for key, message in (
        ("robot_1/goal_pose", PoseStamped(pose=Pose())),
        ("robot_0/goal_pose", PoseStamped(Header(frame_id="of another robot"))),
        ("robot_4/status", RobotStatus(robot_id=4)),
        ("robot_0/orders", String("left")),
        ("orders", String("all left")),
    ):
        robot.say(key, message)
    robot.say_token("robot_4")
    robot.ready(1)
    robot.wait_for_commands(1)
    robot.step(2)
    view = cruise.made[0].views[-1]
    assert view.inputs["goal"] == PoseStamped(pose=Pose())
    assert view.inputs["others"][4] == RobotStatus(robot_id=4)
    assert (view.inputs["of_robot_0"], view.inputs["all"]) == (String("left"), String("all left"))
    assert view.team == (1, 4)


def test_the_mux_drives_and_the_status_tells_who(start: Start, cruise: type[Cruise]) -> None:
    """Teleop drives for half a second after its last velocity, then navigation, then the behaviour again."""
    robot = start(cruise)
    teleop, nav = (names.robot_key(1, topic) for topic, _ in SOURCES.values())
    robot.say_time(1)
    robot.say(teleop, Twist(Vector3(0.05)))
    robot.ready(1)
    robot.wait_for_commands(1)
    for tick in range(2, 10):
        robot.say_time(tick)
        robot.say(teleop, Twist(Vector3(float("nan"))))
        if tick == 3:
            robot.say(nav, TwistStamped(Header(time_from_ns(3 * TICK)), Twist(Vector3(0.07))))
        robot.step(tick)
    assert [command.linear.x for command in robot.commands] == [0.05] * 6 + [0.07] * 2 + [0.1]
    told = [status.driver for status in robot.said]
    changes = [a for a, b in zip(told, [*told[1:], ""], strict=True) if a != b]
    assert changes[-3:] == [RobotDriver.TELEOP, RobotDriver.NAVIGATION, RobotDriver.BEHAVIOR]


def test_late_velocities_are_refused(start: Start, cruise: type[Cruise], monkeypatch: pytest.MonkeyPatch) -> None:
    """Of teleop and of navigation: the robot drives by its behaviour."""
    robot = start(cruise)
    teleop, nav = (names.robot_key(1, topic) for topic, _ in SOURCES.values())
    monkeypatch.setattr(Lateness, "problem", lambda _, sample: "late" if sample.key in (teleop, nav) else "")
    robot.say_time(1)
    robot.say(teleop, Twist(Vector3(0.05)))
    robot.say(nav, TwistStamped(Header(time_from_ns(TICK)), Twist(Vector3(0.07))))
    robot.ready(1)
    robot.wait_for_commands(1)
    assert robot.commands[0].linear.x == 0.1


def test_a_behaviour_sees_who_is_silent(start: Start, cruise: type[Cruise], monkeypatch: pytest.MonkeyPatch) -> None:
    """A teammate whose last status is too old."""
    monkeypatch.setattr(inputs, "SILENT_AFTER", 0.0)
    robot = start(cruise)
    robot.say(names.robot_key(2, names.STATUS), RobotStatus(robot_id=2))
    robot.ready(1)
    robot.wait_for_commands(1)
    assert 2 in cruise.made[0].views[-1].silent


def test_a_follower_is_given_another_leader(start: Start) -> None:
    """The leader is in the status from the start; a set one is followed from the next step on, but not the robot."""
    robot = start()
    assert robot.wait_for_status(lambda _: True).leader == 0
    robot.say_statics()
    robot.say_transforms(1)
    robot.step(1)
    with pytest.raises(UsageError, match="robot 1 cannot follow itself"):
        robot.parameters().set("robot_1", {"leader": 1})
    robot.parameters().set("robot_1", {"leader": 5})
    behavior: Any = robot.robot.driver.behavior
    assert behavior.leader == 0
    robot.say_transforms(2)
    robot.step(2)
    assert (behavior.leader, behavior.reason) == (5, "leader robot_5 not seen")
    assert robot.wait_for_status(lambda status: status.leader == 5)
