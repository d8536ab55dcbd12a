"""A team file checked against everything it names, before the team starts, and what depends on the seed."""

import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam import run_team
from zteam.config.resources import shipped_world
from zteam.errors import ConfigError
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


MISTAKES = """
[team]
world = "arena"
sede = 3

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

[simulation]
gaussian_noise = -1
"""


TOLD = [
    "4: team.sede: unknown key (did you mean seed?); known: world, seed, world_robots, restart, map",
    "8: robots[0].behaviour: unknown key (did you mean behavior?); forward takes speed",
    "9: robots[0].sped: unknown key (did you mean speed?); forward takes speed",
    '14: robots[1].min_dist: a number is expected, not "near"',
    "17: robots[2].id: the world has no robot 5 (it has 0, 1); model and pose add one",
    "18: robots[2].behavior: behaviour 'my_stopper:Stoper': module my_stopper (…) has no Stoper (did you mean …?)",
    "23: robots[3].pose: it would stand in 'crate_0'; give a free place as x, y, yaw",
    "25: robots[3].rat: unknown key (did you mean rate?); my_stopper:Stopper takes rate",
    "29: robots[4].model: arena: no robot macro 'eratic' in this world; there are: erratic",
    "31: robots[4].description: …/nothing.urdf: cannot read this robot description: No such file or directory",
    "32: robots[4].behavior: no behaviour 'wandr' (did you mean wander?): use idle, forward, …",
    "35: robots[5].id: robot 1 is robots[1] already; give each robot its own id",
    "35: robots[5].id: the world has a robot 1 already: leave model and pose out, or give another id",
    "38: robots[5].behavior: no behaviour 'my_stopper' (did you mean my_stopper:Stopper?): use idle, forward, …",
    "41: simulation.gaussian_noise: must be from 0 to 1000, not -1",
]


def write(folder: Path, text: str) -> Path:
    """A team file of this text, and the user's behaviour beside it."""
    (folder / "my_stopper.py").write_text(STOPPER)
    path = folder / "team.toml"
    path.write_text(text)
    return path


def test_all_mistakes_are_told_at_once_with_their_lines(tmp_path: Path) -> None:
    """Mistakes in keys, parameters, behaviours, descriptions, ids and poses are all in one error, in file order."""
    path = write(tmp_path, MISTAKES)
    with pytest.raises(ConfigError) as caught:
        check_team(read_team_file(path))
    lines = str(caught.value).splitlines()
    for line, told in zip(lines, TOLD, strict=True):
        parts = f"{path}:{told}".split("…")
        assert line.startswith(parts[0]) and line.endswith(parts[-1] if len(parts) > 1 else told), line


def test_a_right_team_passes_and_names_its_world(tmp_path: Path) -> None:
    """The user's behaviour is imported from beside the team file; a world of the command line replaces the file's."""
    good = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "my_stopper:Stopper"\nrate = 2\n'
    file = read_team_file(write(tmp_path, good))
    assert check_team(file) == shipped_world("arena")
    assert check_team(file, shipped_world("office")) == shipped_world("office")


def test_the_fixture_checks_a_team_file_too(tmp_path: Path) -> None:
    """`team.launch` of a wrong team file raises an error with file and line, and no process starts."""
    path = write(tmp_path, '[team]\nworld = "arena"\n[[robots]]\nid = 0\n[[robots]]\nid = 5\nfollow = 0\n')
    team = TeamFixture()
    try:
        with pytest.raises(ConfigError, match=r"team\.toml:6: robots\[1\]\.id: the world has no robot 5"):
            team.launch(path)
        assert team._watch.log == []
    finally:
        team.close()


NODES = """
[team]
world = "arena"
[[robots]]
id = 0
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
"""


def test_programs_scripts_and_folders_of_nodes_are_looked_for(tmp_path: Path) -> None:
    """What is not there is told with its place; `python` is this interpreter; a script lies in the node's folder."""
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "here.py").write_text("")
    path = write(tmp_path, NODES)
    with pytest.raises(ConfigError) as caught:
        check_team(read_team_file(path))
    assert str(caught.value).replace(f"{path}:", "").splitlines() == [
        "8: nodes[0].command[0]: there is no program 'no_such_program' on PATH",
        f"11: nodes[1].command[0]: there is no program './own.sh' in {tmp_path}",
        f"14: nodes[2].command[1]: there is no file 'gone.py' in {tmp_path}",
        f"25: nodes[5].folder: there is no folder {tmp_path}/nowhere",
        "28: nodes[6].command[0]: there is no program 'a\\x00b' on PATH",
    ]
    (tmp_path / "own.sh").write_text("")
    (tmp_path / "own.sh").chmod(0o755)
    own = write(
        tmp_path, '[team]\nworld = "arena"\n[[robots]]\nid = 0\n[[nodes]]\nname = "b"\ncommand = ["./own.sh"]\n'
    )
    check_team(read_team_file(own))


def test_a_team_in_one_process_that_nothing_can_reach_has_no_nodes(tmp_path: Path) -> None:
    """The fixture and `run_team` name the node's line and the way out; nothing starts."""
    path = write(tmp_path, '[team]\nworld = "arena"\n[[robots]]\nid = 0\n[[nodes]]\nname = "a"\ncommand = ["python"]\n')
    told = r"team\.toml:7: nodes\[0\]\.command: a node is a process, which cannot reach a team in one process: "
    team = TeamFixture()
    try:
        with pytest.raises(ConfigError, match=f"{told}leave in_process out"):
            team.launch(path, in_process=True)
        assert team._watch.log == []
    finally:
        team.close()
    with pytest.raises(ConfigError, match=f"{told}give run_team a bus, or use zteam up"):
        run_team(path, seconds=1.0)


def test_a_behaviour_in_the_current_folder_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A team file in another folder may name a module in the current folder."""
    elsewhere = tmp_path / "teams"
    elsewhere.mkdir()
    (tmp_path / "my_own.py").write_text(STOPPER)
    path = elsewhere / "team.toml"
    path.write_text('[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "my_own:Stopper"\n')
    monkeypatch.chdir(tmp_path)
    assert check_team(read_team_file(path)) == shipped_world("arena")


def test_a_broken_world_file_is_told_with_the_rest(tmp_path: Path) -> None:
    """Mistakes of the world file have that file's name and lines."""
    (tmp_path / "yard.world").write_text("define x position (\n")
    path = write(tmp_path, '[team]\nworld = "yard.world"\n[[robots]]\nid = 0\nspeeed = 1\n')
    with pytest.raises(ConfigError) as caught:
        check_team(read_team_file(path))
    first, second = str(caught.value).splitlines()
    assert first.startswith(f"{path}:5: robots[0].speeed: unknown key (did you mean speed?)")
    assert second.startswith(f"{tmp_path}/yard.world:")


def test_real_robots_need_no_world(tmp_path: Path) -> None:
    """Without a world any id is allowed, and everything else is still checked."""
    path = write(tmp_path, '[team]\nworld = "none"\n[[robots]]\nid = 70\n')
    assert check_team(read_team_file(path)) is None
    path = write(tmp_path, '[team]\nworld = "none"\n[[robots]]\nid = 70\nspeed = "fast"\n')
    with pytest.raises(ConfigError, match=r":5: robots\[0\]\.speed: a number is expected"):
        check_team(read_team_file(path))


def test_a_team_without_its_world_robots_adds_its_own(tmp_path: Path) -> None:
    """With `world_robots = false` each robot needs a model and a pose."""
    text = '[team]\nworld = "arena"\nworld_robots = false\n[[robots]]\nid = 0\n'
    with pytest.raises(ConfigError, match=r"robots\[0\]\.id: the world has no robot 0 \(it has none\)"):
        check_team(read_team_file(write(tmp_path, text)))
    check_team(read_team_file(write(tmp_path, text + 'model = "erratic"\npose = [0, 0, 0]\n')))


@pytest.mark.ci
def test_the_check_needs_no_engine(tmp_path: Path) -> None:
    """The launcher stays small and fast: the check imports neither the engine nor pymunk nor the user's modules."""
    path = write(tmp_path, '[team]\nworld = "office"\n[[robots]]\nid = 0\nbehavior = "my_stopper:Stopper"\n')
    code = (
        "import sys; from pathlib import Path; from zteam.team.file.reading import read_team_file; "
        f"from zteam.team.launch.check import check_team; check_team(read_team_file(Path({str(path)!r}))); "
        "print({'zteam.simulator.core.engine', 'pymunk', 'my_stopper'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True)
    assert done.stdout == "set()\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "cannot read this map"),
        ("resolution: 0.05\norigin: [0, 0, 0]\n", "image: the name of the map's image is missing"),
        ("image: none.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n", "none.pgm, the map's image"),
    ],
)
def test_a_map_that_cannot_be_served_is_told_before_the_start(tmp_path: Path, text: str | None, told: str) -> None:
    """At the line of the key."""
    if text is not None:
        (tmp_path / "hall.yaml").write_text(text)
    path = tmp_path / "team.toml"
    path.write_text('[team]\nworld = "arena"\nmap = "hall.yaml"\n[[robots]]\nid = 0\n')
    with pytest.raises(ConfigError) as raised:
        check_team(read_team_file(path))
    (line,) = str(raised.value).splitlines()
    assert line.startswith(f"{path}:3: team.map: ")
    assert told in line


def test_commands_of_zteam_need_not_be_on_the_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A node `zteam goals …` runs with the team's own interpreter."""
    monkeypatch.setenv("PATH", "")
    path = tmp_path / "team.toml"
    node = '[[nodes]]\nname = "goals"\ncommand = ["zteam", "goals", "tour.yaml"]\n'
    path.write_text(f'[team]\nworld = "arena"\n[[robots]]\nid = 0\n{node}')
    check_team(read_team_file(path))


ROBOTS_OF_A_WORLD = """
define bare position( size [0.4 0.4 0.3] )
define seeing bare( ranger( sensor( samples 181 fov 180 range [0 8] ) ) )
model( name "block" size [1 1 1] pose [3 0 0 0] )
bare( name "blind" pose [0 0 0 0] )
seeing( name "inside" pose [3.2 0 0 0] )
seeing( name "under" pose [-3 0 0 0] )
seeing( name "over" pose [-3.1 0 0 0] )
seeing( name "free" pose [0 3 0 0] )
"""


def test_a_robot_that_cannot_drive_in_its_world_is_told(tmp_path: Path) -> None:
    """One without the sensor that its behaviour needs, and one that stands in a thing or in another robot."""
    (tmp_path / "my.world").write_text(ROBOTS_OF_A_WORLD)
    (tmp_path / "feeler.py").write_text(
        STOPPER.replace(
            "class Params", 'inputs = {"bumps": ("bumper", Bumper), "near": ("sonar_0", Range)}\n    class Params'
        ).replace("import Twist", "import Bumper, Range, Twist")
    )
    text = '[team]\nworld = "my.world"\n[[robots]]\nids = "0,1,3"\nbehavior = "wander"\n'
    path = write(tmp_path, text + '[[robots]]\nid = 4\nbehavior = "feeler:Stopper"\n')
    with pytest.raises(ConfigError) as caught:
        check_team(read_team_file(path))
    assert str(caught.value).replace(f"{path}:", "").splitlines() == [
        "4: robots[0].ids: at its pose in my.world robot 1 would stand in 'block'; give 'inside' a free pose there",
        "4: robots[0].ids: at its pose in my.world robot 3 would stand in robot 2; give 'over' a free pose there",
        *(
            f"{place}.behavior: {what} for it: add one to {model}) in my.world, or give it another model"
            for place, what, model in (
                ("5: robots[0]", "wander needs base_scan, but robot 0 carries no laser", "'blind' (model bare"),
                ("8: robots[1]", "feeler:Stopper needs bumper, but robot 4 carries no bumper", "'free' (model seeing"),
                ("8: robots[1]", "feeler:Stopper needs sonar_0, but robot 4 carries no sonar", "'free' (model seeing"),
            )
        ),
    ]


def test_a_node_may_bring_the_sensor_that_a_robot_lacks(tmp_path: Path) -> None:
    """Only the laser is the simulator's own: without it no robot drives."""
    (tmp_path / "my.world").write_text(ROBOTS_OF_A_WORLD)
    behavior = STOPPER.replace("class Params", 'inputs = {"bumps": ("bumper", Bumper)}\n    class Params')
    (tmp_path / "feeler.py").write_text(behavior.replace("import Twist", "import Bumper, Twist"))
    robot = '[team]\nworld = "my.world"\n[[robots]]\nid = {}\nbehavior = "feeler:Stopper"\n'
    node = '[[nodes]]\nname = "skin"\ncommand = ["python", "-c", "pass"]\n'
    check_team(read_team_file(write(tmp_path, robot.format(4) + node)))
    with pytest.raises(ConfigError, match="robot 0 carries no laser"):
        check_team(read_team_file(write(tmp_path, robot.format(0) + node)))
