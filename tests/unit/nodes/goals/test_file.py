"""Files of goals: what they may hold, and the line of every mistake."""

from pathlib import Path

import pytest

from zteam.errors import ConfigError
from zteam.geometry import Pose2
from zteam.nodes.goals.file import FileGoal, read_goals, robots_of


def write(folder: Path, text: str) -> Path:
    """A file with this text."""
    path = folder / "goals.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_goals_keep_their_order_and_lines(tmp_path: Path) -> None:
    """A robot is named by its id or its name; yaw may be left out; numbers come in any notation."""
    text = "# a tour\n- {robot: 1, x: 22.0, y: -17, yaw: 1.57}\n- robot: robot_2\n  x: 4.5e0\n  y: 1e-1\n"
    goals = read_goals(write(tmp_path, text))
    assert goals == [FileGoal(1, Pose2(22.0, -17.0, 1.57), 2), FileGoal(2, Pose2(4.5, 0.1, 0.0), 3)]
    assert robots_of(goals) == [1, 2]


def test_shared_goals_need_no_robot(tmp_path: Path) -> None:
    """With robots that share them, goals may leave the robot out."""
    goals = read_goals(write(tmp_path, "- {x: 1, y: 2}\n- {robot: 3, x: 1, y: 2}\n"), spread=True)
    assert [goal.robot for goal in goals] == [None, 3]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("- {robot: 1, x: 1}\n", ["1: the key y is missing"]),
        ("- {x: 1, y: 2}\n", ["1: the key robot is missing, or name the robots that share the goals: --spread 0-3"]),
        ("- {robot: 1, x: 1, y: 2, yaww: 3}\n", ["1: unknown key 'yaww' (did you mean yaw?); known: robot, x, y, yaw"]),
        ("- {robot: 1, x: 1, x: 2, y: 2}\n", ["1: x is given twice"]),
        ("- {robot: -1, x: 1, y: 2}\n", ["1: robot: robot id '-1' is not a whole number from 0 to 9999"]),
        ("- {robot: 1, x: a, y: 2}\n", ["1: x: a is no number of metres in the map"]),
        ("- {robot: 1, x: .nan, y: 2}\n", ["1: x: .nan is no number of metres in the map"]),
        ("- {robot: 1, x: 1e9, y: [2]}\n", ["1: x: 1e9 is no number of metres in the map", "1: y: this is no number"]),
        ("- {robot: 1, x: 1, y: 2, yaw: 90}\n", ["1: yaw: 90 is more than a full turn; angles are radians"]),
        ("- 3\n", ["1: a goal is expected, such as {robot: 1, x: 3.0, y: 4.0, yaw: 1.57}"]),
        ("goals: []\n", ["1: a list of goals is expected"]),
        ("[]\n", ["1: a list of goals is expected"]),
        ("", ["1: a list of goals is expected"]),
        ("- {robot: 1}: 3: 4\n", ["1: not YAML: "]),
        ("- {robot: 1, x: 1, y: 2}\n- {robot: 1, x: 3}\n\n- {robot: q, x: 1, y: 2}\n", ["2: the key y", "4: robot: "]),
    ],
)  # fmt: skip
def test_every_mistake_has_its_line(tmp_path: Path, text: str, told: list[str]) -> None:
    """All mistakes are told at once, each on a line of its own that begins with file and line."""
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as raised:
        read_goals(path)
    lines = str(raised.value).splitlines()
    assert len(lines) == len(told)
    for line, expected in zip(lines, told, strict=True):
        assert line.startswith(f"{path}:{expected}")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    """A file that is missing, is no text, or nests without end is refused with its name."""
    with pytest.raises(ConfigError, match=r"none\.yaml: cannot read the goals: No such file"):
        read_goals(tmp_path / "none.yaml")
    path = tmp_path / "goals.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"goals\.yaml: not YAML: "):
        read_goals(path)
    with pytest.raises(ConfigError, match=r"goals\.yaml: not YAML: "):
        read_goals(write(tmp_path, "[" * 1_000))
