"""`zteam param` with the parameters of three robots on a bus in memory."""

import json
from pathlib import Path

import pytest

from support.commands import Run
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.node.node import Node
from zteam.node.process_options import RobotOptions
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.registry import BEHAVIORS
from zteam.robot.client import DESCRIBE
from zteam.robot.process.node import RobotNode
from zteam.team.file.entries import behavior_of
from zteam.team.file.reading import load_team

TEAM = {
    "robot_0": ("wander", {"speed": 0.3}),
    "robot_2": ("wander", {}),
    "robot_10": ("follow", {"leader": 2, "min_dist": 1}),
}


@pytest.fixture(autouse=True)
def team(tools: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """The robots, which log in this very process."""
    monkeypatch.setenv("ZTEAM_LOG_LEVEL", "error")
    for name, (behavior, given) in TEAM.items():
        node, robot_id = Node(name, tools.bus(), Stop()), names.robot_id_of(name)
        assert robot_id is not None
        node.become_present()
        RobotNode(node, BEHAVIORS[behavior], RobotOptions(robot_id, behavior, given))


def test_list(run: Run) -> None:
    """Robots come in the order of their ids; each parameter has its value, type, limits and description."""
    lines = run("zteam param list").out.splitlines()
    assert [line for line in lines if not line.startswith(" ")] == [
        "robot_0: wander",
        "robot_2: wander",
        "robot_10: follow",
    ]
    assert lines[2] == "  speed          0.3    float  0 to 1          m/s"
    (row,) = json.loads(run("zteam param list robot_10 --json").out)
    assert (row["name"], row["behavior"]) == ("robot_10", "follow")
    assert row["parameters"][3] == {
        "name": "min_dist", "type": "float", "limits": {"ge": 0.0, "le": 100.0}, "required": False, "default": 0.8,
        "description": "m; it stands while the leader is nearer; law direct", "value": 1.0,
    }  # fmt: skip


def test_get_prints_the_value_alone(run: Run) -> None:
    """A script can use the line as it is. Of several robots each is named; those that lack it are errors."""
    for name in ("robot_0", "/robot_0", "0"):
        assert run(f"zteam param get {name} speed") == ("0.3\n", "")
    for name in ("robot_*", "*", "robot_$*", "0,2,10"):
        text, errors = run(f"zteam param get '{name}' speed", 2)
        assert text == "robot_0: 0.3\nrobot_2: 0.4\n"
        (line,) = errors.splitlines()
        assert line.startswith("zteam param: robot_10: no parameter 'speed'; follow takes leader, law, ")


def test_set_changes_values(run: Run) -> None:
    """The line shows what holds from the next step on; a refusal of one robot does not stop the others."""
    assert run("zteam param set robot_0 speed 1 turn_rate 0.5").out == "robot_0: speed = 1.0, turn_rate = 0.5\n"
    assert run("zteam param get robot_0 speed").out == "1.0\n"
    answer = '{"robot_0":{"speed":0.2},"robot_2":{"speed":0.2}}\n'
    assert run("zteam param set 0,2 speed 2e-1 --json").out == answer
    text, errors = run("zteam param set '*' speed 0.1", 2)
    assert text == "robot_0: speed = 0.1\nrobot_2: speed = 0.1\n"
    (line,) = errors.splitlines()
    assert line.startswith("zteam param: robot_10: behaviour follow: speed: unknown key; follow takes leader, ")


def test_only_the_named_robots_are_asked(run: Run, tools: MemoryHub) -> None:
    """Another one, which may be frozen, gets no query; for a pattern all are asked."""
    asked = list[NoRequest]()
    tools.bus().serve(names.service_key("robot_1", DESCRIBE), NoRequest, asked.append)
    for words in ("get robot_0 speed", "set 0,2 speed 0.1", "list 2"):
        run(f"zteam param {words}")
    assert not asked
    run("zteam param list")
    assert asked


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        ("set 0 speed -1", 2, "robot_0: behaviour wander: speed: a number of at least 0 is expected"),
        ("set 0-2 speed 1", 1, "no process robot_1 with parameters: 'zteam param list' shows those that there are"),
        ("get 0 sped", 2, "robot_0: no parameter 'sped' (did you mean speed?); wander takes speed, "),
        ("list x*", 1, "no process x* with parameters; there is robot_0, robot_2, robot_10"),
        ("dump *", 2, "dump *: name one robot"),
    ],
)
def test_mistakes_are_one_line_with_the_way_out(run: Run, words: str, code: int, text: str) -> None:
    """A wrong value is exit code 2, a robot that is not there 1."""
    out, errors = run(f"zteam param {words}", code)
    (line,) = errors.splitlines()
    assert not out and line.startswith(f"zteam param: {text}")


@pytest.mark.parametrize("name", ["robot_0", "robot_10"])
def test_a_dump_fits_into_a_team_file(run: Run, tmp_path: Path, name: str) -> None:
    """Pasted into a robot's table, it gives the behaviour and all its parameters."""
    text = run(f"zteam param dump {name}").out
    path = tmp_path / "team.toml"
    path.write_text(f'[team]\nworld = "arena"\n\n[[robots]]\nid = 2\nbehavior = "wander"\n[[robots]]\nid = 1\n{text}')
    behavior, params = behavior_of(load_team(path).robots[1])
    assert behavior == TEAM[name][0]
    assert TEAM[name][1].items() <= params.items()
    assert len(params) == len(BEHAVIORS[behavior].Params.__struct_fields__)
    table = json.loads(run(f"zteam param dump {name} --json").out)
    assert table.keys() == {line.split(" = ")[0] for line in text.splitlines()}
