"""Worlds and team files that come with zteam."""

import errno
import os
from pathlib import Path

import pytest
import yaml

from zteam.config import resources
from zteam.errors import UsageError
from zteam.team.file.reading import read_team_file
from zteam.team.launch.check import check_team


@pytest.mark.parametrize(
    ("text", "value"),
    [("5e-2", 0.05), ("-2E3", -2000.0), ("+.5e1", 5.0), ("1.e-1", 0.1), ("e5", "e5"), ("1e", "1e"), ("'5e-2'", "5e-2")],
)
def test_a_number_with_an_exponent_is_a_number_in_yaml(text: str, value: object) -> None:
    """Also without a dot, as in YAML 1.2; a text in quotes stays a text."""
    assert resources.load_yaml(f"key: [{text}]") == {"key": [value]}


@pytest.mark.parametrize(
    "text",
    ["a: &a {b: *a}", "a: &a [*a]", "a: &a {x: 1}\nb: {<<: *a}", "a: !!bool 3", "a: !!timestamp x", "a: !!int ''"],
)
def test_yaml_that_ros_does_not_read_is_refused(tmp_path: Path, text: str) -> None:
    """In one line: aliases, which may have no end, and values that do not fit their tags."""
    (tmp_path / "own.yaml").write_text(text)
    with pytest.raises(UsageError, match=r"^.*own\.yaml(:[12])?: not YAML: [^\n]*$"):
        resources.read_yaml(tmp_path / "own.yaml", "map", 1000, UsageError)


def test_maps_may_have_a_few_aliases() -> None:
    """As map_server's YAML takes them, also one of itself; more than are allowed are refused."""
    assert resources.load_yaml("a: &a [1]\nb: {<<: {c: *a}}\nd: *a", aliases=2) == {"a": [1], "b": {"c": [1]}, "d": [1]}
    assert set(resources.load_yaml("a: &a [*a]", aliases=1)) == {"a"}
    with pytest.raises(yaml.YAMLError):
        resources.load_yaml("a: &a 1\nb: [*a, *a]", aliases=1)


def test_team_files_are_found_by_name() -> None:
    """A shipped team is found with and without its suffix, and only directly in its folder."""
    found = resources.shipped_team("line")
    assert found is not None
    assert found == resources.shipped_team("line.toml")
    assert found.parent == resources.teams_folder()
    for name in ("no_such_team", "../deploy/line", "deploy/line", str(found), "", ".", ".."):
        assert resources.shipped_team(name) is None


def test_a_path_comes_before_a_shipped_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file named `line` in the current folder is used instead of the shipped team of that name."""
    monkeypatch.chdir(tmp_path)
    assert resources.find_team("line") == resources.shipped_team("line")
    assert resources.find_world("office.world") == resources.shipped_world("office")
    (tmp_path / "line").touch()
    (tmp_path / "office.world").touch()
    assert resources.find_team("line") == Path("line")
    assert resources.find_world("office.world") == Path("office.world")


@pytest.mark.parametrize("name", ["lien", "", "x" * 5000, "a\0b"])
def test_an_unknown_name_lists_the_shipped_ones(name: str) -> None:
    """One error, also for a text that no file can have as its name."""
    with pytest.raises(UsageError, match=r": .+, nor a shipped team \(.*line.*\)"):
        resources.find_team(name)
    with pytest.raises(UsageError, match=r": .+, nor a shipped world \(.*arena.*\)"):
        resources.find_world(name)


def test_a_file_of_the_other_kind_is_named_as_such() -> None:
    """With what takes it."""
    with pytest.raises(UsageError, match=r"that is a world; say 'zteam up --world office.world'"):
        resources.find_team("office.world")
    with pytest.raises(UsageError, match=r"that is a team; say 'zteam up line'"):
        resources.find_world("line")


def test_a_world_of_another_simulator_is_named_as_such(tmp_path: Path) -> None:
    """No command is suggested that would refuse it."""
    (tmp_path / "gz.world").write_text('<?xml version="1.0"?>\n<sdf version="1.6"><world name="w"/></sdf>\n')
    with pytest.raises(UsageError, match=r"gz.world: this is a file of Gazebo \(SDF\)"):
        resources.find_team("gz.world", tmp_path)


def test_a_link_that_leads_to_no_file_is_named_as_such(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A circle of symbolic links, one that dangles, and a file below a circle."""
    monkeypatch.chdir(tmp_path)
    Path("a.toml").symlink_to("b.toml")
    Path("b.toml").symlink_to("a.toml")
    Path("gone.world").symlink_to("nowhere.world")
    for name in ("a.toml", "a.toml/c.toml"):
        with pytest.raises(UsageError, match=f"^team '{name}': Too many levels of symbolic links"):
            resources.find_team(name)
    with pytest.raises(UsageError, match=r"^world 'gone.world': No such file or directory, nor"):
        resources.find_world("gone.world")


def test_a_name_is_not_a_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only files directly in the folder are found; folders and files below it are not."""
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path / "zteam")
    worlds = tmp_path / "worlds"
    (worlds / "hidden").mkdir(parents=True)
    (worlds / "dir.world").mkdir()
    (worlds / "b.world").touch()
    (worlds / "a.world").touch()
    (worlds / "hidden" / "c.world").touch()
    (worlds / "notes.txt").touch()
    assert resources.shipped_world("a") == worlds / "a.world"
    assert resources.shipped_world("hidden/c") is None
    assert resources.shipped_world("dir") is None
    assert resources.shipped_world("notes.txt") is None
    assert resources.names(worlds, ".world") == ["a", "b", "dir"]


def test_the_copies_in_a_wheel_come_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files inside the package are used before those in a folder beside it."""
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path / "zteam")
    (tmp_path / "deploy").mkdir()
    assert resources.teams_folder() == tmp_path / "deploy"
    (tmp_path / "zteam" / "_deploy").mkdir(parents=True)
    assert resources.teams_folder() == tmp_path / "zteam" / "_deploy"


def test_a_folder_that_one_may_not_read_is_named_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error does not say that there is no file."""
    closed, usual = tmp_path / "team.toml", Path.stat

    def stat(path: Path, **options: bool) -> os.stat_result:
        if path == closed:
            raise PermissionError(errno.EACCES, "Permission denied")
        return usual(path, **options)

    monkeypatch.setattr(Path, "stat", stat)
    with pytest.raises(UsageError, match=r"team.toml': Permission denied, nor"):
        resources.find_team(closed)


@pytest.mark.parametrize("name", resources.names(resources.teams_folder(), ".toml"))
def test_every_shipped_team_can_be_started(name: str) -> None:
    """Neither file nor world nor the behaviours' parameters have a mistake; the lectures' world is not shipped."""
    world = resources.find_world("office") if name == "willow" else None
    check_team(read_team_file(resources.find_team(name)), world, here=True)
