"""Team files read from disk: every mistake with its line, and the world."""

import tracemalloc
from pathlib import Path

import pytest

from support.team_files import WHOLE, error_of, load
from zteam.config import resources
from zteam.errors import ConfigError
from zteam.geometry import Pose2
from zteam.team.file.entries import RobotEntry
from zteam.team.file.reading import KEYS, load_team, read_team_file, team_world


def test_a_whole_file(tmp_path: Path) -> None:
    """Every table is read; an unknown key of a robot is a parameter of its behaviour."""
    team = load(tmp_path, WHOLE)
    assert (team.team.world, team.team.seed) == ("none", 7)
    assert team.robots[0] == RobotEntry(id=0, behavior="wander", params={"speed": 0.4})
    assert team.robots[1] == RobotEntry(id=1, follow=0)
    assert team.robots[2] == RobotEntry(id=7, model="erratic", pose=Pose2(2.0, 3.5, 1.57))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "the key robots is missing: add a table [[robots]] with an id"),
        ("robots = []", "1: robots: no robot is listed: add a table [[robots]] with an id"),
        ("robots = 3", "1: robots: a list of tables is expected"),
        ("robots = [3]", "1: robots[0]: a table is expected, not 3"),
        ("[robots]\nid = 1", "written with two brackets, as in [[robots]]"),
        ("[[robots]]\nbehavior = 'avoid'", "1: robots[0]: the key id is missing"),
        ("[[robots]]\nid = 0\n[[robots]]\nid = '1'", 'robots[1].id: a whole number is expected, not "1"'),
        ("[[robots]]\nid = true", "robots[0].id: a whole number is expected, not true"),
        ("[[robots]]\nid = 1.0", "robots[0].id: a whole number is expected, not 1.0"),
        ("[[robots]]\nid = -1", "robots[0].id: a whole number of at least 0 is expected, not -1"),
        ("[[robots]]\nid = 10000", "robots[0].id: a whole number of at most 9999 is expected, not 10000"),
        (f"[[robots]]\nid = 1{'0' * 40}", "robots[0].id: a whole number of at most 9999 is expected, not 1000"),
        ("[[robots]]\nid = 1\n[[robots]]\nid = 1", "4: robots[1].id: robot 1 is robots[0] already"),
        (
            "[team]\nwrld = 'x'\n[[robots]]\nid = 0",
            "2: team.wrld: unknown key (did you mean world?); known: world, seed",
        ),
        ("[team]\nseed = -1\n[[robots]]\nid = 0", "team.seed: a whole number of at least 0 is expected, not -1"),
        (
            "[simulation]\nno_hti = 1\n[[robots]]\nid = 0",
            "2: simulation.no_hti: unknown key (did you mean no_hit?); known: phys",
        ),
        (
            "[simulation]\ndazzle = 'x'\n[[robots]]\nid = 0",
            "simulation.dazzle: Invalid enum value 'x'; one of off, drop",
        ),
        (
            "[simulation]\ngaussian_noise = -1\n[[robots]]\nid = 0",
            "2: simulation.gaussian_noise: must be from 0 to 1000, not -1",
        ),
        ("[[robot]]\nid = 0", "1: robot: unknown key (did you mean robots?); known: robots, team"),
        ("[Team]\nseed = 1\n[[robots]]\nid = 0", "1: Team: unknown key (did you mean team?); known: robots, team"),
        ("[[robots]]\nid = 0\nfollow = 0", "robots[0].follow: robot 0 cannot follow itself"),
        ("[[robots]]\nid = 0\nfollow = 4", "robots[0].follow: no robot 4 in this team (it has 0)"),
        ("[[robots]]\nid = 0\nfollow = -4", "robots[0].follow: a whole number of at least 0 is expected, not -4"),
        ("[[robots]]\nid = 0\nbehavior = 'follow'", "3: robots[0].behavior: to follow needs a leader; say follow = ID"),
        ("[[robots]]\nid = 0\nbehavior = ''", 'behavior: a text of at least 1 character is expected, not ""'),
        ("[[robots]]\nid = 7\nmodel = 'erratic'", "3: robots[0].model: model and pose go together"),
        ("[[robots]]\nid = 7\npose = [1, 2, 3]", "3: robots[0].pose: model and pose go together"),
        ("[[robots]]\nid = 7\nmodel = 'e'\npose = [1, 2]", "pose: a list of 3 values is expected, not [1, 2]"),
        ("[[robots]]\nid = 7\nmodel = 'e'\npose = [1, nan, 2]", "robots[0].pose: [1.0, nan, 2.0] is no pose"),
        (
            "[[robots]]\nid = 7\nmodel = 'e'\npose = [1, 2, 90]",
            "4: robots[0].pose: yaw 90 is more than a full turn; angles are radians (90 degrees are 1.5708)",
        ),
        ("[[robots]]\nid = 0\nleader = 1", "3: robots[0].leader: a robot that follows says follow = ID"),
        ("[[robots]]\nid = 7\nmodel = 'e'\npose = [inf, 1, 2]", "robots[0].pose: [inf, 1.0, 2.0] is no pose"),
        ("[[robots]]\nid = 0\nwhen = 1979-05-27", "robots[0].when: a parameter is a number, text"),
        ("[[robots]]\nid = 0\nx = 0xffffffffffffffffffff", "robots[0].x: a parameter is a number, text"),
        (
            "[[robots]]\nid = 0\n[security.grants]\nview = ['golas']",
            '4: security.grants.view[0]: "golas" is no grant (did you mean goals?); known: teleop, goals, simulation',
        ),
        (
            "[[robots]]\nid = 0\n[security.grants]\nview = 'goals'",
            "4: security.grants.view: a list of words is expected",
        ),
        ("[[robots]]\nid = 0\n[security.grants]\nview = [3]", "4: security.grants.view[0]: 3 is no grant; known"),
        ("[[robots]]\nid = 0\n[security.grants]\n'a b' = []", "cannot be a name; use letters, digits"),
        ("[[robots]]\nid = 0\n[security.grants]\ntf_static = []", "4: security.grants.tf_static: tf_static is a topic"),
        ("[[robots]]\nid = 0\n[security]\ngrant = []", "4: security.grant: unknown key (did you mean grants?)"),
        ("[[robots]]\nid = 0\n'max speed' = 1", '3: robots[0]."max speed": cannot be a parameter'),
    ],
)
def test_mistakes_have_their_line_and_key(tmp_path: Path, text: str, told: str) -> None:
    """Each mistake is one line: file, key and what to write instead."""
    assert told in error_of(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[[robots]]\nid = \n", "2:6: not TOML: Invalid value"),
        ("[team\n", "1:6: not TOML: Expected ']'"),
        ("id = 1\nid = 2\n", "2:7: not TOML: Cannot overwrite a value"),
        ("x = '", "not TOML"),
        (f"x = {'[' * 5000}", "nested too deeply"),
        (f"[[robots]]\nid = 0\n{'.'.join('a' * 5000)} = 1", "nested too deeply"),
        (f"x = {'9' * 5000}", "not a team file"),
    ],
)
def test_a_mistake_in_toml_has_its_line(tmp_path: Path, text: str, told: str) -> None:
    """Syntax errors have file, line and column; extreme nesting and numbers are refused too."""
    assert told in error_of(tmp_path, text)


def test_a_file_that_cannot_be_read_is_one_error(tmp_path: Path) -> None:
    """A missing file, a folder, and bytes that are not UTF-8."""
    with pytest.raises(ConfigError, match="cannot read this team file: No such file"):
        load_team(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match="cannot read this team file: Is a directory"):
        load_team(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b"x = '\xe9'")
    with pytest.raises(ConfigError, match=r"latin\.toml: not UTF-8 text \(byte 5\)"):
        load_team(tmp_path / "latin.toml")


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
    with pytest.raises(ConfigError, match=r":2: team\.world: 'garden' is neither .* nor a shipped world \(yard\)"):
        world_of(tmp_path, "world = 'garden'")


@pytest.mark.parametrize("world", [r'"a\u0000b"', f"'{'x' * 5000}'", "'.'", "'..'"])
def test_names_that_no_file_can_have_are_refused(tmp_path: Path, world: str) -> None:
    """A NUL, a name that is too long, and a folder are no worlds."""
    with pytest.raises(ConfigError, match="nor a shipped world"):
        world_of(tmp_path, f"world = {world}")


def test_a_file_without_a_world_asks_for_one(tmp_path: Path) -> None:
    """The error names the option that helps."""
    with pytest.raises(ConfigError, match="say --world FILE"):
        world_of(tmp_path, "")


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    """One line per mistake, in the order of the file, in all tables."""
    text = (
        "[team]\nsede = 1\nworld = 3\n[[robots]]\nid = 'a'\nfollow = -1\n[[robots]]\nid = 1\nfollow = 9\n"
        "[[static_transforms]]\nparent = 'map'\n[simulation]\ndazzle = 'x'\n"
    )
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    places = [line.removeprefix(f"{tmp_path}/team.toml:").split(": ")[:2] for line in str(caught.value).splitlines()]
    assert places == [
        ["2", "team.sede"],
        ["3", "team.world"],
        ["5", "robots[0].id"],
        ["6", "robots[0].follow"],
        ["9", "robots[1].follow"],
        ["10", "static_transforms[0]"],
        ["13", "simulation.dazzle"],
    ]


def test_the_size_is_bounded(tmp_path: Path) -> None:
    """A file of more than 2 MB is refused before it is parsed."""
    assert "a team file of more than 2 MB is refused" in error_of(tmp_path, "#" * (2 * 2**20 + 1))


def test_a_long_key_takes_no_memory(tmp_path: Path) -> None:
    """50,000 dotted parts, for which tomllib needs 3.7 GB, are refused with their line and without much memory."""
    path = tmp_path / "deep.toml"
    path.write_text("[[robots]]\n" + ".".join("a" * 50_000) + " = 1\n")
    tracemalloc.start()
    try:
        with pytest.raises(ConfigError, match=r"deep\.toml:2: nested too deeply: 32 levels are allowed"):
            load_team(path)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("begin", ["[[robot]]", "[[robots]]"])
def test_a_misspelt_table_is_checked_as_what_it_means(begin: str, tmp_path: Path) -> None:
    """Its own mistakes are told in the same run, with their lines."""
    (tmp_path / "team.toml").write_text(f"{begin}\nid = 0\n\nfollow = 7\n[teams]\nseed = 'x'\n")
    with pytest.raises(ConfigError) as caught:
        load_team(tmp_path / "team.toml")
    told = str(caught.value).replace(f"{tmp_path}/team.toml:", "").splitlines()
    assert told[-3:] == [
        f"4: {begin.strip('[]')}[0].follow: no robot 7 in this team (it has 0)",
        f"5: teams: unknown key (did you mean team?); known: {', '.join(KEYS)}",
        '6: teams.seed: a whole number is expected, not "x"',
    ]
    assert len(told) == (4 if begin == "[[robot]]" else 3)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_files_of_other_editors_are_read(encoding: str, tmp_path: Path) -> None:
    """A byte order mark and Windows line ends change nothing."""
    (tmp_path / "team.toml").write_bytes("[[robots]]\r\nid = 3\r\n".encode(encoding))
    assert load_team(tmp_path / "team.toml").robots == [RobotEntry(id=3)]
