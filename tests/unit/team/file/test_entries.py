"""The entries of a team file as messages and as what robots are told."""

import math
from pathlib import Path

import msgspec
import pytest

from support.team_files import WHOLE, load
from zteam.cli.zteam_robot import main, parse_param, read_base
from zteam.config.toml_values import toml_text
from zteam.errors import UsageError
from zteam.geometry import yaw_from_quaternion
from zteam.messages.base import BaseOverride
from zteam.node.process_options import RobotOptions, from_line, to_line
from zteam.team.file.entries import RobotEntry, behavior_of, static_transform


def test_static_transforms_become_messages(tmp_path: Path) -> None:
    """Angles and quaternions both become unit quaternions; a leading slash is removed."""
    camera, dock = map(static_transform, load(tmp_path, WHOLE).static_transforms)
    assert (camera.header.frame_id, camera.child_frame_id) == ("robot_0/base_link", "robot_0/camera")
    assert camera.transform.translation.x == 0.1
    turn = camera.transform.rotation
    assert yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1.5)
    turn = dock.transform.rotation
    assert yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w) == pytest.approx(math.pi / 2)
    assert math.hypot(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1.0, abs=1e-15)


VALUES = """
[[robots]]
id = 3
behavior = "my.robots:Dance"
a = 0.1
b = -2
c = true
d = 'say "hi"\t#x = 1'
e = [1, [2.5, 'x']]
f = { 'two words' = 'ü😀', g = false }
h = 1e300
i = "\\u007f\\u0000\\\\ \\n"
"""


def test_children_are_told_the_same_parameters(tmp_path: Path) -> None:
    """Every TOML value that a parameter has in the file arrives, and a value of the command line reads alike."""
    robot = load(tmp_path, VALUES).robots[0]
    told = RobotOptions(robot.id, *behavior_of(robot))
    assert from_line(to_line("robot_3", told)) == ("robot_3", told)
    assert len(told.params) == 8
    typed = [f"{key}={toml_text(value)}" for key, value in robot.params.items()]
    assert dict(map(parse_param, typed)) == robot.params


@pytest.mark.parametrize(
    "line",
    ["", "garbage{", "\0" * 1000, "[" * 10_000, "3", '["a"]', '["a", "No", {}]', '["a", "SimOptions", {"seed": "x"}]'],
)
def test_a_line_of_no_launcher_is_refused(line: str) -> None:
    """What a user pipes into a member ends it with one line."""
    with pytest.raises(UsageError, match=r"standard input: no line of a launcher: .+"):
        from_line(line)


BASES = """
[[robots]]
id = 0
speed = 0.2
[robots.base]
footprint = [[-0.3, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.3, 0.2]]
max_vel_x = 0.5
decel_lim_x = -inf

[[robots]]
id = 1
base = {min_vel_x = 0}
"""


def test_children_are_told_what_holds_instead_of_base_info(tmp_path: Path) -> None:
    """What the table [robots.base] sets, infinity included, and no more; the command line takes the same."""
    robots = load(tmp_path, BASES).robots
    for robot in robots:
        told = RobotOptions(robot.id, "forward", base=robot.base)
        assert from_line(to_line("robot", told))[1] == told
        typed = [f"{key}={toml_text(value)}" for key, value in msgspec.to_builtins(robot.base).items()]
        assert read_base(map(parse_param, typed)) == robot.base
    first, second = (robot.base for robot in robots)
    assert (first.max_vel_x, first.decel_lim_x, first.max_vel_theta) == (0.5, -math.inf, None)
    assert second == BaseOverride(min_vel_x=0.0)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("max_vel_x", "--base: 'max_vel_x' is not KEY=VALUE, e.g. --base max_vel_x=0.4"),
        ("max_vel_z=1.0", "--base max_vel_z: unknown key (did you mean max_vel_y?); known: footprint, max_vel_x"),
        ("max_vel_x=fast", '--base max_vel_x: a number is expected, not "fast"'),
        ("footprint=[[0, 0], [1, 0], [2, 0]]", "--base footprint: must enclose an area"),
    ],
)
def test_a_wrong_base_on_the_command_line_is_told(text: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One line that names the option and the key."""
    with pytest.raises(SystemExit) as ended:
        main(["--id", "0", "--base", text])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"zteam-robot: {told}")


def test_a_robot_without_a_behaviour_drives_forward() -> None:
    """As `zteam-robot` does by default; one that is navigated stands."""
    assert behavior_of(RobotEntry(id=4)) == ("forward", {})
    assert behavior_of(RobotEntry(id=4, behavior="avoid")) == ("avoid", {})
    assert behavior_of(RobotEntry(id=4, navigation=True)) == ("idle", {})
