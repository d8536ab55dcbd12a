"""`zteam world check | show | scan | new`, called with words as on a command line."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from support.commands import Run
from zteam import run_team
from zteam.simulator.world.placing import find_misplaced
from zteam.team.file.reading import read_team_file
from zteam.team.launch.check import check_team
from zteam.world import load_world

TEXT = """
define rob position (
  size [0.4 0.4 0.3] ranger ( pose [0 0 -0.2 0] sensor ( range [0 10] fov 180 samples 5 ) sensor ( range [0 4] ) )
)
model ( name "wall" pose [3 0 0 0] size [0.2 10 1] )
model ( name "crate" pose [0 4 0 0] size [1 1 1] pushable 1 mass 4 )
rob ( name "ann" pose [0 0 0 0] ctrl "wander" )
rob ( name "bob" pose [0 -3 0 90] )
"""


@pytest.fixture(autouse=True)
def world(empty_folder: Path) -> None:
    """A world file where the user stands."""
    (empty_folder / "yard.world").write_text(TEXT)


def test_check_lists_models_and_warnings(run: Run) -> None:
    """Robots with ids, obstacles, pushable bodies, each kind of base once, ignored properties with their places."""
    text = run("zteam world check yard.world").out
    assert "robot 0" in text and "ann" in text and "bob" in text and "pushable" in text
    assert "yard.world:7:33: ctrl is ignored" in text
    assert "2 robots, 2 obstacles" in text
    assert "1 sonar\n" in text
    lines = text.splitlines()
    ((place, base),) = ((i, line) for i, line in enumerate(lines) if line.startswith("  base "))
    assert base.split(maxsplit=2)[1:] == ["rob", "footprint x -0.2 to 0.2, y -0.2 to 0.2 m"]
    assert lines[place + 1].strip() == "max_vel_x 1, min_vel_x -1, max_vel_theta 1.57"
    assert len(base) <= 80


def test_check_prints_json(run: Run) -> None:
    """Robots are in file order, with poses in metres and degrees; a base has its outline and its limits."""
    summary = json.loads(run("zteam world check yard.world --json").out)
    assert [robot["name"] for robot in summary["robots"]] == ["ann", "bob"]
    assert summary["robots"][1]["pose"] == pytest.approx([0.0, -3.0, 90.0])
    assert len(summary["warnings"]) == 1
    Path("ghost.world").write_text("position ( size [0 0 0] acceleration_bounds [-3 1 0 0 0 0 -90 90] )")
    (base,) = json.loads(run("zteam world check ghost.world --json").out)["bases"]
    assert (base["footprint"], base["acc_lim_x"], base["decel_lim_x"]) == ([], 1.0, -3.0)
    assert "no footprint" in run("zteam world check ghost.world").out


def test_check_names_robots_that_have_no_room(run: Run) -> None:
    """A robot in a wall and one in another robot are a warning each; robots that touch them are none."""
    Path("full.world").write_text(
        'define rob position ( size [0.4 0.4 0.3] )\nmodel ( name "wall" pose [3 0 0 0] size [0.2 10 1] )\n'
        + "".join(f"rob ( pose [{x} 0 0 0] )\n" for x in (0.0, 0.4, 2.9, 2.7, -0.2))
    )
    lines = run("zteam world check full.world").out.splitlines()
    assert [line for line in lines if line.startswith("full: robot")] == [
        f"full: robot {i} ('robot_{i}') has no room at its pose: it would stand in {what}; "
        "a team with this robot does not start"
        for i, what in ((2, "'wall'"), (3, "robot 2"), (4, "robot 0"))
    ]
    assert lines[-1].endswith("; 3 warnings")


def test_a_world_without_robots_is_checked(run: Run) -> None:
    """A world without robots is valid: a team file can add some."""
    Path("floor.world").write_text("model ( size [1 1 1] )")
    assert "0 robots, 1 obstacle, 0 floor plans; no warnings" in run("zteam world check floor.world").out


def test_scan_prints_all_lasers_of_a_robot(run: Run) -> None:
    """The scans of all lasers are printed in file order, taken at the robot's pose in the file."""
    seen = json.loads(run("zteam world scan yard.world --robot 0 --json").out)
    assert (seen["robot"], seen["pose"]) == (0, [0.0, 0.0, 0.0])
    wide, narrow = seen["lasers"]
    assert wide["angle_min"] == pytest.approx(-math.pi / 2)
    assert wide["angle_increment"] == pytest.approx(math.pi / 4)
    assert wide["ranges"] == pytest.approx([2.8, 2.9 * math.sqrt(2), 2.9, 2.9 * math.sqrt(2), 3.5], abs=1e-5)
    assert wide["intensities"] == [1.0] * 5
    assert (narrow["ranges"], narrow["range_max"]) == ([pytest.approx(2.9, abs=1e-6)], 4.0)
    first, second = run("zteam world scan yard.world --robot 1").out.splitlines()
    assert "5 beams" in first and "1 beams" in second


def test_scan_takes_a_pose(run: Run) -> None:
    """A pose in metres and degrees moves the robot."""
    seen = json.loads(run("zteam world scan yard.world --robot 0 --json --pose 1 -1 180").out)
    assert seen["pose"] == [1.0, -1.0, pytest.approx(180.0)]
    assert seen["lasers"][0]["ranges"][2] == pytest.approx(10.0)


def test_show_draws_what_lasers_see(run: Run) -> None:
    """With --scan the picture shows the fans and the points hit, without it neither."""
    for words, count in (("", 0), ("--scan", (5 + 1) + (3 + 1))):
        run(f"zteam world show yard.world -o out.svg {words}")
        assert Path("out.svg").read_text().count("<circle") == count


def plan(*, invert: bool = False) -> Image.Image:
    """A hall of 8 x 3 m at 0.05 m a pixel, with margins of a metre and a transparent ground."""
    pixels = np.zeros((100, 200, 2), np.uint8)
    pixels[20:80, 20:180, 1] = 255
    pixels[21:79, 21:179] = 255, 255
    return Image.fromarray(255 - pixels[:, :, 0]) if invert else Image.fromarray(pixels)


@pytest.mark.parametrize(
    ("reading", "cells", "is_told"),
    [("", [160, 60], True), ('bitmap_reading "crop"', [160, 60], True), ('bitmap_reading "whole"', [200, 100], False)],
)
def test_check_says_that_a_bitmap_is_cropped(run: Run, reading: str, cells: list[int], is_told: bool) -> None:
    """From what size, and how to keep the margins, which have another scale then."""
    plan().save("plan.png")
    Path("crop.world").write_text(f'model ( bitmap "plan.png" size [10 5 1] {reading} )')
    (found,) = json.loads(run("zteam world check crop.world --json").out)["floorplans"]
    assert (found["cells"], found["picture"]) == (cells, [200, 100])
    assert ("from 200 x 100 pixels" in (text := run("zteam world check crop.world").out)) == is_told
    assert ('bitmap_reading "whole"' in text) == is_told


@pytest.mark.parametrize(("robots", "margin"), [(1, False), (4, False), (40, False), (80, True)])
def test_new_makes_a_world_of_a_picture_that_a_team_runs_in(run: Run, robots: int, margin: bool) -> None:
    """All of the picture at its scale; robots with room stand inside, and in the margins where there are too many; the
    team file that is named drives them."""
    plan().save("my plan.png")
    out = run(f"zteam world new 'my plan.png' --resolution 0.05 --robots {robots}").out
    world = load_world("my plan.world")
    (floor,) = world.floorplans
    assert (floor.occupied.shape, floor.cell, floor.pose) == ((100, 200), pytest.approx((0.05, 0.05)), (0.0, 0.0, 0.0))
    assert floor.occupied.sum() == 160 * 60 - 158 * 58
    assert len(world.robots) == robots
    assert world.warnings == () and not list(find_misplaced(world))
    assert margin != all(1.0 < robot.pose.x < 9.0 and 1.0 < robot.pose.y < 4.0 for robot in world.robots)
    assert "zteam up 'my plan.toml'" in out
    if robots == 4:
        report = run_team("my plan.toml", seconds=2.0)
        assert max(row.distance_m for row in report.robots) > 0.3


def test_new_takes_a_large_plan(run: Run) -> None:
    """The world of 2 x 1 km has a map of cells so large that the team starts; its file may lie in another folder."""
    plan().save("plan.png")
    Path("sub").mkdir()
    for output, name in (("sub/big.world", "big"), ("sub", "plan")):
        run(f"zteam world new plan.png --resolution 10 -o {output}")
        assert check_team(read_team_file(Path(f"sub/{name}.toml"))) == Path(f"sub/{name}.world")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("plan.png", "--resolution"),
        ("plan.png --resolution 5cm", "--resolution: '5cm'"),
        ("plan.png --resolution 0", "--resolution: '0'"),
        ("plan.png --resolution 0.001", "plan.png: 0.2 x 0.1 m with dark walls, and free room for 0 of 4 robots"),
        ("dark.png --resolution 0.05 --robots 500", "free room for"),
        ("plan.png --resolution 0.05 --robots 0", "--robots: '0'"),
        ("yard.world --resolution 0.05", "cannot read bitmap yard.world"),
        ("negative.png --resolution 0.05", "invert it"),
        ("white.png --resolution 0.05", "white.png: all free room"),
        ("black.png --resolution 0.05", "black.png: no free room"),
        ("none.png --resolution 0.05", ": cannot read bitmap none.png: No such file or directory\n"),
        (". --resolution 0.05", "cannot read bitmap ."),
        ("plan.png --resolution 0.05 -o 'a\"b.world'", "a name with a quote"),
        ("plan.png --resolution 0.05 -o '${a}.world'", "a name with a quote or a $"),
        ("plan.png --resolution 0.05 -o 'a\"b.toml'", ': -o a"b.toml: '),
        ("plan.png --resolution 0.05 -o none/plan.world", "-o none/plan.world: there is no folder none"),
        ("plan.png --resolution 0.05 -o yard.world", "yard.world exists already; choose another name with -o, or"),
        ("plan.png --resolution 0.05 -o taken.world", "taken.toml exists already"),
        ("m.yaml --resolution 0.05", "m.yaml: it is no PNG, PGM, BMP, JPEG or GIF; save it as a PNG"),
    ],
)
def test_new_refuses_in_a_line_and_writes_nothing(run: Run, words: str, text: str) -> None:
    """The file or the option is named, and nothing that is there is touched."""
    plan().save("plan.png")
    plan(invert=True).save("dark.png")
    for name, ground, walls in (("white", 255, 255), ("black", 0, 0), ("negative", 0, 255)):
        picture = Image.new("L", (200, 100), ground)
        ImageDraw.Draw(picture).rectangle((20, 20, 180, 80), outline=walls)
        picture.save(f"{name}.png")
    Path("taken.toml").write_text("mine")
    Path("m.yaml").write_text("image: plan.png\nresolution: 0.05\n")
    before = {path: path.read_bytes() for path in Path().iterdir()}
    err = run(f"zteam world new {words}", 2).err
    assert text in err and err.count("\n") == 1
    assert {path: path.read_bytes() for path in Path().iterdir()} == before


def test_new_overwrites_when_told(run: Run) -> None:
    """With --force both files are new."""
    plan().save("yard.png")
    run("zteam world new yard.png --resolution 0.05 --force")
    assert len(load_world("yard.world").robots) == 4
