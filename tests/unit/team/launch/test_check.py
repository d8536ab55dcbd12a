"""A team file checked against everything it names, before the team starts. Words: tests/support/mistakes.py."""

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from support.limits import LIMIT
from zteam import run_team
from zteam.config.resources import shipped_world
from zteam.errors import ConfigError, UsageError
from zteam.team.file.reading import read_team_file
from zteam.team.launch.check import check_team
from zteam.team.testing.team import TeamFixture

STOPPER = """
import msgspec
from zteam.behaviors import Behavior
from zteam.messages import Twist

print("a line of the module's own")

class Stopper(Behavior):
    class Params(msgspec.Struct, forbid_unknown_fields=True):
        rate: float = 1.0

    def step(self, view):
        return Twist()
"""
ROBOT = "[[robots]]\nid = 0\n"
ARENA = f'[team]\nworld = "arena"\n{ROBOT}'


def write(folder: Path, text: str) -> Path:
    """A team file of this text, and the user's behaviour beside it."""
    (folder / "my_stopper.py").write_text(STOPPER)
    path = folder / "team.toml"
    path.write_text(text)
    return path


def check(folder: Path, text: str, *, here: bool = False) -> Path | None:
    """The world of a team file of this text."""
    return check_team(read_team_file(write(folder, text)), here=here)


def mistakes_of(folder: Path, text: str, *, here: bool = False) -> list[str]:
    """Line and key of each mistake in a team file of this text, in order; those of another file as it stands."""
    with pytest.raises(ConfigError) as caught:
        check(folder, text, here=here)
    lines = str(caught.value).replace(f"{folder}/team.toml:", "").splitlines()
    return [" ".join(line.split(": ")[:2]) for line in lines]


MISTAKES = """
[team]
world = "arena"
sede = 3
map = "hall.yaml"
[[robots]]
id = 0
behaviour = "wander"
sped = 3
[[robots]]
id = 1
follow = 0
min_dist = "near"
[[robots]]
id = 5
behavior = "my_stopper:Stoper"
[[robots]]
id = 6
model = "erratic"
pose = [1.5, 2.5, 0]
behavior = "my_stopper:Stopper"
rat = 2.0
[[robots]]
id = 7
model = "eratic"
pose = [0, 0, 0]
description = "nothing.urdf"
behavior = "wandr"
[[robots]]
id = 1
model = "erratic"
pose = [4, 4, 0]
behavior = "my_stopper"
[[robots]]
id = 8
model = "erratic"
pose = [0, 0, 0]
navigation = { params = "none.yaml" }
[simulation]
gaussian_noise = -1
"""


def test_all_mistakes_are_told_at_once_with_their_lines(tmp_path: Path) -> None:
    """Mistakes in keys, parameters, behaviours, files, ids and poses are all in one error, in file order."""
    assert mistakes_of(tmp_path, MISTAKES) == [
        "4 team.sede",
        "5 team.map",
        "8 robots[0].behaviour",
        "9 robots[0].sped",
        "13 robots[1].min_dist",
        "15 robots[2].id",
        "16 robots[2].behavior",
        "20 robots[3].pose",
        "22 robots[3].rat",
        "25 robots[4].model",
        "27 robots[4].description",
        "28 robots[4].behavior",
        "30 robots[5].id",
        "30 robots[5].id",
        "33 robots[5].behavior",
        "38 robots[6].navigation",
        "40 simulation.gaussian_noise",
    ]


def test_parameters_of_navigation_are_told_with_the_file_that_has_them(tmp_path: Path) -> None:
    """Numbers out of bounds, in the team file and in a parameter file, before anything starts."""
    (tmp_path / "own.yaml").write_text("amcl: {ros__parameters: {alpha1: -1.0, laser_max_range: -1.0}}")
    table = 'navigation = { params = "own.yaml", amcl.max_particles = 2_000_000_000, amcl.z_hit = 0.4 }\n'
    with pytest.raises(ConfigError) as error:
        check(tmp_path, f"{ARENA}{table}")
    told = [line.partition("navigation: ")[2] for line in str(error.value).splitlines()]
    assert [line.partition(": a ")[0] for line in told] == ["own.yaml: amcl.alpha1", "amcl.max_particles"]


def test_a_right_team_passes_and_names_its_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The user's behaviours are imported from beside the team file and from the current folder; a world of the command
    line replaces the file's."""
    file = read_team_file(write(tmp_path, ARENA))
    assert check_team(file, shipped_world("office")) == shipped_world("office")
    elsewhere = tmp_path / "teams"
    elsewhere.mkdir()
    (elsewhere / "beside.py").write_text(STOPPER)
    robots = 'behavior = "my_stopper:Stopper"\nrate = 2\n[[robots]]\nid = 1\nbehavior = "beside:Stopper"\n'
    (elsewhere / "team.toml").write_text(f"{ARENA}{robots}")
    monkeypatch.chdir(tmp_path)
    assert check_team(read_team_file(elsewhere / "team.toml")) == shipped_world("arena")


NODES = """
[[nodes]]
name = "a"
command = ["no_such_program", "x"]
[[nodes]]
name = "b"
command = ["./own.sh"]
[[nodes]]
name = "c"
command = ["python", "gone.py"]
[[nodes]]
name = "d"
command = ["python", "-m", "http.server"]
[[nodes]]
name = "e"
command = ["python", "here.py"]
folder = "below"
[[nodes]]
name = "f"
command = ["python", "here.py"]
folder = "nowhere"
[[nodes]]
name = "g"
command = ["a\\u0000b"]
[[nodes]]
name = "goals"
command = ["zteam", "goals", "tour.yaml"]
"""


def test_programs_scripts_and_folders_of_nodes_are_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is not there is told at its place. `python` is this interpreter, and a command of zteam need not be on the
    path; a script lies in the node's folder."""
    monkeypatch.setenv("PATH", "")
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "here.py").write_text("")
    places = ["8 nodes[0].command[0]", "11 nodes[1].command[0]", "14 nodes[2].command[1]", "25 nodes[5].folder"]
    assert mistakes_of(tmp_path, f"{ARENA}{NODES}") == [*places, "28 nodes[6].command[0]"]
    (tmp_path / "own.sh").write_text("#!/bin/sh\n")
    (tmp_path / "own.sh").chmod(0o755)
    check(tmp_path, f'{ARENA}[[nodes]]\nname = "b"\ncommand = ["./own.sh"]\n')


@pytest.mark.parametrize(
    ("content", "mode", "way_out"),
    [
        (b"#!/bin/sh\n", 0o755, ""),
        (b"#! /bin/sh -e\n", 0o755, ""),
        (b"\x7fELF\x02\x01\x01\0", 0o755, ""),
        (b"#!/bin/sh\n", 0o644, "chmod +x"),
        (b"\x7fELF\x02\x01\x01\0", 0o644, "chmod +x"),
        (b"print(1)\n", 0o755, '["python", "./own", …]'),
        ("# Größe\n".encode(), 0o755, '["python", "./own", …]'),
        (b"#!/usr/bin/env python3\r\nprint(1)\r\n", 0o755, "Unix"),
        (b"\xef\xbb\xbf#!/usr/bin/env python3\nprint(1)\n", 0o755, "byte order mark"),
        (b"#!/no/such/python\n", 0o755, "first line"),
        (b"#!\n", 0o755, "first line"),
        (b"", 0o755, '["python", "./own", …]'),
        (b"MZ\x90\0\x03\n", 0o755, "Windows"),
        (None, 0o755, "is a folder"),
    ],
)
def test_a_file_that_is_no_program_is_told_as_what_it_is(
    tmp_path: Path, content: bytes | None, mode: int, way_out: str
) -> None:
    """Before anything starts, with the way out: a right, a first line, an interpreter, a program of this system."""
    own = tmp_path / "own"
    if content is None:
        own.mkdir()
    else:
        own.write_bytes(content)
    own.chmod(mode)
    text = f'{ARENA}[[nodes]]\nname = "b"\ncommand = ["./own"]\n'
    if not way_out:
        check(tmp_path, text)
        return
    with pytest.raises(ConfigError) as refused:
        check(tmp_path, text)
    assert way_out in str(refused.value)
    assert str(refused.value).startswith(f"{tmp_path}/team.toml:7: nodes[0].command[0]: ")


def test_a_program_that_lies_beside_the_file_is_named_by_its_path(tmp_path: Path) -> None:
    """One without a slash is looked for on PATH alone, as a shell does."""
    (tmp_path / "own_node.py").write_text("")
    with pytest.raises(ConfigError, match=r'"\./own_node\.py", or command = \["python", "own_node\.py", …\]'):
        check(tmp_path, f'{ARENA}[[nodes]]\nname = "b"\ncommand = ["own_node.py"]\n')


BLIND = (
    'define dot position ( size [0.3 0.3 0.3] )\ndot ( pose [0 0 0 0] name "r0" )\ndot ( pose [2 0 0 0] name "r1" )\n'
)


@pytest.mark.parametrize(
    ("robots", "place"),
    [
        ("", ""),
        ('[[robots]]\nids = "0-1"\nbehavior = "none"\n', ""),
        ('[[robots]]\nid = 5\nbehavior = "none"\nmodel = "dot"\npose = [4, 0, 0]\n', ""),
        ('[[robots]]\nid = 0\nbehavior = "idle"\n', "8 robots[0].behavior"),
        ('[[robots]]\nid = 5\nbehavior = "none"\n', "7 robots[0].id"),
    ],
)
def test_robots_that_a_users_program_drives_need_no_laser(tmp_path: Path, robots: str, place: str) -> None:
    """All others do; and the world has to have them, or gets them."""
    (tmp_path / "blind.world").write_text(BLIND)
    node = '[[nodes]]\nname = "swarm"\ncommand = ["python", "-m", "swarm"]\n'
    text = f'[team]\nworld = "blind.world"\n{node}{robots}'
    if place:
        assert mistakes_of(tmp_path, text) == [place]
    else:
        assert check(tmp_path, text) == tmp_path / "blind.world"


def test_a_team_in_one_process_that_nothing_can_reach_has_no_nodes(tmp_path: Path) -> None:
    """The fixture and `run_team` name the node's line and the way out; nothing starts."""
    path = write(tmp_path, f'{ARENA}[[nodes]]\nname = "a"\ncommand = ["python"]\n')
    team = TeamFixture()
    try:
        with pytest.raises(ConfigError, match=r"team\.toml:7: nodes\[0\]\.command: .*leave in_process out"):
            team.launch(path, in_process=True)
        assert team.report_log() == ""
    finally:
        team.close()
    with pytest.raises(ConfigError, match="give run_team a bus, or use zteam up"):
        run_team(path, seconds=1.0)


def test_a_broken_world_file_is_told_with_the_rest(tmp_path: Path) -> None:
    """Mistakes of the world file have that file's name and lines."""
    (tmp_path / "yard.world").write_text("define x position (\n")
    first, second = mistakes_of(tmp_path, f'[team]\nworld = "yard.world"\n{ROBOT}speeed = 1\n')
    assert first == "5 robots[0].speeed"
    assert second.startswith(f"{tmp_path}/yard.world:")


def test_real_robots_need_no_world(tmp_path: Path) -> None:
    """Without a world any id is allowed, and everything else is still checked."""
    text = '[team]\nworld = "none"\n[[robots]]\nid = 70\n'
    assert check(tmp_path, text) is None
    assert mistakes_of(tmp_path, f'{text}speed = "fast"\n') == ["5 robots[0].speed"]


def test_a_team_without_its_world_robots_adds_its_own(tmp_path: Path) -> None:
    """With `world_robots = false` each robot needs a model and a pose."""
    text = f'[team]\nworld = "arena"\nworld_robots = false\n{ROBOT}'
    assert mistakes_of(tmp_path, text) == ["5 robots[0].id"]
    check(tmp_path, text + 'model = "erratic"\npose = [0, 0, 0]\n')


def test_a_world_too_large_for_its_map_is_told_before_the_start(tmp_path: Path) -> None:
    """With the key that makes its cells larger; a team with another map, or whose run has larger cells, may start."""
    (tmp_path / "big.world").write_text(
        "model ( size [2000 2000 1] boundary 1 noblocks 1 )\nposition ( ranger ( sensor ( samples 9 ) ) )"
    )
    text = f'[team]\nworld = "big.world"\n{ROBOT}'
    with pytest.raises(
        ConfigError, match=r"team.toml: simulation.map_resolution: .* map_resolution = 0.26 .* --map-res"
    ):
        check(tmp_path, text)
    assert mistakes_of(tmp_path, f"{text}[simulation]\nmap_resolution = 0.1\n") == ["6 simulation.map_resolution"]
    check(tmp_path, f"{text}[simulation]\nmap_resolution = 0.26\n")
    report = run_team(write(tmp_path, text), seconds=0.1, map_resolution=20.0)
    assert report.ticks == 2
    for metres in (0.0, 1e9):
        with pytest.raises(UsageError, match="map_resolution"):
            run_team(write(tmp_path, text), seconds=0.1, map_resolution=metres)


@pytest.mark.ci
def test_the_check_needs_no_engine(tmp_path: Path) -> None:
    """The launcher stays small and fast: the check imports neither the engine nor pymunk nor the user's modules."""
    path = write(tmp_path, f'{ARENA}behavior = "my_stopper:Stopper"\n')
    code = (
        "import sys; from pathlib import Path; from zteam.team.file.reading import read_team_file; "
        f"from zteam.team.launch.check import check_team; check_team(read_team_file(Path({str(path)!r}))); "
        "print({'zteam.simulator.core.engine', 'pymunk', 'my_stopper'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True)
    assert done.stdout == "set()\n"


@pytest.mark.parametrize("text", ["resolution: 0.05\norigin: [0, 0, 0]\n", "image: none.pgm\nresolution: 0.05\n"])
def test_a_map_that_cannot_be_served_is_told_before_the_start(tmp_path: Path, text: str) -> None:
    """At the line of the key."""
    (tmp_path / "hall.yaml").write_text(text)
    assert mistakes_of(tmp_path, f'[team]\nworld = "arena"\nmap = "hall.yaml"\n{ROBOT}') == ["3 team.map"]


@pytest.mark.parametrize("table", ['map = "hall.yaml"\n', "[simulation]\nmap_resolution = 0.003\n"])
def test_a_radius_of_too_many_cells_of_the_map_is_told_before_the_start(tmp_path: Path, table: str) -> None:
    """Whether the map is a file's or the simulator's, and also where the radius is the default one, 0.7 m."""
    Image.new("L", (9, 9), 255).save(tmp_path / "hall.png")
    (tmp_path / "hall.yaml").write_text("image: hall.png\nresolution: 0.003\norigin: [0, 0, 0]\n")
    text = f'[team]\nworld = "arena"\n{table}{ROBOT}navigation = '
    line = text.count("\n") + 1
    assert mistakes_of(tmp_path, f"{text}true\n") == [f"{line} robots[0].navigation"]
    check(tmp_path, f"{text}{{ global_costmap = {{ inflation_layer = {{ inflation_radius = 0.5 }} }} }}\n")


WORLD = """
define bare position( size [0.4 0.4 0.3] )
define seeing bare( ranger( sensor( samples 181 fov 180 range [0 8] ) ) )
model( name "block" size [1 1 1] pose [3 0 0 0] )
bare( name "blind" pose [0 0 0 0] )
seeing( name "inside" pose [3.2 0 0 0] )
seeing( name "under" pose [-3 0 0 0] )
seeing( name "over" pose [-3.1 0 0 0] )
seeing( name "free" pose [0 3 0 0] )
seeing( name "car" pose [0 -3 0 0] drive "car" )
"""
FEELER = STOPPER.replace(
    "class Params", 'inputs = {"bumps": ("bumper", Bumper), "near": ("sonar_0", Range)}\n    class Params'
).replace("import Twist", "import Bumper, Range, Twist")


def test_a_robot_that_cannot_drive_in_its_world_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that stands in a thing or in another robot, one without a sensor that its behaviour needs, and a car that
    navigation is to drive. A node may bring a sensor, unless it is the laser: without it no robot drives."""
    (tmp_path / "my.world").write_text(WORLD)
    (tmp_path / "its_feeler.py").write_text(FEELER)
    monkeypatch.syspath_prepend(tmp_path)
    text = '[team]\nworld = "my.world"\n[[robots]]\nids = "0,1,3"\nbehavior = "wander"\n'
    feeler = '[[robots]]\nid = 4\nbehavior = "its_feeler:Stopper"\n'
    laser = "5 robots[0].behavior"
    standing = ["4 robots[0].ids"] * 2
    assert mistakes_of(tmp_path, text + feeler, here=True) == [*standing, laser, *["8 robots[1].behavior"] * 2]
    for navigation in ("true", "{}", '{ localizer = "amcl" }'):
        car = f'[team]\nworld = "my.world"\n[[robots]]\nid = 5\nbehavior = "wander"\nnavigation = {navigation}\n'
        assert mistakes_of(tmp_path, car) == ["6 robots[0].navigation"]
    node = '[[nodes]]\nname = "skin"\ncommand = ["python", "-c", "pass"]\n'
    assert mistakes_of(tmp_path, text + feeler + node, here=True) == [*standing, laser]
