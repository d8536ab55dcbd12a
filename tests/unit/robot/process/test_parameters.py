"""Parameters of a robot that drives, on a bus in memory: a set counts from the next step on, whole or not at all."""

import threading
from collections.abc import Iterator
from typing import Annotated, ClassVar

import msgspec
import pytest

from support.limits import LIMIT
from support.real_time_robot import RealTimeRobot
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.errors import UsageError
from zteam.messages import Twist, Vector3
from zteam.robot.client import SET

NAME = "robot_1"


class CruiseParams(msgspec.Struct, forbid_unknown_fields=True):
    """Of `Cruise`."""

    speed: Annotated[float, msgspec.Meta(ge=0.0, le=1.0, description="m/s")] = 0.1
    turn: float = 0.0


class Cruise(Behavior):
    """Drives, reads its speed at the beginning and at the end of a step, and counts its steps and its changes."""

    Params = CruiseParams
    gate: ClassVar[threading.Event]
    entered: ClassVar[threading.Event]
    made: ClassVar[list["Cruise"]]

    def __init__(self, params: CruiseParams) -> None:
        super().__init__(params)
        self.steps = 0
        self.changes = 0
        Cruise.made.append(self)

    def on_params(self) -> None:
        """Count."""
        self.changes += 1

    def step(self, view: View) -> Twist:
        """The speed of both reads, which differ only if the parameters changed within the step."""
        self.steps += 1
        before = self.params.speed
        Cruise.entered.set()
        assert Cruise.gate.wait(LIMIT)
        return Twist(Vector3(before), Vector3(0.0, 0.0, self.params.speed))


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Iterator[RealTimeRobot]:
    """Robot 1, which cruises; its steps run through."""
    monkeypatch.setattr(Cruise, "gate", threading.Event(), raising=False)
    monkeypatch.setattr(Cruise, "entered", threading.Event(), raising=False)
    monkeypatch.setattr(Cruise, "made", [], raising=False)
    Cruise.gate.set()
    made = RealTimeRobot(Cruise)
    made.say_statics()
    yield made
    Cruise.gate.set()
    made.close()


def drive(robot: RealTimeRobot, tick: int) -> tuple[float, float]:
    """The speed at the beginning and at the end of the step for a further scan."""
    count = len(robot.commands)
    robot.say_time(tick)
    robot.say_scan(tick)
    robot.wait_for_commands(count + 1)
    return robot.commands[-1].linear.x, robot.commands[-1].angular.z


def test_a_set_counts_from_the_next_step_and_the_behaviour_keeps_its_state(robot: RealTimeRobot) -> None:
    """The same object goes on, is told once of the change, and drives with the new speed."""
    assert drive(robot, 1) == (0.1, 0.1)
    assert robot.parameters().set(NAME, {"speed": 0.5}) == {"speed": 0.5, "turn": 0.0}
    assert drive(robot, 2) == (0.5, 0.5)
    assert drive(robot, 3) == (0.5, 0.5)
    (behavior,) = Cruise.made
    assert (behavior.steps, behavior.changes) == (3, 1)


def test_a_step_never_sees_a_change(robot: RealTimeRobot) -> None:
    """A set during a step is answered at once, and counts from the step after it."""
    Cruise.gate.clear()
    robot.say_time(1)
    robot.say_scan(1)
    assert Cruise.entered.wait(LIMIT)
    assert robot.parameters().set(NAME, {"speed": 0.5})["speed"] == 0.5
    Cruise.gate.set()
    robot.wait_for_commands(1)
    assert (robot.commands[0].linear.x, robot.commands[0].angular.z) == (0.1, 0.1)
    assert drive(robot, 2) == (0.5, 0.5)


def test_several_values_are_set_together_or_not_at_all(robot: RealTimeRobot) -> None:
    """One refused value keeps all others from being set; the error names robot, behaviour, parameter and reason."""
    client = robot.parameters()
    with pytest.raises(
        UsageError, match=r"^robot_1: behaviour Cruise: speed: a number of at most 1 is expected, not 3\.0$"
    ):
        client.set(NAME, {"turn": 0.2, "speed": 3.0})
    assert client.describe(NAME).values == {"speed": 0.1, "turn": 0.0}
    assert drive(robot, 1) == (0.1, 0.1)
    client.set(NAME, {"turn": 0.2, "speed": 0.3})
    assert client.describe(NAME).values == {"speed": 0.3, "turn": 0.2}


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"speed": "fast"}, 'speed: a number is expected, not "fast"'),
        ({"sped": 0.2}, r"sped: unknown key \(did you mean speed\?\); Cruise takes speed, turn"),
        ({"turn": None}, "turn: a number is expected, not null"),
    ],
)
def test_a_refusal_gives_the_reason(robot: RealTimeRobot, values: dict[str, object], text: str) -> None:
    """A wrong type and an unknown name are answered in the words of the team file's check."""
    with pytest.raises(UsageError, match=f"^robot_1: behaviour Cruise: {text}$"):
        robot.parameters().set(NAME, values)


def test_a_new_behaviour_gets_the_parameters_that_were_set(robot: RealTimeRobot) -> None:
    """After a jump back in time the behaviour is made anew with the values that were set."""
    drive(robot, 50)
    robot.parameters().set(NAME, {"speed": 0.5})
    drive(robot, 51)
    assert drive(robot, 1) == (0.5, 0.5)
    assert [behavior.params.speed for behavior in Cruise.made] == [0.5, 0.5]
    assert Cruise.made[1].changes == 0


def test_the_description_has_types_limits_and_values(robot: RealTimeRobot) -> None:
    """What `zteam param list` shows comes from `Params` and from the behaviour that runs."""
    reply = robot.parameters().describe(NAME)
    assert reply.behavior == "Cruise"
    assert [(each.name, each.type, each.limits, each.description) for each in reply.parameters] == [
        ("speed", "float", {"ge": 0.0, "le": 1.0}, "m/s"),
        ("turn", "float", {}, ""),
    ]
    assert robot.parameters().describe_all() == {NAME: reply}


def test_a_changed_parameter_is_told_with_a_status(robot: RealTimeRobot) -> None:
    """The status that carries what parameters decide, such as the leader, is published when they count."""
    drive(robot, 1)
    robot.parameters().set(NAME, {"turn": 0.5})
    statuses = robot.statuses
    drive(robot, 2)
    assert robot.statuses > statuses


def test_a_follower_is_told_another_leader() -> None:
    """A set `leader` names the robot that is followed from the next step on; a robot cannot follow itself."""
    robot = RealTimeRobot()
    try:
        robot.say_statics()
        robot.say_time(1)
        robot.say_transforms(1)
        robot.say_scan(1)
        robot.wait_for_commands(1)
        behavior = robot.robot.driver.behavior
        assert behavior.leader == 0
        with pytest.raises(UsageError, match="robot 1 cannot follow itself; name another robot"):
            robot.parameters().set(NAME, {"leader": 1})
        robot.parameters().set(NAME, {"leader": 5})
        assert behavior.leader == 0
        robot.say_scan(2)
        robot.say_transforms(2)
        robot.wait_for_commands(2)
        assert (behavior.leader, behavior.reason) == (5, "leader robot_5 not seen")
    finally:
        robot.close()


class OpenParams(msgspec.Struct):
    """Forbids no unknown fields."""

    speed: float = 0.1


class Open(Behavior):
    """Takes them."""

    Params = OpenParams

    def step(self, view: View) -> Twist:
        """It stands."""
        return Twist()


def test_an_unknown_name_is_refused_where_params_do_not_forbid_it() -> None:
    """At the start a further key is ignored; a set that would change nothing is refused."""
    robot = RealTimeRobot(Open, further=1)
    try:
        with pytest.raises(UsageError, match="sped: unknown key; Open takes speed"):
            robot.parameters().set(NAME, {"sped": 0.3})
    finally:
        robot.close()


def test_a_set_on_a_wildcard_is_refused(robot: RealTimeRobot) -> None:
    """A request that reaches every robot names none of them, and changes nothing."""
    client = robot.parameters()
    request = b'{"parameters": {"speed": 1}}'
    replies = client._bus.transport.get(names.service_key("*", SET), request, LIMIT)
    assert [reply.error for reply in replies] == [True]
    assert client.describe(NAME).values["speed"] == 0.1
