"""Hostile world files: one short error, soon, whatever they try."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from support.small_worlds import make_robot
from zteam.errors import UsageError, WorldError
from zteam.geometry import Pose2
from zteam.sim import Engine, Options
from zteam.simulator.world.model import Floorplan, World
from zteam.world import load_world

ROBOT = "position ( )\n"


def refusal(folder: Path, text: str) -> str:
    """The error of a world of this text."""
    path = folder / "hostile.world"
    path.write_text(text)
    with pytest.raises(WorldError) as caught:
        load_world(path)
    return str(caught.value)


def test_a_long_name_of_a_file_is_cut(tmp_path: Path) -> None:
    """An error is a line to read, however long the name that is not found."""
    assert len(refusal(tmp_path, f'include "{"a" * 100_000}"\n')) < 500


def test_included_text_is_bounded_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few lines that include one large file of comments over and over are refused."""
    monkeypatch.setattr("zteam.simulator.world.text.MAX_CHARACTERS", 3_500)
    (tmp_path / "long.inc").write_text("#" + "x" * 900 + "\n")
    error = refusal(tmp_path, 'include "long.inc"\n' * 20 + ROBOT)
    assert "hostile.world:4:1: more than 3500 characters" in error


def test_points_are_bounded_after_macros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Macros that make too many corners of a few hundred are refused."""
    corners = " ".join(f"point[{i}] [{np.cos(i / 41)} {np.sin(i / 41)}]" for i in range(256))
    monkeypatch.setattr("zteam.simulator.world.bodies.MAX_ALL_POINTS", 5_000)
    text = f"define b model ( block ( points 256 {corners} z [0 1] ) )\ndefine c model ( {'b() ' * 5} )\n"
    assert "more than 5000 points" in refusal(tmp_path, text + "c ()\n" * 5 + ROBOT)


def test_bitmaps_are_bounded_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Several bitmaps may not have more pixels together than one may have; one that is used often counts once."""
    monkeypatch.setattr("zteam.simulator.world.bodies.MAX_PIXELS", 250)
    for name in "abc":
        Image.fromarray(np.zeros((10, 10), np.uint8)).save(tmp_path / f"{name}.png")
    often = 'model ( bitmap "a.png" )\n' * 5 + 'model ( bitmap "./a.png" )\nmodel ( bitmap "b.png" )\n'
    path = tmp_path / "often.world"
    path.write_text(often + ROBOT)
    assert len(load_world(path).floorplans) == 7
    assert "8:9: this world has more than 250 pixels" in refusal(tmp_path, often + 'model ( bitmap "c.png" )\n' + ROBOT)


def test_floors_of_one_bitmap_share_its_cells() -> None:
    """Fifty models of one bitmap of a million cells cost the memory of one."""
    occupied = np.zeros((1000, 1000), bool)
    occupied[0] = True
    plans = tuple(Floorplan(f"{i}", occupied, (0.1, 0.1), Pose2(0.0, i, 0.0), 0.0, 1.0) for i in range(50))
    tracemalloc.start()
    for physics in ("dynamic", "stage"):
        Engine(World("w", 100_000_000, plans, (), (make_robot(),)), options=Options(physics=physics)).step({})  # type: ignore[arg-type]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6


def test_noise_is_no_wall_for_the_dynamic_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bitmap with more walls than contacts can be computed for is refused, and the way out named."""
    monkeypatch.setattr("zteam.simulator.core.dynamic.MAX_WALLS", 4_000)
    noise = np.random.default_rng(0).random((110, 110)) < 0.5
    plan = Floorplan("noise", noise, (0.1, 0.1), Pose2(1.0, 0.0, 0.0), 0.0, 1.0)
    world = World("w", 100_000_000, (plan,), (), (make_robot(),))
    with pytest.raises(UsageError, match=r"'noise' this world has more than 4000 .* kinematic"):
        Engine(world).step({})
    Engine(world, options=Options(physics="kinematic")).step({})


def test_aliases_of_aliases_are_not_written_out(tmp_path: Path) -> None:
    """A short YAML with a value that would be 10^12 words long is refused in a short line, before it is written."""
    lists = "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 13))
    Image.fromarray(np.zeros((4, 4), np.uint8)).save(tmp_path / "floor.png")
    (tmp_path / "floor.yaml").write_text(f"image: floor.png\na0: &a0 [1]\n{lists}resolution: *a12\n")
    error = refusal(tmp_path, f'model ( bitmap "floor.yaml" )\n{ROBOT}')
    assert "floor.yaml:4: " in error
    assert len(error) < 500
