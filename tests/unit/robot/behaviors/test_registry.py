"""Behaviours by name, their parameters, and what is said of one that cannot be imported."""

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
from zteam.robot.behaviors.behavior import NoParams
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


class Params(msgspec.Struct):
    """One field of each kind."""

    leader: Annotated[int, Meta(ge=0)]
    speed: Annotated[float, Meta(gt=0.0, le=2.0, description="m/s")] = 0.5
    side: Side = Side.LEFT
    mode: Literal["fast", "slow"] = "fast"
    gains: list[Annotated[float, Meta(ge=0.0)]] = []
    reach: Annotated[float, Meta(ge=0.0, description="m")] | None = None
    label: Optional[str] = None  # noqa: UP045
    pair: tuple[float, ...] = (1.0, 2.0)
    table: dict[str, int] = msgspec.field(default_factory=lambda: {"a": 1})
    far: float = math.inf
    other: Any = Anything()


def test_each_field_is_described() -> None:
    """Name, type without its annotations, limits and description of its Meta, and default as plain data."""
    assert parameters_of(Params) == [
        Parameter("leader", "int", {"ge": 0}, required=True),
        Parameter("speed", "float", {"gt": 0.0, "le": 2.0}, "m/s", default=0.5),
        Parameter("side", "'left' | 'right'", default="left"),
        Parameter("mode", "'fast' | 'slow'", default="fast"),
        Parameter("gains", "list[float]", default=[]),
        Parameter("reach", "float | None", {"ge": 0.0}, "m"),
        Parameter("label", "str | None"),
        Parameter("pair", "tuple[float, ...]", default=(1.0, 2.0)),
        Parameter("table", "dict[str, int]", default={"a": 1}),
        Parameter("far", "float", default=math.inf),
        Parameter("other", "Any", default="anything"),
    ]


def test_values_are_plain_data_by_name() -> None:
    """Every field is there, also one that has its default."""
    values = values_of(Params(leader=3, side=Side.RIGHT))
    assert list(values) == [each.name for each in parameters_of(Params)]
    assert (values["leader"], values["side"], values["reach"], values["gains"]) == (3, "right", None, [])


def test_a_renamed_field_has_the_name_that_users_write() -> None:
    """Keys of team files and names of parameters are the same."""

    class Renamed(msgspec.Struct, rename="camel"):
        top_speed: float = 1.0

    assert [each.name for each in parameters_of(Renamed)] == ["topSpeed"]
    assert values_of(Renamed()) == {"topSpeed": 1.0}


@pytest.mark.parametrize("name", BEHAVIORS)
def test_every_shipped_parameter_is_described(name: str) -> None:
    """Each has a description, and each number a lowest and a highest value."""
    for each in parameters_of(BEHAVIORS[name].Params):
        assert each.description, each.name
        assert set(each.limits) == {"ge", "le"} or each.type not in ("int", "float"), each.name


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import nothere\n", "ModuleNotFoundError: No module named 'nothere' (is it beside the team file, in the "),
        ("x = 1\n1 / 0\n", "robots_of_mine.py:2: ZeroDivisionError: division by zero"),
        ("import json\njson.loads('{')\n", "robots_of_mine.py:2: JSONDecodeError: Expecting property name"),
        ("def f(:\n", "SyntaxError: invalid syntax (robots_of_mine.py, line 1)"),
        (
            "def f():\n\tx = 1\n        return x\n",
            "TabError: inconsistent use of tabs and spaces in indentation (robots",
        ),
        (
            "import rospy\n",
            "robots_of_mine.py:1: ModuleNotFoundError: No module named 'rospy' (zteam works without ROS: ",
        ),
        ("from geometry_msgs.msg import Twist\n", "(zteam works without ROS: its message types are in zteam.messages)"),
        ("from zteam import Twist\n", "(from zteam.messages import Twist)"),
        ("from zteam import Behaviour\n", " (did you mean Behavior?)"),
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

class Closed(Behavior):
    def __init__(self):
        self.sides = 0

class Stranger:
    pass
"""


STOPPERS = """
import zteam.behaviors as b
class Helper: pass
class Stopper(b.Behavior): pass
class Slower(Stopper):
    def step(self, view): ...
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's package on the path, forgotten afterwards."""
    package = tmp_path / "my_robots"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "mine.py").write_text(MINE)
    (package / "broken.py").write_text("def (:\n")
    (package / "raising.py").write_text("raise RuntimeError('two\\nlines')\n")
    (tmp_path / "my_stopper.py").write_text(STOPPERS)
    (tmp_path / "empty.py").touch()
    (tmp_path / "ends.py").write_text("import sys; sys.exit(3)")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_a_users_class_is_found() -> None:
    """package.module:Class, its parameters typed like ours."""
    behavior = load_behavior("my_robots.mine:Spin", {"rate": 2})
    assert behavior.params.rate == 2.0
    with pytest.raises(UsageError, match=r'Spin: rate: a number is expected, not "'):
        load_behavior("my_robots.mine:Spin", {"rate": "fast"})


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("spec", "text"),
    [
        ("wandr", "no behaviour 'wandr' (did you mean wander?): use idle, forward, avoid"),
        ("my_stopper", "no behaviour 'my_stopper' (did you mean my_stopper:Stopper or my_stopper:Slower?): use"),
        ("empty", "no behaviour 'empty' (did you mean empty:Class?): use"),
        ("my_stopper:Stoper", "my_stopper.py) has no Stoper (did you mean Stopper?)"),
        ("ends", "no behaviour 'ends' (did you mean ends:Class?): use"),
        ("ends:Robot", "ends.py:1: SystemExit: 3"),
        ("turn", "no behaviour 'turn': use idle, forward, avoid, wander, follow, path, go_to, formation or package."),
        ("", "no behaviour ''"),
        ("my_robots.mine", "package.module:Class"),
        ("my_robots.mine:", "package.module:Class"),
        (":Spin", "package.module:Class"),
        ("my_robots..mine:Spin", "package.module:Class"),
        ("no_such_package.mine:Spin", "cannot import no_such_package.mine: ModuleNotFoundError"),
        ("my_robots.broken:Spin", "cannot import my_robots.broken: SyntaxError"),
        ("my_robots.raising:Spin", "raising.py:1: RuntimeError: two lines"),
        ("my_robots.mine:Swim", "mine.py) has no Swim; it has Spin, Bare, Mute, Blind"),
        ("my_robots.mine:Stranger", "is not a subclass"),
        ("my_robots.mine:MINE", "has no MINE"),
        ("my_robots.mine:Mute", "has no step: def step(self, view): return Twist("),
        ("my_robots.mine:Blind", "its step must take the view: def step(self, view)"),
        ("my_stopper.py:Stopper", "(did you mean my_stopper:Stopper?): a module is named without .py"),
        ("my_robots/mine.py:Spin", "(did you mean my_robots.mine:Spin?)"),
        ("my_stopper.py", "(did you mean my_stopper:Stopper or my_stopper:Slower?): use"),
        ("my_stopper.Stopper", "(did you mean my_stopper:Stopper?): use"),
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
    ("spec", "params", "text"),
    [
        ("forward", {"sped": 0.4}, r"sped: unknown key \(did you mean speed\?\); forward takes speed"),
        ("forward", {"speed": "fast"}, r': speed: a number is expected, not "fast"'),
        ("forward", {"speed": 2.0}, r": speed: a number of at most 1 is expected, not 2.0"),
        ("forward", {"speed": float("nan")}, r": speed"),
        ("avoid", {"max_invalid": -1}, r": max_invalid"),
        ("wander", {"turn_rate": 0.0}, r": turn_rate"),
        ("follow", {}, "the key leader is missing"),
        ("follow", {"leader": "0"}, r': leader: a whole number is expected, not "0"'),
        ("follow", {"leader": -1}, r": leader"),
        ("follow", {"leader": 10_000}, r": leader: a whole number of at most 9999 is expected, not 10000"),
        ("follow", {"leader": True}, r": leader"),
    ],
)
def test_wrong_parameters_name_their_key(spec: str, params: dict[str, object], text: str) -> None:
    """A parameter's mistake is answered with its key and what it takes."""
    with pytest.raises(UsageError, match=text):
        load_behavior(spec, params)


@pytest.mark.usefixtures("folder")
def test_a_behaviour_without_parameters_needs_no_params() -> None:
    """A class that names no type of parameters loads, and refuses any parameter."""
    assert load_behavior("my_robots.mine:Bare", {}).params == NoParams()
    with pytest.raises(UsageError, match=r"speed: unknown key; my_robots\.mine:Bare takes no parameters"):
        load_behavior("my_robots.mine:Bare", {"speed": 1.0})


def test_whole_numbers_are_speeds_too() -> None:
    """`speed = 1` in a team file is 1.0 m/s."""
    assert load_behavior("forward", {"speed": 1}).params.speed == 1.0


def test_folders_are_looked_in_after_what_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module beside the team file is found, and shadows nothing that zteam or Python needs."""
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    (tmp_path / "my_lonely_module.py").write_text(MINE)
    (tmp_path / "colorsys.py").write_text("raise RuntimeError('shadowed')")
    with pytest.raises(UsageError, match="ModuleNotFoundError"):
        load_behavior("my_lonely_module:Spin", {})
    look_in([tmp_path, tmp_path])
    assert load_behavior("my_lonely_module:Spin", {}).params.rate == 0.5
    assert importlib.import_module("colorsys").__file__ != str(tmp_path / "colorsys.py")
    assert sys.path.count(str(tmp_path)) == 1


def test_the_current_folder_is_looked_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty name is wherever the process is."""
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    (tmp_path / "my_second_module.py").write_text(MINE)
    look_in([""])
    monkeypatch.chdir(tmp_path)
    assert load_behavior("my_second_module:Spin", {"rate": 1}).params.rate == 1.0
