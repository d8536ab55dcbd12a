"""Mistakes in one team file: each is one error at the line and the key. Their words: tests/support/mistakes.py."""

import tracemalloc
from pathlib import Path

import pytest

from zteam.errors import ConfigError
from zteam.team.file.reading import load_team

ROBOT = "[[robots]]\nid=0\n"
TWO = f"{ROBOT}[[robots]]\nid=1\n"
ADDED = f"{ROBOT}model='e'\n"
FRAME = f"{ROBOT}[[static_transforms]]\nparent='map'\n"
CHILD = f"{FRAME}child='a'\n"
NODE = f"{ROBOT}[[nodes]]\n"
GRANTS = f"{ROBOT}[security.grants]\n"
NODES = ("a:b", "tf", "sim", "map", "monitor", "router", "robot_0", "nav_0", "up", "view_2", "operator", "clock", "ca")
MISTAKES = [
    # Robots and their groups.
    ("", ""),
    ("robots = []", "1: robots"),
    ("robots = 3", "1: robots"),
    ("robots = [3]", "1: robots[0]"),
    ("[robots]\nid = 1", "1: robots"),
    ("[[robots]]\nbehavior = 'avoid'", "1: robots[0]"),
    *((f"{ROBOT}[[robots]]\nid = {value}", "4: robots[1].id") for value in ("'1'", "true", "1.0", "-1", "10000", "0")),
    (f"[[robots]]\nid = 1{'0' * 40}", "2: robots[0].id"),
    (f"{ROBOT}behavior = ''", "3: robots[0].behavior"),
    *(
        (f"{ROBOT}behavior = 'none'\n{given}", f"4: robots[0].{given.split()[0]}")
        for given in (
            "speed = 1",
            "navigation = true",
            "navigation = {}",
            "safety = false",
            "restart = 'no'",
        )
    ),
    (f"{ROBOT}restart = 1", "3: robots[0].restart"),
    (f"{ROBOT}when = 1979-05-27", "3: robots[0].when"),
    (f"{ROBOT}x = 0xffffffffffffffffffff", "3: robots[0].x"),
    (f"{ROBOT}'max speed' = 1", '3: robots[0]."max speed"'),
    (f"{ROBOT}model = 'erratic'", "3: robots[0].model"),
    (f"{ROBOT}pose = [1, 2, 3]", "3: robots[0].pose"),
    *((f"{ADDED}pose = [1, {pose}]", "4: robots[0].pose") for pose in ("2", "nan, 2", "inf, 2", "2, 90")),
    *((f"[[robots]]\nids = {ids}", "2: robots[0].ids") for ids in ("'0-10000'", "''", "'3-1'", "'1,1'", "[1]", "true")),
    (f"{ROBOT}ids = '1-2'", "3: robots[0].ids"),
    (f"{ROBOT}[[robots]]\nids = '0-7'", "4: robots[1].ids"),
    ("[[robots]]\nids = '1-7'\n[[robots]]\nids = '3-9'", "4: robots[1].ids"),
    (f"{ROBOT}pose_step = [1, 2]", "3: robots[0].pose_step"),
    ("[[robots]]\nids = '1-2'\npose_step = [1, 2]", "3: robots[0].pose_step"),
    ("[[robots]]\nids = '1-2'\nmodel='e'\npose=[0, 0, 0]\npose_step = [1, inf]", "5: robots[0].pose_step"),
    # What all robots share.
    (f"defaults = 3\n{ROBOT}", "1: defaults"),
    (f"[defaults]\nid = 3\n{ROBOT}", "2: defaults.id"),
    (f"[default]\nspeed = 3\n{ROBOT}", "1: default"),
    (f"[defaults]\nrestart = 'always'\n{TWO}", "2: defaults.restart"),
    # Leaders.
    *((f"{ROBOT}follow = {leader}", "3: robots[0].follow") for leader in ("0", "4", "-4", "'previous'", "'previos'")),
    (f"{ROBOT}behavior = 'follow'", "3: robots[0].behavior"),
    (f"{ROBOT}leader = 1", "3: robots[0].leader"),
    (f"{TWO}follow=0\nbehavior='avoid'", "5: robots[1].follow"),
    (f"{TWO}follow=0\nleader=2", "6: robots[1].leader"),
    # A circle is told once, and not for the robot that only leads into it.
    (f"{TWO}follow=2\n[[robots]]\nid=2\nfollow=1", "5: robots[1].follow"),
    (f"[[robots]]\nid=5\nfollow=1\n{TWO}follow=2\n[[robots]]\nid=2\nfollow=1", "8: robots[2].follow"),
    # A leader with mistakes still exists, and so does one whose id cannot be read.
    (f"{ROBOT}behavior=3\n[[robots]]\nid=1\nfollow=0", "3: robots[0].behavior"),
    ("[[robots]]\nid = 'x'\n[[robots]]\nids='1-2'\nfollow='previous'", "2: robots[0].id"),
    ("[[robots]]\nids = 'x'\n[[robots]]\nid=1\nfollow='previous'", "2: robots[0].ids"),
    # Bases.
    (f"{ROBOT}[robots.base]\nmax_vel_x = 0", "4: robots[0].base.max_vel_x"),
    (f"{ROBOT}[robots.base]\nspeed = 1", "4: robots[0].base.speed"),
    (f"{ROBOT}[robots.base]\nfootprint = [\n[0, 0], [1, 0], [2, 0]]", "4: robots[0].base.footprint"),
    (f"{ROBOT}base = {{footprint = [[0, 0], [1, 0], [1, 'a']]}}", "3: robots[0].base.footprint[2][1]"),
    (f"{ROBOT}base = 'wide'", "3: robots[0].base"),
    # Other tables.
    (f"[team]\nwrld = 'x'\n{ROBOT}", "2: team.wrld"),
    (f"[team]\nseed = -1\n{ROBOT}", "2: team.seed"),
    (f"[simulation]\nno_hti = 1\n{ROBOT}", "2: simulation.no_hti"),
    (f"[simulation]\ndazzle = 'x'\n{ROBOT}", "2: simulation.dazzle"),
    (f"[simulation]\ngaussian_noise = -1\n{ROBOT}", "2: simulation.gaussian_noise"),
    ("[[robot]]\nid = 0", "1: robot"),
    (f"[Team]\nseed = 1\n{ROBOT}", "1: Team"),
    *((f"{GRANTS}view = [{word}]", "4: security.grants.view") for word in ("'golas'", "3")),
    (f"{GRANTS}view = 'goals'", "4: security.grants.view"),
    (f"{GRANTS}'a b' = []", '4: security.grants."a b"'),
    (f"{GRANTS}tf_static = []", "4: security.grants.tf_static"),
    (f"{ROBOT}[security]\ngrant = []", "4: security.grant"),
    # Nodes: a name that the bus can carry and that nothing else of the team has, and a command.
    *((f"{NODE}name='{name}'\ncommand=['x']", "4: nodes[0].name") for name in NODES),
    (f"{NODE}name='a'\ncommand=['x']\n[[nodes]]\nname='a'\ncommand=['x']", "7: nodes[1].name"),
    (f"{NODE}name='a'\ncommand=[]", "5: nodes[0].command"),
    (f"{NODE}name='a'\ncommand=[[1]]", "5: nodes[0].command[0]"),
    (f"{NODE}name='a'\ncommand=['x']\nexpects=true", "6: nodes[0].expects"),
    (f"{NODE}name='a'", "3: nodes[0]"),
    # Transforms: a frame has one parent of another name, finite numbers, and a valid rotation.
    (FRAME, "3: static_transforms[0]"),
    (f"{CHILD}w=1", "6: static_transforms[0].w"),
    *((f"{FRAME}child='{child}'", "5: static_transforms[0].child") for child in ("/map", "/")),
    (f"{FRAME}child=''", "5: static_transforms[0].child"),
    (f"{CHILD}x=nan", "6: static_transforms[0].x"),
    (f"{CHILD}z=-1e300", "6: static_transforms[0].z"),
    (f"{CHILD}roll=-45", "6: static_transforms[0].roll"),
    (f"{CHILD}qw=1", "6: static_transforms[0].qw"),
    *((f"{CHILD}qx=0\nqy=0\nqz=0\nqw={w}", "9: static_transforms[0].qw") for w in ("0", "0.9", "1.1", "1\nyaw=1")),
    (f"{CHILD}qx=0\nqy=0\nqz=0\nqw=inf", "9: static_transforms[0].qw"),
    (f"{CHILD}[[static_transforms]]\nparent='b'\nchild='/a'", "8: static_transforms[1].child"),
    # No TOML: the line and the column.
    ("[[robots]]\nid = \n", "2:6"),
    ("[team\n", "1:6"),
    ("id = 1\nid = 2\n", "2:7"),
    (f"x = {'[' * 5000}", "1"),
    (f"[[robots]]\nid = 0\n{'.'.join('a' * 5000)} = 1", "3"),
    (f"x = {'9' * 5000}", ""),
]


@pytest.mark.parametrize(("text", "place"), MISTAKES, ids=[f"{text[-30:]!r}" for text, _ in MISTAKES])
def test_a_mistake_is_one_line_at_its_place(tmp_path: Path, text: str, place: str) -> None:
    """Of file, line and key; a mistake that concerns several robots is told once."""
    path = tmp_path / "team.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as told:
        load_team(path)
    assert str(told.value).startswith(f"{path}:{place}: " if place else f"{path}: ")
    assert "\n" not in str(told.value)


def test_all_mistakes_are_told_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    """One line for each; a table with a misspelt name is one."""
    path = tmp_path / "team.toml"
    path.write_text(
        "[team]\nsede = 1\nworld = {}\n[[robots]]\nid = 'a'\nfollow = -1\n[[robots]]\nid = 1\nfollow = 9\n"
        "[[static_transforms]]\nparent = 'map'\n[simulation]\ndazzle = 'x'\n[teams]\nseed = 'x'\n"
    )
    with pytest.raises(ConfigError) as told:
        load_team(path)
    places = [line.removeprefix(f"{path}:").split(": ")[:2] for line in str(told.value).splitlines()]
    assert places == [
        ["2", "team.sede"],
        ["3", "team.world"],
        ["5", "robots[0].id"],
        ["6", "robots[0].follow"],
        ["9", "robots[1].follow"],
        ["10", "static_transforms[0]"],
        ["13", "simulation.dazzle"],
        ["14", "teams"],
    ]


@pytest.mark.parametrize(
    ("data", "told"),
    [(None, "No such file"), (b"x = '\xe9'", "save it as UTF-8"), (b"#" * (2 * 2**20 + 1), "more than 2 MB")],
)
def test_a_file_that_cannot_be_read_is_one_error(tmp_path: Path, data: bytes | None, told: str) -> None:
    """One that is not there, that is not UTF-8, or of more than 2 MB; and a folder."""
    path = tmp_path / "team.toml"
    if data is not None:
        path.write_bytes(data)
    for each, text in ((path, told), (tmp_path, "Is a directory")):
        with pytest.raises(ConfigError, match=f"^{each}: .*{text}"):
            load_team(each)


def test_a_long_key_takes_no_memory(tmp_path: Path) -> None:
    """50,000 dotted parts, for which tomllib needs 3.7 GB, are refused without much memory."""
    path = tmp_path / "deep.toml"
    path.write_text("[[robots]]\n" + ".".join("a" * 50_000) + " = 1\n")
    tracemalloc.start()
    try:
        with pytest.raises(ConfigError):
            load_team(path)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()
