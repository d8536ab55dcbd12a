"""What a recording holds of its team, and the same team again from it."""

import json
import sys
from pathlib import Path

import pytest

from zteam.config.resources import find_world
from zteam.errors import UsageError
from zteam.node.process_options import NodeOptions, RecorderOptions
from zteam.simulator.world import load_world
from zteam.team.file.reading import load_team
from zteam.team.launch.plan import Pace, TeamLaunch, to_builtins
from zteam.team.launch.recorded import LAUNCH, contents_of, restore

TEAM = """
static_transforms = [{parent = "map", child = "dock", x = 1.5}]
[team]
world = "rooms/my.world"
[[robots]]
id = 0
behavior = "turner:Turner"
description = "robot.urdf"
far = inf
"""
URDF = '<robot name="r"><link name="base_link"/></robot>'


@pytest.fixture
def launch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> TeamLaunch:
    """A team whose files lie in a folder of the user's."""
    folder = tmp_path / "lab"
    (folder / "rooms").mkdir(parents=True)
    office = find_world("office")
    text = office.read_text()
    (folder / "rooms" / "my.world").write_text(text)
    (folder / "rooms" / "office.png").write_bytes((office.parent / "office.png").read_bytes())
    (folder / "robot.urdf").write_text(URDF)
    (folder / "turner.py").write_text("raise ImportError('it is not to be imported')")
    (folder / "team.toml").write_text(TEAM)
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    file = folder / "team.toml"
    pace = Pace(lockstep=True, expect=("scout",))
    own = {"scout": NodeOptions("scout", "scout:main")}
    return TeamLaunch(load_team(file), folder / "rooms" / "my.world", 7, file, 5.0, pace=pace, own=own)


def contents(launch: TeamLaunch) -> dict[str, bytes]:
    """The attachments of a recording of this launch."""
    return contents_of(RecorderOptions(Path("run.mcap"), launch=to_builtins(launch)))


def test_a_launch_is_the_same_from_its_recording(launch: TeamLaunch, tmp_path: Path) -> None:
    """With all files that it reads, in another folder, though those of before are gone."""
    found = contents(launch)
    world = launch.world
    assert world is not None
    before = load_world(world)
    for each in (world, world.parent / "office.png", Path("robot.urdf")):
        each.unlink()
    again, changed = restore(found, tmp_path / "again")
    assert changed == []
    assert again.world is not None
    assert again.world.is_relative_to(tmp_path / "again")
    assert len(load_world(again.world).robots) == len(before.robots)
    assert again.team_file is not None
    assert (again.team_file.parent / "robot.urdf").read_text() == URDF
    same = {"team", "given_seed", "run_for", "pace", "own"}
    assert {name: getattr(again, name) for name in same} == {name: getattr(launch, name) for name in same}


def test_another_source_is_named(launch: TeamLaunch, tmp_path: Path) -> None:
    """That of a behaviour which has changed since, or is gone. Its module is not imported for that."""
    found = contents(launch)
    Path("turner.py").write_text("# another one")
    assert restore(found, tmp_path / "a")[1] == ["turner:Turner"]
    Path("turner.py").unlink()
    assert restore(found, tmp_path / "b")[1] == ["turner:Turner"]


@pytest.mark.parametrize("launch_text", [b"", b"{", b"[]", b'{"launch": {}, "root": "/", "sources": {}}'])
def test_what_holds_no_team_is_refused(launch_text: bytes, tmp_path: Path) -> None:
    """With one line."""
    with pytest.raises(UsageError):
        restore({LAUNCH: launch_text} if launch_text else {}, tmp_path)


def test_no_file_is_written_elsewhere(launch: TeamLaunch, tmp_path: Path) -> None:
    """Whatever a recording calls it."""
    found = {**contents(launch), "files/../evil": b"x", f"files/{tmp_path}/evil": b"x"}
    assert json.loads(found[LAUNCH])
    restore(found, tmp_path / "again")
    assert not list(tmp_path.glob("evil"))
