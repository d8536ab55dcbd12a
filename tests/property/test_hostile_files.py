"""Hostile files: each is read, or refused with one line a mistake that names the file; nothing else happens."""

import logging
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from support.examples import examples
from support.hostile import damaged
from support.limits import LIMIT
from support.pages import ROOT
from zteam.clock import monotonic
from zteam.config.map_files import read_floor_map
from zteam.config.resources import teams_folder, worlds_folder
from zteam.errors import UsageError
from zteam.messages import JointState
from zteam.navigation.goals import read_goals
from zteam.navigation.planning.maps import read_map
from zteam.navigation.planning.parameters import navigation_of_robot
from zteam.simulator.core import Engine
from zteam.simulator.core.occupancy_grid import map_message
from zteam.team.file.reading import read_team_file
from zteam.team.launch.check import check_team
from zteam.transforms.urdf import read_description
from zteam.world import load_world

log = logging.getLogger("hostile")
WORLDS = ROOT / "tests" / "golden" / "worlds"
GROWTH = 600
"""MB that a file may take while it is read: the largest bitmap that is not refused has 64 million pixels."""
MAP = b"""image: house.pgm
mode: trinary
resolution: 0.05
origin: [-1.0, -2.0, 0.5]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
URDF = b"""<?xml version="1.0"?><robot name="bot"><link name="base_link"/>
  <link name="camera"/><link name="wheel"/><link name="rim"/>
  <joint name="camera" type="fixed"><parent link="base_link"/><child link="camera"/>
    <origin xyz="0.1 0 0.3" rpy="0 0 1.57"/></joint>
  <joint name="left" type="continuous"><parent link="base_link"/><child link="wheel"/><axis xyz="0 2 0"/></joint>
  <joint name="right" type="revolute"><parent link="wheel"/><child link="rim"/><axis xyz="0 1 0"/>
    <mimic joint="left" multiplier="-2" offset="0.5"/></joint></robot>
"""
PARAMETERS = b"""nav_0:
  ros__parameters: {localizer: amcl}
controller_server:
  ros__parameters:
    controller_frequency: 10.0
    FollowPath: {desired_linear_vel: 0.5, lookahead_dist: 0.6}
local_costmap:
  local_costmap:
    ros__parameters: {width: 3, height: 3, resolution: 0.05, footprint: "[[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1]]"}
"""
WITH_BITMAP = 'model ( name "floor" size [10 8 1] bitmap "{name}" )\nposition ( pose [0 0 0 0] )\n'


def _use_world(path: Path) -> None:
    """What the simulator does with it before its first answer."""
    world = load_world(path)
    Engine(world).step({})
    map_message(world, 0.1)


def _use_bitmap(path: Path) -> None:
    world = path.with_suffix(".world")
    world.write_text(WITH_BITMAP.format(name=path.name))
    _use_world(world)


def _use_team(path: Path) -> None:
    check_team(read_team_file(path), here=True)


def _use_map(path: Path) -> None:
    read_map(path)
    read_floor_map(path)


def _use_map_image(path: Path) -> None:
    file = path.with_suffix(".yaml")
    file.write_bytes(MAP.replace(b"house.pgm", path.name.encode()))
    _use_map(file)


def _use_description(path: Path) -> None:
    found = read_description(path)
    found.static_transforms()
    found.moving_transforms(JointState(name=[joint.name for joint in found.joints], position=np.full(99, 1e308)))


def _use_parameters(path: Path) -> None:
    navigation_of_robot({"params": path.name}, 0, path.parent, "")


def _texts(folder: Path, pattern: str) -> list[bytes]:
    return [path.read_bytes() for path in sorted(folder.glob(pattern))]


def _pictures() -> list[bytes]:
    """A small picture in each format that is read."""
    cells = Image.fromarray((np.random.default_rng(1).random((20, 30)) > 0.8).astype(np.uint8) * 255)
    made = []
    for kind in ("PNG", "PPM", "BMP", "GIF", "JPEG"):
        file = BytesIO()
        cells.save(file, kind)
        made.append(file.getvalue())
    return made


class Kind(NamedTuple):
    """One kind of file."""

    name: str
    """Of the file, with its ending."""
    use: Callable[[Path], object]
    """What a process does with it at its start."""
    valid: Sequence[bytes]
    words: Sequence[bytes] = ()
    """Of its language."""


KINDS = [
    Kind(
        "w.world",
        _use_world,
        [*_texts(worlds_folder(), "*.world"), *_texts(WORLDS, "*.world")],
        [
            b"position (",
            b'include "w.world"',
            b"size [1 1 1]",
            b"samples 1000000",
            b"resolution 1e-9",
            b"pose",
            b"fov 360",
        ],
    ),
    Kind("w.png", _use_bitmap, _pictures()),
    Kind(
        "t.toml",
        _use_team,
        _texts(teams_folder(), "*.toml"),
        [b"[[robots]]\n", b'ids = "0-9999"\n', b"include = ['t.toml']\n"],
    ),
    Kind("m.yaml", _use_map, [MAP]),
    Kind("m.pgm", _use_map_image, _pictures()),
    Kind("r.urdf", _use_description, [URDF], [b"<joint ", b"<!DOCTYPE x [", b"&lt;", b"</robot>"]),
    Kind("g.yaml", read_goals, _texts(teams_folder(), "*.yaml"), [b"- {robot: 1, x: 1, y: 1}\n"]),
    Kind("p.yaml", _use_parameters, [PARAMETERS]),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all files that the valid ones name."""
    made = tmp_path_factory.mktemp("hostile")
    for path in (*worlds_folder().glob("*.*"), *teams_folder().glob("*.*"), *WORLDS.iterdir()):
        shutil.copy(path, made)
    return made


def _memory(field: str) -> int:
    """MB of this process."""
    text = Path("/proc/self/status").read_text().partition(f"{field}:")[2]
    return int(text.split()[0]) // 1024


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_hostile_file_is_used_or_refused_by_name(kind: Kind, folder: Path) -> None:
    """Each mistake is told in one line that names the file, in bounded time and memory."""
    path, counts = folder / kind.name, Counter[str]()

    @examples(150)
    @given(damaged(st.sampled_from([*kind.valid]), kind.words))
    def use(content: bytes) -> None:
        path.write_bytes(content)
        Path("/proc/self/clear_refs").write_text("5")
        before, begin = _memory("VmRSS"), monotonic()
        try:
            kind.use(path)
        except UsageError as error:
            counts["refused"] += 1
            assert all(path.stem in line for line in str(error).splitlines()), error
        else:
            counts["used"] += 1
        assert monotonic() - begin < LIMIT
        assert _memory("VmHWM") - before < GROWTH

    use()
    log.info("%s: %d files, %s", kind.name, counts.total(), dict(counts))
    assert counts["refused"]
