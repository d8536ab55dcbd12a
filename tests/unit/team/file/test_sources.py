"""Files that team files include: how they merge, where their paths lead, and mistakes with the right file."""

from pathlib import Path

import pytest

from zteam.config.resources import shipped_world
from zteam.errors import ConfigError
from zteam.team.file.entries import navigation_of
from zteam.team.file.reading import load_team, read_team_file, team_world
from zteam.team.file.sources import MAX_FILES


def write(folder: Path, **texts: str) -> Path:
    """Files of these texts by their names without `.toml`; the path of `team.toml`."""
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return folder / "team.toml"


def places_of(path: Path) -> list[str]:
    """Where the mistakes of a team file stand."""
    with pytest.raises(ConfigError) as caught:
        load_team(path)
    lines = str(caught.value).replace(f"{path.parent}/", "").splitlines()
    return [":".join(line.split(":")[:3]) for line in lines]


def test_the_includer_wins_and_lists_follow_each_other(tmp_path: Path) -> None:
    """Tables merge key by key, a later include over an earlier one; robots of included files come first."""
    path = write(
        tmp_path,
        one='[team]\nworld = "office"\nseed = 1\n[simulation]\ngaussian_noise = 0.1\n[[robots]]\nid = 1\n',
        two='[team]\nseed = 2\nrestart = "on-failure"\n[[robots]]\nid = 2\n',
        team='include = ["one.toml", "two.toml"]\n[team]\nworld_robots = false\n[[robots]]\nid = 0\n',
    )
    team = load_team(path)
    assert (team.team.world, team.team.seed, team.team.restart, team.team.world_robots) == (
        "office", 2, "on-failure", False,
    )  # fmt: skip
    assert team.simulation.gaussian_noise == 0.1
    assert [robot.id for robot in team.robots] == [1, 2, 0]


def test_arguments_pass_into_included_files(tmp_path: Path) -> None:
    """One argument fills all files; the name of an included file may be one too."""
    path = write(
        tmp_path,
        base='[[robots]]\nid = 0\nspeed = "${speed:-0.1}"\n',
        team='include = ["${base:-base.toml}"]\n[[robots]]\nid = 1\nspeed = "${speed:-0.2}"\n',
    )
    assert [robot.params["speed"] for robot in load_team(path).robots] == [0.1, 0.2]
    assert [robot.params["speed"] for robot in load_team(path, {"speed": "0.3"}).robots] == [0.3, 0.3]


def test_a_shipped_team_can_be_included(tmp_path: Path) -> None:
    """By its name; its world is found as before."""
    file = read_team_file(write(tmp_path, team='include = ["line"]\n[team]\nseed = 5\n'))
    assert [robot.id for robot in file.team.robots] == [0, 1, 2, 3]
    assert file.team.team.seed == 5
    assert team_world(file) == shipped_world("office")


def test_paths_belong_to_the_file_in_which_they_stand(tmp_path: Path) -> None:
    """World, map, description, folder of a node, and modules of behaviours: each beside the included file."""
    below = tmp_path / "below"
    write(
        below,
        base='[team]\nworld = "own.world"\nmap = "hall.yaml"\n[[robots]]\nid = 0\ndescription = "arm.urdf"\n'
        '[[nodes]]\nname = "a"\ncommand = ["python"]\n',
    )
    (below / "own.world").write_text("")
    file = read_team_file(
        write(tmp_path, team='include = ["below/base.toml"]\n[[nodes]]\nname = "b"\ncommand = ["python"]\n')
    )
    assert file.mistakes == []
    assert team_world(file) == below / "own.world"
    assert file.team.team.map == str(below / "hall.yaml")
    assert file.team.robots[0].description == str(below / "arm.urdf")
    assert [node.folder for node in file.team.nodes] == [str(below), str(tmp_path)]
    assert file.team.folders == (str(tmp_path), str(below))


def test_the_home_folder_is_named_in_paths_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To a program `~/scan` is a private name of ROS; what an argument stands for is a path where one is expected."""
    monkeypatch.setenv("HOME", "/home/me")
    text = (
        '[team]\nmap = "${map:-~/hall.yaml}"\n[[robots]]\nid = 0\ndescription = "~/${x:-a}.urdf"\n'
        '[[nodes]]\nname = "a"\nfolder = "~/n"\ncommand = ["~/bin/n", "~/scan", "~/${x:-a}"]\n'
    )
    team = read_team_file(write(tmp_path, team=text)).team
    assert (team.team.map, team.robots[0].description) == ("/home/me/hall.yaml", "/home/me/a.urdf")
    assert (team.nodes[0].folder, team.nodes[0].command) == ("/home/me/n", ("/home/me/bin/n", "~/scan", "~/a"))


def test_a_parameter_file_of_navigation_belongs_to_the_file_that_names_it(tmp_path: Path) -> None:
    """Beside an included file, for its robots and for those that take its defaults; a file's own stays as written."""
    below = tmp_path / "below"
    below.mkdir()
    write(
        below,
        base='[defaults]\nnavigation = { params = "nav2.yaml" }\n'
        '[[robots]]\nid = 0\nnavigation = { params = "other.yaml", localizer = "none" }\n',
    )
    path = write(
        tmp_path,
        team='include = ["below/base.toml"]\n[[robots]]\nid = 1\n[[robots]]\nid = 2\nnavigation.params = "own.yaml"\n',
    )
    params = [(navigation_of(robot) or {})["params"] for robot in load_team(path).robots]
    assert params == [str(below / "other.yaml"), str(below / "nav2.yaml"), "own.yaml"]


def test_mistakes_have_the_file_in_which_they_stand(tmp_path: Path) -> None:
    """Mistakes of all files in one error, in the order of reading; a rule across files names the right one."""
    path = write(
        tmp_path,
        base="[team]\nseed = 'x'\n[[robots]]\nid = 1\nfollow = 9\n[[robots]]\nid = 4\n",
        team='include = ["base.toml"]\n[[robots]]\nid = -1\n[[robots]]\nid = 2\nfollow = 1\nwhen = 1979-05-27\n'
        "[[robots]]\nid = 4\n",
    )
    assert places_of(path) == [
        "team.toml:3: robots[0].id",
        "team.toml:7: robots[1].when",
        "team.toml:9: robots[2].id",
        "base.toml:2: team.seed",
        "base.toml:5: robots[0].follow",
    ]


@pytest.mark.parametrize(
    ("include", "place"),
    [
        ('["none.toml"]', "1: include[0]"),
        ('["below"]', "1: include[0]"),
        ('["team.toml"]', "1: include[0]"),
        ('["a\\u0000b"]', "1: include[0]"),
        ('"base.toml"', "1: include"),
        ("[3]", "1: include"),
        ("{}", "1: include"),
    ],
)
def test_what_cannot_be_included_is_one_line(tmp_path: Path, include: str, place: str) -> None:
    """With file, line and key of the include, next to the other mistakes."""
    (tmp_path / "below").mkdir()
    path = write(tmp_path, team=f"include = {include}\n[[robots]]\nid = 0\nfollow = 7\n")
    assert places_of(path) == [f"team.toml:{place}", "team.toml:4: robots[0].follow"]


def test_a_circle_of_files_is_refused(tmp_path: Path) -> None:
    """At the include that closes it."""
    a, b = 'include = ["b.toml"]\n', 'include = ["./a.toml"]\n'
    path = write(tmp_path, a=a, b=b, team='include = ["a.toml"]\n[[robots]]\nid = 0')
    assert places_of(path) == ["b.toml:1: include[0]"]


def test_an_included_file_that_is_no_team_file_is_told(tmp_path: Path) -> None:
    """With the included file's name."""
    assert places_of(write(tmp_path, broken="[team\n", team='include = ["broken.toml"]\n')) == ["broken.toml:1:6"]


def test_files_that_include_others_twice_do_not_multiply(tmp_path: Path) -> None:
    """Ten files would be read a thousand times; the reading ends at the limit with one line. One list counts too."""
    texts = {f"f{i}": f'include = ["f{i + 1}.toml", "f{i + 1}.toml"]\n' for i in range(10)}
    for included in ('"f0.toml"', '"f10.toml", ' * MAX_FILES):
        path = write(tmp_path, **texts, f10="[defaults]\n", team=f"include = [{included}]\n[[robots]]\nid = 0\n")
        with pytest.raises(ConfigError, match=f"more than {MAX_FILES} files are included"):
            load_team(path)


def test_a_shared_file_may_be_included_twice(tmp_path: Path) -> None:
    """A file of defaults, in two files that are included together."""
    path = write(
        tmp_path,
        shared='[defaults]\nbehavior = "avoid"\n',
        a='include = ["shared.toml"]\n[[robots]]\nid = 0\n',
        b='include = ["shared.toml"]\n[[robots]]\nid = 1\n',
        team='include = ["a.toml", "b.toml"]\n',
    )
    team = load_team(path)
    assert [robot.behavior for robot in team.robots] == ["avoid", "avoid"]


@pytest.mark.parametrize("name", ["long-folder/" * 20 + "base.toml", "long-name-" * 20, "two  blanks.toml"])
def test_an_include_that_is_not_there_is_named_whole(tmp_path: Path, name: str) -> None:
    """However long its path is."""
    with pytest.raises(ConfigError) as refused:
        load_team(write(tmp_path, team=f'include = ["{name}"]\n'))
    assert f"include[0]: team '{name}': " in str(refused.value)
