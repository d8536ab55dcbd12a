"""zteam.simulator.world.builder: robots beyond those of the file, and what importing costs."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

from support.world_texts import LoadText
from zteam.errors import WorldError
from zteam.geometry import Pose2
from zteam.sim import Engine
from zteam.world import add_robot, load_world


def test_add_robot_makes_the_files_own_robots(load: LoadText) -> None:
    """A further robot of a macro has its body and sensors, and the pose and name asked for."""
    world = load('define bot position ( size [1 2 3] ctrl "x" ranger ( sensor () ) )')
    robot = add_robot(world, "bot", Pose2(1, 2, 3), "robot_7")
    assert (robot.name, robot.model, robot.pose) == ("robot_7", "bot", (1, 2, 3))
    assert robot.shapes[0].points == ((-0.5, -1), (0.5, -1), (0.5, 1), (-0.5, 1))
    assert robot.rangers[0].name == "robot_7.ranger:0"
    assert len(world.robots) == 1
    assert [remark.text.split()[0] for remark in world.warnings] == ["ctrl"]
    add_robot(world, "bot", Pose2(0, 0, 0), "robot_8")
    assert len(world.warnings) == 1


def test_add_robot_knows_an_erratic_of_its_own(load: LoadText) -> None:
    """In a world that defines no erratic the built-in one is used; one of the file wins."""
    robot = add_robot(load(""), "erratic", Pose2(0, 0, 0), "a")
    assert robot.shapes[0].points[0] == pytest.approx((-0.225, -0.175))
    assert robot.shapes[0].points[2] == pytest.approx((0.125, 0.175))
    assert robot.shapes[0].z_max == 0.25
    (laser,) = robot.rangers
    assert (laser.samples, laser.range_max, laser.x, laser.z) == pytest.approx((1081, 30, 0.05, 0.16))
    assert laser.fov == pytest.approx(math.radians(270.25))
    own = add_robot(load("define erratic position ( size [1 1 1] )"), "erratic", Pose2(0, 0, 0), "a")
    assert own.rangers == ()


def test_add_robot_refuses_what_is_no_robot(load: LoadText) -> None:
    """An unknown macro and a macro of another type are errors that list the robots there are."""
    world = load("define box model ()\ndefine bot position ()\ndefine pair position ( position () )")
    for name in ("box", "gone"):
        with pytest.raises(WorldError, match=f"no robot macro '{name}' in this world; there are: bot, erratic, pair"):
            add_robot(world, name, Pose2(0, 0, 0), "a")
    with pytest.raises(WorldError, match="macro 'pair' holds 2 robots"):
        add_robot(world, "pair", Pose2(0, 0, 0), "a")


def test_a_world_without_robots_takes_robots(tmp_path: Path) -> None:
    """A floor, macros alone, or nothing at all is a world, of a .world file as of a map's YAML."""
    path = tmp_path / "w.world"
    for text, count in (
        ("", 0),
        ("define bot position ( size [1 1 1] )", 0),
        ("model ( pose [2.1 0 0 0] size [0.2 9 1] )", 1),
    ):
        path.write_text(text)
        world = load_world(path)
        assert (world.robots, len(world.obstacles), world.warnings) == ((), count, ())
    robot = add_robot(world, "erratic", Pose2(0, 0, 0), "robot_0")
    ranges = Engine(world, robots={0: robot}).observe().robots[0].readings[0].ranges
    assert ranges[540] == pytest.approx(1.95)


def test_importing_the_package_is_cheap() -> None:
    """Robot processes may import zteam.world: that loads neither Pillow nor kernels, pymunk or zenoh."""
    code = "import sys, zteam.world; print({'PIL', 'zteam.kernels.binding', 'pymunk', 'zenoh'} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "set()"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_tells_the_encoding(tmp_path: Path, encoding: str) -> None:
    """An editor may save UTF-16, or UTF-8 with a mark: both are read."""
    path = tmp_path / "mine.world"
    path.write_text('position( name "Jürgen" )', encoding=encoding)
    assert [robot.name for robot in load_world(path).robots] == ["Jürgen"]
