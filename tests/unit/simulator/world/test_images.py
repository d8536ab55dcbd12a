"""Images as floors: bitmaps, and map_server YAML files."""

import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from zteam.config.map_files import read_floor_map
from zteam.errors import WorldError
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import Engine
from zteam.simulator.core.occupancy_grid import map_message
from zteam.simulator.world.bodies import occupied_box, read_bitmap, rectangles
from zteam.world import add_robot, load_world

DEEP = np.array([[0x7FFF, 0x8000]], np.uint16)
PALETTE = Image.fromarray(np.array([[0, 1]], np.uint8)).convert("P")
PALETTE.putpalette([255, 0, 0, 0, 255, 255])
PLAIN = Image.fromarray(np.array([[0, 127, 128], [205, 255, 1]], np.uint8))
EVEN = Image.fromarray(np.repeat(np.array([[0], [255]], np.uint8), 8, axis=0).repeat(8, axis=1))
COLORS = Image.fromarray(np.array([[[0, 0, 255, 255], [255, 255, 0, 255], [0, 0, 0, 230], [0, 0, 0, 0]]], np.uint8))


@pytest.mark.parametrize(
    ("name", "image", "occupied"),
    [
        *((f"a.{kind}", PLAIN, [[False, False, True], [True, True, False]]) for kind in ("png", "bmp", "pgm", "gif")),
        ("even.jpg", EVEN, [[False] * 8] * 8 + [[True] * 8] * 8),
        ("ascii.pgm", b"P2\n# a comment\n2 1\n15\n7 8\n", [[True, False]]),
        ("deep.png", Image.fromarray(DEEP), [[True, False]]),
        ("deep.pgm", b"P5 2 1 65535\n" + DEEP.astype(">u2").tobytes(), [[True, False]]),
        ("first channel.png", COLORS, [[True, False, True, False]]),
        ("palette.png", PALETTE, [[False, True]]),
        ("clear.png", Image.fromarray(np.array([[[0, 127], [0, 128], [255, 255]]], np.uint8)), [[False, True, False]]),
        ("bits.png", Image.fromarray(np.array([[True, False]])), [[False, True]]),
    ],
)
def test_dark_pixels_are_occupied(
    tmp_path: Path, name: str, image: Image.Image | bytes, occupied: list[list[bool]]
) -> None:
    """127 is, 128 and map_server's unknown 205 are not; the last row becomes row 0. A PGM has its own maximum. Of deep
    images the upper byte counts, of colours the first channel, of palettes the colours. A transparent pixel is free."""
    if isinstance(image, bytes):
        (tmp_path / name).write_bytes(image)
    else:
        image.save(tmp_path / name)
    assert read_bitmap(tmp_path / name).tolist() == occupied


def test_what_is_no_image_is_an_error(tmp_path: Path) -> None:
    """Text and an image cut short are WorldErrors that name the file."""
    (tmp_path / "a.png").write_text("no image")
    with pytest.raises(WorldError, match=r"cannot read bitmap .*a\.png: it is no PNG"):
        read_bitmap(tmp_path / "a.png")
    Image.fromarray(np.zeros((64, 64), np.uint8)).save(tmp_path / "b.bmp")
    (tmp_path / "b.bmp").write_bytes((tmp_path / "b.bmp").read_bytes()[:500])
    with pytest.raises(WorldError, match=r"cannot read bitmap .*b\.bmp"):
        read_bitmap(tmp_path / "b.bmp")


@pytest.mark.parametrize("side", [8001, 9500, 60_000])
def test_a_bomb_is_refused_before_it_is_decoded(tmp_path: Path, side: int) -> None:
    """A tiny PNG that claims more than 64 million pixels is refused, below and above Pillow's own bounds."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    )
    with pytest.raises(WorldError, match="more than 64000000 pixels"):
        read_bitmap(tmp_path / "a.png")


def test_the_box_of_occupied_cells() -> None:
    """The box is half open, and there is none around nothing."""
    grid = np.zeros((6, 8), bool)
    assert occupied_box(grid) is None
    grid[2, 3] = grid[4, 7] = True
    assert occupied_box(grid) == (2, 5, 3, 8)


def test_rectangles_cover_the_cells_exactly() -> None:
    """Runs that repeat in the next row join; a hole stays a hole."""
    grid = np.array([[1, 1, 1], [1, 0, 1], [1, 0, 1], [1, 1, 1]], bool)
    assert rectangles(grid, 4) == [(0, 1, 0, 3), (1, 3, 0, 1), (1, 3, 2, 3), (3, 4, 0, 3)]
    assert rectangles(grid, 3) is None


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
    assert raw == [[0, 0, 1, 0], [0, 0, 0, 0]]


def test_cells_are_those_of_double_precision(tmp_path: Path) -> None:
    """As map_server's: 102 is 87.499… percent between the thresholds. A key that is no text counts for nothing."""
    path = write_map(tmp_path, mode="scale")
    path.write_text(f"{path.read_text()}on: 2\n")
    Image.new("L", (1, 1), 102).save(tmp_path / "floor.pgm")
    assert read_floor_map(path).cells.tolist() == [[87]]


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


@pytest.mark.parametrize("physics", ["dynamic", "stage"])
def test_a_world_in_the_grid_of_a_country_is_the_same_one(tmp_path: Path, physics: str) -> None:
    """At UTM coordinates lasers measure, robots drive and the map of the world shows what they do at the origin."""
    found = []
    for x, y in ((0.0, 0.0), (32_455_123.0, 5_411_932.0)):
        write_map(tmp_path, origin=[x, y, 0.0])
        (tmp_path / "x.world").write_text(
            f'physics "{physics}"\nmodel ( bitmap "floor.yaml" )\n'
            f"model ( size [0.1 1 1] pose [{x + 1.5} {y + 0.5} 0 20] )\n"
            f"position ( size [0.2 0.2 0.2] pose [{x + 0.3} {y + 0.25} 0 0]\n"
            "ranger ( pose [0 0 -0.1 0] sensor ( range [0 30] fov 180 samples 61 ) ) )"
        )
        world = load_world(tmp_path / "x.world")
        engine = Engine(world)
        for _ in range(30):
            seen = engine.step({0: Twist(Vector3(0.5))}).robots[0]
        truth = seen.truth.x - x, seen.truth.y - y, seen.truth.yaw
        found.append([*truth, *seen.odom, *seen.readings[0].ranges, *map_message(world, 0.05).data])
    assert found[0] == pytest.approx(found[1], abs=1e-5)
    assert 0.5 < found[0][0] < 1.5


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
        ({"image": None}, "the key image is missing"),
        ({"image": "gone.pgm"}, "gone.pgm"),
        ({"mode": ["a", "b"]}, "mode: "),
        ({"resolution": 10**400}, "resolution: "),
        ({"resolution": float("nan")}, "resolution: a number of at least 0.0001"),
        ({"origin": [1e300, 0, 0]}, "origin: x, y and yaw are numbers"),
        ({"free_thresh": 0.9}, "free_thresh: it is below occupied_thresh"),
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
    with pytest.raises(WorldError, match=r"not YAML|a table is expected"):
        load_world(path)
    path.write_bytes(b"#" * 100_000)
    with pytest.raises(WorldError, match="refused"):
        load_world(path)
