"""ROS map_server's YAML files."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from zteam.errors import WorldError
from zteam.geometry import Pose2
from zteam.sim import Engine
from zteam.world import add_robot, load_world
from zteam.world.floor_maps import read_floor_map

LEVELS = [[0, 89, 90, 205], [254, 255, 100, 0]]


def write_map(folder: Path, **fields: Any) -> Path:
    """A YAML beside a picture of 4 x 2 pixels, the upper row first."""
    Image.fromarray(np.array(LEVELS, np.uint8), "L").save(folder / "floor.pgm")
    path = folder / "floor.yaml"
    standard = {"image": "floor.pgm", "resolution": 0.5, "origin": [1.0, 2.0, 0.0], "negate": 0}
    path.write_text(yaml.safe_dump({k: v for k, v in (standard | fields).items() if v is not None}))
    return path


def test_thresholds_are_map_servers(tmp_path: Path) -> None:
    """Occupied is what lies above occupied_thresh by darkness, by lightness with negate, as percent in raw."""
    lower_upper = [[0, 0, 0, 1], [1, 1, 0, 0]]
    assert read_floor_map(write_map(tmp_path)).occupied.astype(int).tolist() == lower_upper
    light = read_floor_map(write_map(tmp_path, negate=1)).occupied.astype(int).tolist()
    assert light == [[1, 1, 0, 0], [0, 0, 0, 1]]
    raw = read_floor_map(write_map(tmp_path, mode="raw", occupied_thresh=0.95)).occupied.astype(int).tolist()
    assert raw == [[1, 1, 1, 0], [0, 0, 0, 1]]


def test_a_yaml_is_a_world_of_its_own(tmp_path: Path) -> None:
    """Cells, size and place follow from resolution and origin; a robot that is added sees its walls."""
    world = load_world(write_map(tmp_path, origin=[1.0, 2.0, math.pi / 2]))
    (plan,) = world.floorplans
    assert plan.cell == pytest.approx((0.5, 0.5))
    assert plan.pose == pytest.approx(Pose2(1.0, 2.0, math.pi / 2))
    assert world.robots == ()
    robot = add_robot(world, "erratic", Pose2(0.75, 2.75, 0.0), "r")
    seen = Engine(world, robots={0: robot}).observe().robots[0]
    # Turned by 90 degrees: the upper row lies at x = 0 to 0.5, its occupied cells at y = 2 to 3.
    behind = seen.readings[0].ranges
    assert math.isclose(float(behind[0]), (0.75 + 0.05 - 0.5) / math.sin(math.radians(135.125 - 90)), rel_tol=0.02)


def test_a_model_may_stand_on_a_yaml(tmp_path: Path) -> None:
    """As a bitmap, its size and pose come along unless the model says otherwise."""
    write_map(tmp_path)
    path = tmp_path / "x.world"
    path.write_text('model ( bitmap "floor.yaml" )\nposition ( )')
    (plan,) = load_world(path).floorplans
    assert (plan.pose, plan.cell, plan.z_max) == (pytest.approx((1.0, 2.0, 0.0)), pytest.approx((0.5, 0.5)), 1.0)
    path.write_text('model ( bitmap "floor.yaml" size [4 4 2] pose [0 0 0 0] )\nposition ( )')
    (plan,) = load_world(path).floorplans
    assert (plan.pose, plan.cell, plan.z_max) == (pytest.approx((-2.0, -2.0, 0.0)), (1.0, 2.0), 2.0)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"image": None}, "image: the name"),
        ({"image": "gone.pgm"}, "gone.pgm"),
        ({"resolution": None}, "resolution: is missing"),
        ({"resolution": 0}, "resolution: must be above 0"),
        ({"resolution": "wide"}, "resolution: 'wide' is not a number"),
        ({"origin": [1, 2]}, "origin: must be"),
        ({"origin": [1, 2, float("nan")]}, "origin: nan"),
        ({"mode": "fancy"}, "mode: must be one of"),
    ],
)
def test_a_wrong_key_is_named(tmp_path: Path, fields: dict[str, Any], text: str) -> None:
    """Every error names the file and the key."""
    with pytest.raises(WorldError, match=text) as caught:
        load_world(write_map(tmp_path, **fields))
    assert "floor.yaml" in str(caught.value)


@pytest.mark.parametrize("content", ["a: [", "just words", "- 1\n- 2", "!!python/object/apply:os.getcwd []", "\0"])
def test_what_is_no_map_is_refused(tmp_path: Path, content: str) -> None:
    """Broken YAML, another document, objects and binary are one error each."""
    path = tmp_path / "x.yaml"
    path.write_text(content)
    with pytest.raises(WorldError, match="not a map_server YAML"):
        load_world(path)
    path.write_bytes(b"#" * 100_000)
    with pytest.raises(WorldError, match="refused"):
        load_world(path)
