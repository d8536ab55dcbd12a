"""Right team files: what their tables become, the robots that a table stands for, and the world."""

import math
from pathlib import Path

import msgspec
import pytest

from support.team_files import WHOLE, load, robots
from zteam.cli.processes import main, parse_param, read_base
from zteam.config import resources
from zteam.config.toml_values import toml_text
from zteam.errors import ConfigError, UsageError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages.base import BaseOverride
from zteam.node.process_options import RobotOptions, from_line, to_line
from zteam.team.file.entries import RobotEntry, behavior_of, static_transform
from zteam.team.file.reading import load_team, read_team_file, team_world


def test_a_whole_file(tmp_path: Path) -> None:
    """Every table is read; an unknown key of a robot is a parameter of its behaviour."""
    team = load(tmp_path, WHOLE)
    assert (team.team.world, team.team.seed) == ("none", 7)
    assert team.robots[0] == RobotEntry(id=0, behavior="wander", params={"speed": 0.4})
    assert team.robots[1] == RobotEntry(id=1, follow=0)
    assert team.robots[2] == RobotEntry(id=7, model="erratic", pose=Pose2(2.0, 3.5, 1.57))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_files_of_other_editors_are_read(encoding: str, tmp_path: Path) -> None:
    """A byte order mark and Windows line ends change nothing."""
    (tmp_path / "team.toml").write_bytes("[[robots]]\r\nid = 3\r\n".encode(encoding))
    assert load_team(tmp_path / "team.toml").robots == [RobotEntry(id=3)]


def test_static_transforms_become_messages(tmp_path: Path) -> None:
    """Angles and quaternions both become unit quaternions; a leading slash is removed."""
    camera, dock = map(static_transform, load(tmp_path, WHOLE).static_transforms)
    assert (camera.header.frame_id, camera.child_frame_id) == ("robot_0/base_link", "robot_0/camera")
    assert camera.transform.translation.x == 0.1
    for transform, yaw in ((camera, 1.5), (dock, math.pi / 2)):
        turn = transform.transform.rotation
        assert yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w) == pytest.approx(yaw)
        assert math.hypot(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1.0, abs=1e-15)


VALUES = """
behavior = "my.robots:Dance"
a = 0.1
d = 'say "hi"\t#x = 1'
e = [1, [2.5, 'x']]
f = { 'two words' = 'ü😀', g = false }
i = "\\u007f\\u0000\\\\ \\n"
[robots.base]
footprint = [[-0.3, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.3, 0.2]]
max_vel_x = 0.5
decel_lim_x = -inf
"""


def test_children_are_told_the_same_parameters(tmp_path: Path) -> None:
    """Every TOML value that a parameter or [robots.base] has in the file arrives, infinity included, and no more; a
    command line takes the same."""
    robot = load(tmp_path, robots(f"id = 3{VALUES}")).robots[0]
    told = RobotOptions(robot.id, *behavior_of(robot), base=robot.base)
    assert from_line(to_line("robot_3", told)) == ("robot_3", told)
    assert {*told.params} == {*"adefi"}
    corners = ((-0.3, -0.2), (0.4, -0.2), (0.4, 0.2), (-0.3, 0.2))
    assert robot.base == BaseOverride(footprint=corners, max_vel_x=0.5, decel_lim_x=-math.inf)
    params, base = (
        [f"{key}={toml_text(value)}" for key, value in each.items()]
        for each in (robot.params, msgspec.to_builtins(robot.base))
    )
    assert (dict(map(parse_param, params)), read_base(map(parse_param, base))) == (robot.params, robot.base)


@pytest.mark.parametrize(
    "line",
    ["", "garbage{", "\0" * 1000, "[" * 10_000, "3", '["a"]', '["a", "No", {}]', '["a", "SimOptions", {"seed": "x"}]'],
)
def test_a_line_of_no_launcher_is_refused(line: str) -> None:
    """What a user pipes into a member ends it with one line."""
    with pytest.raises(UsageError):
        from_line(line)


@pytest.mark.parametrize("text", ["max_vel_x", "max_vel_z=1.0", "max_vel_x=fast", "footprint=[[0, 0], [1, 0], [2, 0]]"])
def test_a_wrong_base_on_the_command_line_is_told(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One line that names the option and the key."""
    with pytest.raises(SystemExit) as ended:
        main("zteam-robot", ["--id", "0", "--base", text])
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2 and line.startswith("zteam-robot: --base") and text.partition("=")[0] in line


def test_a_robot_without_a_behaviour_drives_forward(tmp_path: Path) -> None:
    """As `zteam-robot` does by default; one that is navigated stands; a leader is a parameter of `follow`."""
    assert behavior_of(RobotEntry(id=4)) == ("forward", {})
    assert behavior_of(RobotEntry(id=4, behavior="avoid")) == ("avoid", {})
    assert behavior_of(RobotEntry(id=4, navigation=True)) == ("idle", {})
    team = load(tmp_path, robots("id=0", "id=1\nfollow=0\nbehavior='follow'\nmin_dist=1.0"))
    assert behavior_of(team.robots[1]) == ("follow", {"leader": 0, "min_dist": 1.0})


def test_a_node_may_be_a_robot_that_has_no_table(tmp_path: Path) -> None:
    """A driver of one's own; numbers and truth values in a command are its words, also as arguments."""
    text = robots("id=0") + "\n[[nodes]]\nname='robot_1'\ncommand=['python', 'drive.py', 1, true, '${gap:-2.5}']"
    (node,) = load(tmp_path, text).nodes
    assert node.command == ("python", "drive.py", "1", "true", "2.5")


def test_ids_make_one_robot_each(tmp_path: Path) -> None:
    """All keys of the table hold for each of them."""
    team = load(tmp_path, robots("id = 0", 'ids = "3, 5-6"\nbehavior = "avoid"\nspeed = 0.3', "ids = 9"))
    assert [robot.id for robot in team.robots] == [0, 3, 5, 6, 9]
    assert team.robots[2] == RobotEntry(id=5, behavior="avoid", params={"speed": 0.3})


def test_previous_is_the_robot_before(tmp_path: Path) -> None:
    """In the order of the file and of the ids; the first of the ids follows the robot before its table."""
    text = robots(
        "id = 4", 'ids = "1-3"\nfollow = "previous"', 'id = 9\nfollow = "previous"', 'ids = "7,0"\nfollow = 2'
    )
    assert [(robot.id, robot.follow) for robot in load(tmp_path, text).robots] == [
        (4, None), (1, 4), (2, 1), (3, 2), (9, 3), (7, 2), (0, 2),
    ]  # fmt: skip


def test_poses_stand_in_a_row(tmp_path: Path) -> None:
    """The pose is that of the first; the step leads to each of the next ones."""
    text = robots('ids = "1-3"\nmodel = "erratic"\npose = [0.1, 2, 1.5]\npose_step = [-0.8, 0.1]')
    assert [robot.pose for robot in load(tmp_path, text).robots] == [
        Pose2(0.1, 2.0, 1.5), Pose2(-0.7, 2.1, 1.5), Pose2(-1.5, 2.2, 1.5),
    ]  # fmt: skip


def test_defaults_hold_where_a_robot_says_nothing(tmp_path: Path) -> None:
    """Parameters, base key by key, restart; a leader and a behaviour replace each other; a model goes with a pose."""
    text = '[defaults]\nbehavior = "avoid"\nspeed = 0.2\nrestart = "on-failure"\nmodel = "erratic"\n[defaults.base]\n'
    text += "max_vel_x = 0.5\nmax_vel_theta = 1.0\n"
    text += robots(
        "id = 0",
        "id = 1\nfollow = 0\nspeed = 0.3",
        'id = 2\nbehavior = "wander"\nrestart = "no"\npose = [1, 2, 0]\n[robots.base]\nmax_vel_x = 0.7',
    )
    first, second, third = load(tmp_path, text).robots
    assert (first.behavior, first.params, first.model) == ("avoid", {"speed": 0.2}, None)
    assert (second.behavior, second.follow, second.params) == (None, 0, {"speed": 0.3})
    assert (third.behavior, third.restart, third.model) == ("wander", "no", "erratic")
    assert (third.base.max_vel_x, third.base.max_vel_theta) == (0.7, 1.0)
    assert (first.base.max_vel_x, first.restart) == (0.5, "on-failure")


@pytest.mark.parametrize(
    ("defaults", "table"),
    [
        (
            'speed = 0.3\nnavigation = true\nsafety = false\nrestart = "on-failure"',
            'id = 0\nbehavior = "none"',
        ),
        ('behavior = "none"\nspeed = 0.3\nnavigation = true', "id = 0"),
    ],
)
def test_defaults_that_need_a_process_hold_for_robots_with_one(tmp_path: Path, defaults: str, table: str) -> None:
    """A robot without one takes none of them, wherever its `behavior` stands; another robot takes them."""
    team = load(tmp_path, f"[defaults]\n{defaults}\n" + robots(table, 'id = 1\nbehavior = "idle"'))
    assert team.robots[0] == RobotEntry(id=0, behavior="none")
    assert (team.robots[1].params, team.robots[1].navigation) == ({"speed": 0.3}, True)


def test_all_may_follow_by_default(tmp_path: Path) -> None:
    """The first robot says what it does itself."""
    text = '[defaults]\nfollow = "previous"\n' + robots('id = 0\nbehavior = "wander"', 'ids = "1-2"')
    assert [robot.follow for robot in load(tmp_path, text).robots] == [None, 0, 1]


def world_of(folder: Path, line: str) -> Path | None:
    """The world of a team file with this line in [team]."""
    path = folder / "team.toml"
    path.write_text(f"[team]\n{line}\n[[robots]]\nid = 0", encoding="utf-8")
    return team_world(read_team_file(path))


def test_a_world_is_found_beside_the_file_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A path is relative to the team file; else the text is a shipped world's name, with or without its ending."""
    library = tmp_path / "library"
    library.mkdir()
    (library / "yard.world").touch()
    monkeypatch.setattr(resources, "worlds_folder", lambda: library)
    assert world_of(tmp_path, "world = 'yard'") == library / "yard.world"
    assert world_of(tmp_path, "world = 'yard.world'") == library / "yard.world"
    (tmp_path / "yard.world").touch()
    assert world_of(tmp_path, "world = 'yard.world'") == tmp_path / "yard.world"
    assert world_of(tmp_path, "world = 'library/yard.world'") == library / "yard.world"
    assert world_of(tmp_path, f"world = '{library}/yard.world'") == library / "yard.world"
    assert world_of(tmp_path, "world = 'none'") is None


@pytest.mark.parametrize("line", [r'world="a\u0000b"', f"world='{'x' * 5000}'", "world='.'", "world='garden'", ""])
def test_what_is_no_world_is_refused(tmp_path: Path, line: str) -> None:
    """A NUL, a name that is too long, a folder, what is not there, and none."""
    with pytest.raises(ConfigError):
        world_of(tmp_path, line)
