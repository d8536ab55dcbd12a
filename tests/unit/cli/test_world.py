"""`zteam world check | show | scan`, called with words as on a command line."""

import json
import math
from pathlib import Path

import pytest

from support.commands import exit_code
from zteam.cli.world import main

TEXT = """
define rob position (
  size [0.4 0.4 0.3] ranger ( pose [0 0 -0.2 0] sensor ( range [0 10] fov 180 samples 5 ) sensor ( range [0 4] ) )
)
model ( name "wall" pose [3 0 0 0] size [0.2 10 1] )
model ( name "crate" pose [0 4 0 0] size [1 1 1] pushable 1 mass 4 )
rob ( name "ann" pose [0 0 0 0] ctrl "wander" )
rob ( name "bob" pose [0 -3 0 90] )
"""


@pytest.fixture
def world(tmp_path: Path) -> str:
    """A world file."""
    path = tmp_path / "yard.world"
    path.write_text(TEXT)
    return str(path)


def test_check_lists_models_and_warnings(world: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The text lists robots with ids, obstacles, pushable bodies, and ignored properties with their places."""
    assert main(["check", world]) == 0
    text = capsys.readouterr().out
    assert "robot 0" in text and "ann" in text and "bob" in text and "pushable" in text
    assert "yard.world:7:33: ctrl is ignored" in text
    assert "2 robots, 2 obstacles" in text
    assert "1 sonar\n" in text


def test_check_prints_json(world: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The JSON has the robots in file order with poses in metres and degrees, and the warnings."""
    assert main(["check", world, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [robot["name"] for robot in summary["robots"]] == ["ann", "bob"]
    assert summary["robots"][1]["pose"] == pytest.approx([0.0, -3.0, 90.0])
    assert len(summary["warnings"]) == 1


def test_check_prints_the_base_of_each_model_once(
    world: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Outline and limits are those of `base_info`; robots of one macro share it, and no limit is no word."""
    assert main(["check", world]) == 0
    lines = capsys.readouterr().out.splitlines()
    ((place, base),) = ((i, line) for i, line in enumerate(lines) if line.startswith("  base "))
    assert base.split(maxsplit=2)[1:] == ["rob", "footprint x -0.2 to 0.2, y -0.2 to 0.2 m"]
    assert lines[place + 1].strip() == "max_vel_x 1, min_vel_x -1, max_vel_theta 1.57"
    assert len(base) <= 80
    path = tmp_path / "ghost.world"
    path.write_text("position ( size [0 0 0] acceleration_bounds [-3 1 0 0 0 0 -90 90] )")
    assert main(["check", str(path), "--json"]) == 0
    (base,) = json.loads(capsys.readouterr().out)["bases"]
    assert (base["footprint"], base["acc_lim_x"], base["decel_lim_x"]) == ([], 1.0, -3.0)
    assert main(["check", str(path)]) == 0
    assert "no footprint" in capsys.readouterr().out


def test_scan_prints_all_lasers_of_a_robot(world: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The scans of all lasers are printed in file order, taken at the robot's pose in the file."""
    assert main(["scan", world, "--robot", "0", "--json"]) == 0
    seen = json.loads(capsys.readouterr().out)
    assert (seen["robot"], seen["pose"]) == (0, [0.0, 0.0, 0.0])
    wide, narrow = seen["lasers"]
    assert wide["angle_min"] == pytest.approx(-math.pi / 2)
    assert wide["angle_increment"] == pytest.approx(math.pi / 4)
    assert wide["ranges"] == pytest.approx([2.8, 2.9 * math.sqrt(2), 2.9, 2.9 * math.sqrt(2), 3.5], abs=1e-5)
    assert wide["intensities"] == [1.0] * 5
    assert (narrow["ranges"], narrow["range_max"]) == ([pytest.approx(2.9, abs=1e-6)], 4.0)


def test_scan_takes_a_pose_and_a_laser(world: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A pose in metres and degrees moves the robot; a given laser replaces its own at the place of its first one."""
    command = ["scan", world, "--robot", "0", "--json", "--pose", "1", "-1", "180"]
    assert main([*command, "--beams", "3", "--fov-deg", "180", "--range", "6"]) == 0
    seen = json.loads(capsys.readouterr().out)
    assert seen["pose"] == [1.0, -1.0, pytest.approx(180.0)]
    (laser,) = seen["lasers"]
    assert laser["ranges"] == pytest.approx([6.0, 6.0, 6.0])


def test_scan_prints_a_summary_of_each_laser(world: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Without --json there is one line per laser."""
    assert main(["scan", world, "--robot", "1"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert "5 beams" in first and "1 beams" in second


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--robot", "5"], "yard has these robots: 0, 1"),
        (["--robot", "0", "--beams", "3"], "belong together"),
        (["--robot", "0", "--pose", "nan", "0", "0"], "give metres and degrees from"),
        (
            ["--robot", "0", "--beams", "0", "--fov-deg", "90", "--range", "5"],
            "--beams: '0': give beams from 1",
        ),
    ],
)
def test_a_wrong_request_is_a_usage_error(
    world: str, arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong option ends with 2 and one line that names valid values."""
    assert exit_code(main, ["scan", world, *arguments]) == 2
    said = capsys.readouterr().err
    assert text in said
    assert len(said.splitlines()) == 1


def test_show_draws_what_lasers_see(world: str, tmp_path: Path) -> None:
    """With --scan the picture shows the fans and the points hit, without it neither."""
    path = tmp_path / "out.svg"
    assert main(["show", world, "-o", str(path)]) == 0
    plain = path.read_text()
    assert main(["show", world, "-o", str(path), "--scan"]) == 0
    assert "<circle" not in plain
    assert path.read_text().count("<circle") == (5 + 1) + (3 + 1)


def test_show_refuses_other_formats(world: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A picture that is neither .svg nor .png ends with 2 and one line."""
    assert main(["show", world, "-o", str(tmp_path / "out.gif")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_world_without_robots_is_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A world without robots is valid: a team file can add some."""
    path = tmp_path / "floor.world"
    path.write_text("model ( size [1 1 1] )")
    assert main(["check", str(path)]) == 0
    assert "0 robots, 1 obstacle, 0 floor plans; no warnings" in capsys.readouterr().out


def test_a_broken_world_is_one_line_with_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A syntax error ends with 2 and one line with file, line and column."""
    path = tmp_path / "bad.world"
    path.write_text("position (\n  size [1 2\n)")
    assert main(["check", str(path)]) == 2
    error = capsys.readouterr().err
    assert "bad.world:2:" in error
    assert error.count("\n") == 1


def test_an_unknown_world_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    """A world that does not exist ends with 2 and one line that names it."""
    assert main(["check", "nowhere.world"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "nowhere.world" in line


def test_check_names_robots_that_have_no_room(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A robot in a wall and one in another robot are a warning each; robots that touch them are none."""
    path = tmp_path / "full.world"
    path.write_text(
        'define rob position ( size [0.4 0.4 0.3] )\nmodel ( name "wall" pose [3 0 0 0] size [0.2 10 1] )\n'
        + "".join(f"rob ( pose [{x} 0 0 0] )\n" for x in (0.0, 0.4, 2.9, 2.7, -0.2))
    )
    assert main(["check", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line.startswith("full: robot")] == [
        f"full: robot {i} ('robot_{i}') has no room at its pose: it would stand in {what}; "
        "a team with this robot does not start"
        for i, what in ((2, "'wall'"), (3, "robot 2"), (4, "robot 0"))
    ]
    assert lines[-1].endswith("; 3 warnings")
