"""Behaviours by name, their parameters, what they declare, and what is said of one that cannot be loaded."""

import enum
import importlib
import math
import sys
from pathlib import Path
from typing import Annotated, Any, Literal, Optional

import msgspec
import pytest
from msgspec import Meta

from zteam.behaviors import load_behavior
from zteam.errors import UsageError
from zteam.messages import Odometry, PoseStamped, RobotStatus, String, Twist
from zteam.robot.behaviors.behavior import NoParams, check_inputs, declared_inputs
from zteam.robot.behaviors.registry import BEHAVIORS, explain, look_in
from zteam.robot.parameters import Parameter, parameters_of, values_of


class Side(enum.Enum):
    """A choice."""

    LEFT = "left"
    RIGHT = "right"


class Anything:
    """No plain data."""

    def __str__(self) -> str:
        return "anything"


class Params(msgspec.Struct, rename="camel"):
    """One field of each kind."""

    leader: Annotated[int, Meta(ge=0)]
    top_speed: Annotated[float, Meta(gt=0.0, le=2.0, description="m/s")] = 0.5
    side: Side = Side.LEFT
    mode: Literal["fast", "slow"] = "fast"
    gains: list[Annotated[float, Meta(ge=0.0)]] = []
    reach: Annotated[float, Meta(ge=0.0, description="m")] | None = None
    label: Optional[str] = None  # noqa: UP045
    pair: tuple[float, ...] = (1.0, 2.0)
    table: dict[str, int] = msgspec.field(default_factory=lambda: {"a": 1})
    far: float = math.inf
    other: Any = Anything()
    sides: list[Side] = []
    turns: list[Literal["l", "r"]] = []


def test_each_field_is_described() -> None:
    """The name that users write, its bare type, limits and description of its Meta, its default as plain data."""
    assert parameters_of(Params) == [
        Parameter("leader", "int", {"ge": 0}, required=True),
        Parameter("topSpeed", "float", {"gt": 0.0, "le": 2.0}, "m/s", default=0.5),
        Parameter("side", "'left' | 'right'", default="left"),
        Parameter("mode", "'fast' | 'slow'", default="fast"),
        Parameter("gains", "list[float]", default=[]),
        Parameter("reach", "float | None", {"ge": 0.0}, "m"),
        Parameter("label", "str | None"),
        Parameter("pair", "tuple[float, ...]", default=(1.0, 2.0)),
        Parameter("table", "dict[str, int]", default={"a": 1}),
        Parameter("far", "float", default=math.inf),
        Parameter("other", "Any", default="anything"),
        Parameter("sides", "list['left' | 'right']", default=[]),
        Parameter("turns", "list['l' | 'r']", default=[]),
    ]
    values = values_of(Params(leader=3, side=Side.RIGHT))
    assert list(values) == [each.name for each in parameters_of(Params)]
    assert (values["leader"], values["side"], values["reach"], values["gains"]) == (3, "right", None, [])


@pytest.mark.parametrize("name", BEHAVIORS)
def test_every_shipped_parameter_is_described(name: str) -> None:
    """Each has a description, and each number a lowest and a highest value."""
    for each in parameters_of(BEHAVIORS[name].Params):
        assert each.description, each.name
        assert set(each.limits) == {"ge", "le"} or each.type not in ("int", "float"), each.name


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import nothere\n", "robots_of_mine.py:1: ModuleNotFoundError: No module named 'nothere' (is it beside"),
        ("import json\njson.loads('{')\n", "robots_of_mine.py:2: JSONDecodeError: Expecting property name"),
        ("def f(:\n", "SyntaxError: invalid syntax (robots_of_mine.py, line 1)"),
        ("from geometry_msgs.msg import Twist\n", "(zteam works without ROS: "),
        ("from zteam import Twist\n", "message types are in zteam.messages)"),
        ("raise SystemExit\n", "robots_of_mine.py:1: SystemExit"),
    ],
)
def test_an_error_names_the_users_line_and_the_way_out(text: str, told: str, empty_folder: Path) -> None:
    """One line: where in the user's file, what, and what to write instead."""
    (empty_folder / "robots_of_mine.py").write_text(text)
    with pytest.raises(BaseException) as caught:
        importlib.import_module("robots_of_mine")
    line = explain(caught.value)
    assert told in line
    assert "\n" not in line


MINE = """
import msgspec
from zteam.behaviors import Behavior
from zteam.messages import Twist, Vector3

class Params(msgspec.Struct, forbid_unknown_fields=True):
    rate: float = 0.5

class Spin(Behavior):
    Params = Params
    def step(self, view):
        return Twist(angular=Vector3(z=self.params.rate))

class Bare(Behavior):
    def step(self, view):
        return Twist()

class Mute(Behavior):
    pass

class Blind(Behavior):
    def step(self):
        return Twist()

class Odd(Behavior):
    Params = 7

class Deaf(Bare):
    inputs = {"goal": ("goal_pose", Twist)}

class Closed(Bare):
    def __init__(self):
        self.sides = 0

class Own(Spin):
    def __init__(self, params):
        self.sides = 0

class Stranger:
    pass
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's package in a folder that is looked in, forgotten afterwards."""
    package = tmp_path / "my_robots"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "mine.py").write_text(MINE)
    (package / "raising.py").write_text("raise RuntimeError('two\\nlines')\n")
    (tmp_path / "ends.py").write_text("import sys; sys.exit(3)")
    (tmp_path / "colorsys.py").write_text("raise RuntimeError('shadowed')")
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    with pytest.raises(UsageError, match="ModuleNotFoundError"):
        load_behavior("my_robots.mine:Spin", {})
    look_in([tmp_path, tmp_path])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_users_class_is_found(folder: Path) -> None:
    """package.module:Class, its parameters typed like ours. Its folder shadows nothing that zteam or Python needs."""
    assert load_behavior("my_robots.mine:Spin", {"rate": 2}).params.rate == 2.0
    with pytest.raises(UsageError, match="Spin: rate: "):
        load_behavior("my_robots.mine:Spin", {"rate": "fast"})
    assert load_behavior("my_robots.mine:Bare", {}).params == NoParams()
    # Its own __init__ does not call that of Behavior.
    assert load_behavior("my_robots.mine:Own", {"rate": 2}).params.rate == 2.0
    with pytest.raises(UsageError, match="takes no parameters"):
        load_behavior("my_robots.mine:Bare", {"speed": 1.0})
    assert importlib.import_module("colorsys").__file__ != str(folder / "colorsys.py")
    assert sys.path.count(str(folder)) == 1


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("spec", "text"),
    [
        ("wandr", "no behaviour 'wandr' (did you mean wander?): use idle, forward, avoid"),
        ("", "no behaviour ''"),
        ("my_robots.mine", "package.module:Class"),
        ("my_robots.mine:", "package.module:Class"),
        ("my_robots..mine:Spin", "package.module:Class"),
        ("my_robots/mine.py:Spin", "did you mean my_robots.mine:Spin?"),
        ("no_such_package.mine:Spin", "cannot import no_such_package.mine: ModuleNotFoundError"),
        ("my_robots.raising:Spin", "raising.py:1: RuntimeError: two lines"),
        ("ends:Robot", "ends.py:1: SystemExit: 3"),
        ("my_robots.mine:Swim", "mine.py) has no Swim; it has Spin, Bare, Mute, Blind, Odd, Deaf, Closed, Own"),
        ("my_robots.mine:Closeds", "mine.py) has no Closeds (did you mean Closed?)"),
        ("my_robots.mine:Behaviour", "mine.py) has no Behaviour; it has Spin, "),
        ("my_robots.mine:Stranger", "is not a subclass"),
        ("my_robots.mine:Mute", "has no step: def step(self, view): return Twist("),
        ("my_robots.mine:Blind", "its step must take the view: def step(self, view)"),
        ("my_robots.mine:Odd", "give it a class Params"),
        ("my_robots.mine:Deaf", "inputs: 'goal': goal_pose carries PoseStamped, not Twist"),
        ("my_robots.mine:Closed", "def __init__(self, params): super().__init__(params)"),
    ],
)
def test_what_is_no_behaviour_is_refused_on_one_line(spec: str, text: str) -> None:
    """The error names what is wrong and the way out."""
    with pytest.raises(UsageError) as caught:
        load_behavior(spec, {})
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("spec", "params", "key"),
    [
        ("forward", {"sped": 0.4}, "sped: unknown key"),
        ("forward", {"speed": 2.0}, "speed: a number of at most 1"),
        ("forward", {"speed": float("nan")}, "speed"),
        ("follow", {}, "the key leader is missing"),
        ("follow", {"leader": True}, "leader"),
        ("follow", {"leader": 10_000}, "leader: a whole number of at most 9999"),
        ("follow", {"leader": 1}, "robot 1 cannot follow itself"),
        ("formation", {"leader": 0, "shape": "star"}, "shape"),
        ("formation", {"leader": 0, "team": [1, -2]}, "team"),
        ("path", {"waypoints": [[0, 0]]}, "waypoints"),
        ("path", {"waypoints": [[0, 0], [1e9, 0]]}, "waypoints"),
        ("path", {"waypoints": [[1, 1], [1, 1 + 1e-10]]}, "waypoints: must be at least two places, 0.01 m apart"),
    ],
)
def test_wrong_parameters_name_their_key(spec: str, params: dict[str, object], key: str) -> None:
    """A parameter's mistake is answered with its key and what it takes."""
    with pytest.raises(UsageError, match=f"^behaviour {spec}: .*{key}"):
        load_behavior(spec, params, 1)


@pytest.mark.parametrize(
    ("inputs", "text"),
    [
        ([("goal_pose", PoseStamped)], "not a dict"),
        ({"goal": ("goal_pose",)}, "'goal': "),
        ({7: ("goal_pose", PoseStamped)}, "7: "),
        ({"goal": (7, PoseStamped)}, "'goal': (7, <class "),
        ({"goal": ("", PoseStamped)}, "'goal': '' is no topic"),
        ({"goal": ("goal//pose", PoseStamped)}, "'goal': 'goal//pose' is no topic"),
        ({"all": ("robot_*/status", RobotStatus)}, "'robot_*/status' is no topic"),
        ({"all": ("/**", String)}, "'/**' is no topic"),
        ({"goal": ("goal_pose", "PoseStamped")}, "is no message type"),
        ({"all": ("robot_$*/odom", Twist)}, "robot_$*/odom carries Odometry, not Twist"),
    ],
)
def test_a_mistake_in_inputs_is_told(inputs: Any, text: str) -> None:
    """Each mistake names the input and what is wrong."""
    with pytest.raises(UsageError) as caught:
        check_inputs("inputs", inputs)
    assert str(caught.value).startswith("inputs")
    assert text in str(caught.value)


def test_the_keys_of_inputs() -> None:
    """A topic without a slash in front is of the own robot, unless it names a robot or stands for every robot."""
    inputs = {
        "goal": ("goal_pose", PoseStamped),
        "others": ("robot_$*/odom", Odometry),
        "orders": ("robot_0/orders", String),
        "news": ("/news", String),
    }
    check_inputs("inputs", inputs)
    found = {declared.name: (declared.key, declared.of_all_robots) for declared in declared_inputs(inputs, 1)}
    assert found == {
        "goal": ("robot_1/goal_pose", False),
        "others": ("robot_$*/odom", True),
        "orders": ("robot_0/orders", False),
        "news": ("news", False),
    }
