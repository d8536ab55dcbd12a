"""`zteam param` with the parameters of three robots on a bus in memory."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from zteam import names
from zteam.bus import MemoryHub
from zteam.cli import main as zteam
from zteam.cli import param
from zteam.node.node import Node
from zteam.node.process_options import RobotOptions
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.registry import BEHAVIORS
from zteam.robot.process.node import RobotNode
from zteam.team.file.entries import behavior_of
from zteam.team.file.reading import load_team

Run = Callable[..., tuple[int, str, str]]

TEAM = {
    "robot_0": ("wander", {"speed": 0.3}),
    "robot_2": ("wander", {}),
    "robot_10": ("follow", {"leader": 2, "min_dist": 1}),
}


@pytest.fixture
def run(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs `zteam param WORDS` in a team; returns exit code, output and errors."""
    for name, (behavior, given) in TEAM.items():
        node, robot_id = Node(name, hub.bus(), Stop()), names.robot_id_of(name)
        assert robot_id is not None
        node.become_present()
        RobotNode(node, BEHAVIORS[behavior], RobotOptions(robot_id, behavior, given))
    monkeypatch.setattr(param, "open_bus", lambda _options: hub.bus())

    def run(*words: str) -> tuple[int, str, str]:
        # The robots log in this very process.
        code = zteam.main(["param", *words, "--log-level", "error"])
        return code, *capsys.readouterr()

    return run


def test_list_shows_every_robot_as_a_table(run: Run) -> None:
    """Robots come in the order of their ids; each parameter has its value, type, limits and description."""
    code, text, _ = run("list")
    assert code == 0
    assert [line for line in text.splitlines() if not line.startswith(" ")] == [
        "robot_0: wander",
        "robot_2: wander",
        "robot_10: follow",
    ]
    assert text.splitlines()[1:4] == [
        "  parameter      value  type   allowed         description",
        "  speed          0.3    float  0 to 1          m/s",
        "  turn_rate      1      float  0.1 to 3.14159  rad/s",
    ]


def test_list_prints_json(run: Run) -> None:
    """Scripts get the descriptions and the values."""
    (row,) = json.loads(run("list", "robot_10", "--json")[1])
    assert (row["name"], row["behavior"]) == ("robot_10", "follow")
    assert row["parameters"][3] == {
        "name": "min_dist",
        "type": "float",
        "limits": {"ge": 0.0, "le": 100.0},
        "description": "m; it stands while the leader is nearer; law direct",
        "required": False,
        "default": 0.8,
        "value": 1.0,
    }


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["robot_0", "/robot_0", "0"])
def test_get_prints_the_value_alone(run: Run, name: str) -> None:
    """A script can use the line as it is; a robot is named by its name or its id."""
    assert run("get", name, "speed") == (0, "0.3\n", "")


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["robot_*", "*", "robot_$*", "0,2,10"])
def test_get_of_several_robots_names_them(run: Run, name: str) -> None:
    """Robots that lack the parameter do not keep the others from being shown."""
    code, text, errors = run("get", name, "speed")
    assert (code, text) == (2, "robot_0: 0.3\nrobot_2: 0.4\n")
    assert errors.startswith("zteam param: robot_10: no parameter 'speed'; follow takes leader, law, ")
    assert len(errors.splitlines()) == 1


def test_set_changes_one_or_several_values(run: Run) -> None:
    """The line tells what holds from the next step on; whole numbers become those of the type."""
    assert run("set", "robot_0", "speed", "1", "turn_rate", "0.5") == (0, "robot_0: speed = 1.0, turn_rate = 0.5\n", "")
    assert run("get", "robot_0", "speed")[1] == "1.0\n"
    assert run("set", "0-2", "speed", "2e-1")[2] == (
        "zteam param: no process robot_1 with parameters; there is robot_0, robot_2, robot_10\n"
    )
    assert run("set", "0,2", "speed", "2e-1", "--json")[1] == '{"robot_0":{"speed":0.2},"robot_2":{"speed":0.2}}\n'


def test_a_refusal_of_one_robot_does_not_stop_the_others(run: Run) -> None:
    """Exit code 2 and one line for each robot that refused."""
    code, text, errors = run("set", "*", "speed", "0.2")
    assert (code, text) == (2, "robot_0: speed = 0.2\nrobot_2: speed = 0.2\n")
    assert errors.startswith("zteam param: robot_10: behaviour follow: speed: unknown key; follow takes leader, ")


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (
            ("set", "0", "speed", "-1"),
            2,
            "robot_0: behaviour wander: speed: a number of at least 0 is expected",
        ),
        (("set", "0", "speed", "fast"), 2, 'robot_0: behaviour wander: speed: a number is expected, not "fast"'),
        (
            ("get", "0", "sped"),
            2,
            "robot_0: no parameter 'sped' (did you mean speed?); wander takes speed, ",
        ),
        (("list", "x*"), 1, "no robot x*: there is robot_0, robot_2, robot_10"),
        (("list", "robot_3"), 1, "no process robot_3 with parameters; there is robot_0, robot_2, robot_10"),
        (("dump", "*"), 2, "dump *: name one robot"),
    ],
)
def test_mistakes_are_one_line_with_the_way_out(run: Run, words: tuple[str, ...], code: int, text: str) -> None:
    """A wrong value is exit code 2, a robot that is not there 1."""
    found, out, errors = run(*words)
    assert (found, out) == (code, "")
    assert errors.startswith(f"zteam param: {text}")
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["speed", "0.1", "speed", "0.2"], "set speed: it is given twice"),
        (["speed", "-inf"], "set speed -inf: give a finite number"),
    ],
)
def test_a_mistake_of_typing_is_told_with_the_usage(
    words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is exit code 2 and one line, before any robot is asked."""
    with pytest.raises(SystemExit) as end:
        param.main(["set", "0", *words])
    assert end.value.code == 2
    assert capsys.readouterr().err.startswith(f"zteam param set: {text}; usage: zteam param set NAME PARAM VALUE")


@pytest.mark.parametrize(("name", "expected"), [(name, TEAM[name]) for name in ("robot_0", "robot_10")])
def test_a_dump_fits_into_a_team_file(
    run: Run, tmp_path: Path, name: str, expected: tuple[str, dict[str, object]]
) -> None:
    """Pasted into a robot's table, it gives the behaviour and all its parameters."""
    code, text, _ = run("dump", name)
    assert code == 0
    path = tmp_path / "team.toml"
    path.write_text(f'[team]\nworld = "arena"\n\n[[robots]]\nid = 2\nbehavior = "wander"\n[[robots]]\nid = 1\n{text}')
    behavior, params = behavior_of(load_team(path).robots[1])
    assert behavior == expected[0]
    assert expected[1].items() <= params.items()
    assert len(params) == len(BEHAVIORS[behavior].Params.__struct_fields__)
    assert json.loads(run("dump", name, "--json")[1]).keys() == {line.split(" = ")[0] for line in text.splitlines()}
