"""Worlds and team files that come with zteam."""

import errno
import os
from pathlib import Path

import pytest

from zteam.behaviors import load_behavior
from zteam.config import resources
from zteam.errors import UsageError
from zteam.team.file.reading import load_team


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


def test_an_unknown_file_error_lists_the_shipped_ones() -> None:
    """The error of a mistyped name lists the names that exist."""
    with pytest.raises(UsageError, match=r"team 'lien': no such file, nor a shipped team \(.*line.*\)"):
        resources.find_team("lien")
    with pytest.raises(UsageError, match=r"world 'ofice': no such file, nor a shipped world \(.*office.*\)"):
        resources.find_world("ofice")


def test_a_link_that_leads_to_no_file_is_named_as_such(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A circle of symbolic links, one that dangles, and a file below a circle."""
    monkeypatch.chdir(tmp_path)
    Path("a.toml").symlink_to("b.toml")
    Path("b.toml").symlink_to("a.toml")
    Path("gone.world").symlink_to("nowhere.world")
    for name, reason in (("a.toml", "Too many levels of symbolic links"), ("a.toml/c.toml", "Too many levels")):
        with pytest.raises(UsageError, match=f"^team '{name}': a symbolic link leads to no file \\({reason}"):
            resources.find_team(name)
    with pytest.raises(UsageError, match=r"^world 'gone.world': a symbolic link leads to no file \(No such file"):
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


@pytest.mark.parametrize("name", resources.names(resources.teams_folder(), ".toml"))
def test_every_shipped_team_can_be_started(name: str) -> None:
    """The team file is valid, its world (if it names one) exists, and its behaviours accept its parameters."""
    path = resources.shipped_team(name)
    assert path is not None
    team = load_team(path)
    for robot in team.robots:
        params = dict(robot.params) if robot.follow is None else {"leader": robot.follow, **robot.params}
        load_behavior("follow" if robot.follow is not None else robot.behavior or "forward", params, robot.id)
    assert team.team.world is None or resources.shipped_world(team.team.world) is not None


def test_the_three_teams_are_shipped() -> None:
    """The default team, the lectures' exercise and the small team are shipped."""
    assert {"line", "willow", "arena"} <= set(resources.names(resources.teams_folder(), ".toml"))


def test_a_team_is_a_file_or_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A path comes first, so that a file of one's own named `line` is used; else the shipped team of that name."""
    monkeypatch.chdir(tmp_path)
    assert resources.find_team("line") == resources.shipped_team("line")
    assert resources.find_team("line.toml") == resources.shipped_team("line")
    (tmp_path / "line").write_text("")
    assert resources.find_team("line") == Path("line")


def test_an_unknown_team_names_the_known_ones() -> None:
    """The way out is in the message."""
    with pytest.raises(UsageError, match=r"no such file, nor a shipped team \(.*line.*\)"):
        resources.find_team("lien")


def test_a_world_is_a_file_or_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A path comes first, so that a user's own file named `arena` is used; else the shipped world of that name."""
    monkeypatch.chdir(tmp_path)
    assert resources.find_world("arena") == resources.shipped_world("arena")
    (tmp_path / "arena").write_text("")
    assert resources.find_world("arena") == Path("arena")


@pytest.mark.parametrize("name", ["aren", "", "x" * 5000, "a\0b"])
def test_an_unknown_world_names_the_known_ones(name: str) -> None:
    """One error, also for a text that no file can have as its name."""
    with pytest.raises(UsageError, match=r"no such file, nor a shipped world \(.*arena.*\)"):
        resources.find_world(name)


def test_a_folder_that_one_may_not_read_is_named_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error says who may not read it, and not that there is no file."""
    closed, usual = tmp_path / "team.toml", Path.stat

    def stat(path: Path, **options: bool) -> os.stat_result:
        if path == closed:
            raise PermissionError(errno.EACCES, "Permission denied")
        return usual(path, **options)

    monkeypatch.setattr(Path, "stat", stat)
    with pytest.raises(UsageError, match=rf"team.toml': Permission denied for user id {os.geteuid()}; .*chmod"):
        resources.find_team(closed)
