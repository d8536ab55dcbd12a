"""Several robots in one table: ids, the robot before, poses in a row, defaults."""

from pathlib import Path

import pytest

from support.team_files import error_of, load, robots
from zteam.errors import ConfigError
from zteam.geometry import Pose2
from zteam.team.file.entries import RobotEntry
from zteam.team.file.reading import load_team


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


def test_all_may_follow_by_default(tmp_path: Path) -> None:
    """The first robot says what it does itself."""
    text = '[defaults]\nfollow = "previous"\n' + robots('id = 0\nbehavior = "wander"', 'ids = "1-2"')
    assert [robot.follow for robot in load(tmp_path, text).robots] == [None, 0, 1]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (robots('ids = "0-1000000"'), "2: robots[0].ids: '0-1000000': give robot ids from 0 to 9999"),
        (robots('ids = ""'), "2: robots[0].ids: no id is given: give robot ids such as"),
        (robots('ids = "3-1"'), "2: robots[0].ids: '3-1': the first id is above the last"),
        (robots('ids = "1,1"'), "2: robots[0].ids: names a robot twice: 1"),
        (robots("ids = [1, 2]"), '2: robots[0].ids: robot ids such as "1-7" are expected'),
        (robots("ids = true"), '2: robots[0].ids: robot ids such as "1-7" are expected'),
        (robots('id = 0\nids = "1-2"'), "3: robots[0].ids: both id and ids; keep one of them"),
        (robots("id = 3", 'ids = "1-7"'), "4: robots[1].ids: robot 3 is robots[0] already"),
        (
            robots('ids = "1-7"', 'ids = "3-9"'),
            "4: robots[1].ids: robots 3-7 are in robots[0] already; give each robot its own id",
        ),
        (robots('id = 0\nfollow = "previous"'), "3: robots[0].follow: there is no robot before the first one"),
        (
            robots('id = "x"', 'ids = "1-2"\nfollow = "previous"'),
            '2: robots[0].id: a whole number is expected, not "x"',
        ),
        (robots('ids = "x"', 'id = 1\nfollow = "previous"'), "2: robots[0].ids: 'x': give robot ids"),
        (robots('id = 0\nfollow = "previos"'), "a robot id or \"previous\" is expected, not 'previos' (did you mean p"),
        (robots("id = 0\npose_step = [1, 2]"), "3: robots[0].pose_step: it belongs to ids"),
        (robots('ids = "1-2"\npose_step = [1, 2]'), "3: robots[0].pose_step: it needs the pose of the first"),
        (
            robots('ids = "1-2"\nmodel = "e"\npose = [0, 0, 0]\npose_step = [1, inf]'),
            "5: robots[0].pose_step: [x, y] is expected: metres",
        ),
        ("defaults = 3\n" + robots("id = 0"), "1: defaults: a table is expected, as in [defaults]"),
        ("[defaults]\nid = 3\n" + robots("id = 0"), "2: defaults.id: robots cannot share it; give it in [[robots]]"),
        ("[default]\nspeed = 3\n" + robots("id = 0"), "1: default: unknown key (did you mean defaults?)"),
        ('[defaults]\nrestart = "always"\n' + robots("id = 0", "id = 1"), "2: defaults.restart: Invalid enum value"),
        ("[[robots]]\nid = 0\nrestart = 1", "3: robots[0].restart: a text is expected, not 1"),
    ],
)
def test_mistakes_in_groups_are_one_line(tmp_path: Path, text: str, told: str) -> None:
    """With the line of the key in the file; a mistake that concerns several robots is told once."""
    assert told in error_of(tmp_path, text)


@pytest.mark.ci
def test_ten_thousand_repeated_ids_are_one_line(tmp_path: Path) -> None:
    """The error has not one line for each robot."""
    path = tmp_path / "team.toml"
    path.write_text(robots('ids = "0-9999"', 'ids = "0-9999"'))
    with pytest.raises(ConfigError) as caught:
        load_team(path)
    assert str(caught.value).endswith("robots 0-9999 are in robots[0] already; give each robot its own id")
    assert "\n" not in str(caught.value)
