"""`zteam world check | show | scan`, called with words as on a command line."""

import json
import math
from pathlib import Path

import pytest

from support.commands import Run

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
