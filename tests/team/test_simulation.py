"""The simulator process: the messages of every device, and the options of a team file."""

import json
import math
from pathlib import Path

import pytest

from zteam.messages import Blobs, Bumper, Fiducials, JointState, LaserScan, Twist, Vector3
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

WORLD = """
define bot position (
  size [0.4 0.4 0.3]
  wheel_radius 0.1
  ranger ( pose [0 0 -0.2 0] sensor ( range [0 8] fov 180 samples 31 ) )
  fiducial ( pose [0 0 -0.2 0] range_max 6 )
  bumper ( pose [0 0 -0.2 0] bcount 1
    blength 0.3
    bpose[0] [0.2 0 0 0]
  )
  blobfinder ( pose [0 0 -0.2 0] colors ["green"] )
)
model ( name "wall" pose [3 0 0 0] size [0.2 10 1] color "gray" )
bot ( name "a" pose [0 0 0 0] fiducial_return 1 color "red" )
bot ( name "b" pose [1 0.5 0 180] fiducial_return 2 color "green" )
"""

TEAM = """
[team]
world = "yard.world"
[simulation]
gaussian_noise = 0.05
no_hit = "inf"
physics = "kinematic"
[[robots]]
id = 0
"""


@pytest.mark.real_time
def test_every_device_is_on_the_bus(team: TeamFixture, tmp_path: Path) -> None:
    """Fiducials, blobs, bumper and joint states arrive with their frames and values, and driving turns the wheels."""
    (tmp_path / "yard.world").write_text(WORLD)
    team.spawn("zteam-sim", str(tmp_path / "yard.world"), name="sim")
    team.wait_for_processes("sim")
    bus, seen = team.bus, {}
    for key, kind in (
        ("robot_0/fiducials", Fiducials),
        ("robot_0/blobs", Blobs),
        ("robot_0/bumper", Bumper),
        ("robot_0/joint_states", JointState),
    ):
        bus.subscribe(key, kind, lambda key, message: seen.__setitem__(key, message))
    team.wait_for(lambda: len(seen) == 4)
    (fiducial,) = seen["robot_0/fiducials"].fiducials
    assert (fiducial.id, fiducial.range) == (2, pytest.approx(math.hypot(1, 0.5), abs=1e-5))
    assert fiducial.bearing == pytest.approx(math.atan2(0.5, 1), abs=1e-5)
    assert seen["robot_0/fiducials"].header.frame_id == "robot_0/fiducial_link"
    (blob,) = seen["robot_0/blobs"].blobs
    assert (blob.name, blob.color.g) == ("green", pytest.approx(128 / 255))
    assert seen["robot_0/bumper"].pressed.tolist() == [False]
    assert seen["robot_0/joint_states"].name == ["wheel_left_joint", "wheel_right_joint"]
    commands = bus.publisher("robot_0/cmd_vel", Twist)

    def touches() -> bool:
        commands.put(Twist(Vector3(0.9)))
        return bool(seen["robot_0/bumper"].pressed.any())

    team.wait_for(touches)
    assert seen["robot_0/joint_states"].position[0] > 20.0
    tree = json.loads(team.command("topic", "echo", "robot_0/tf_static", "--once", "--json").stdout)
    children = {t["child_frame_id"] for t in tree["transforms"]}
    assert {"robot_0/fiducial_link", "robot_0/blobfinder_link", "robot_0/base_laser_link"} <= children


def test_a_team_file_says_how_its_world_is_simulated(team: TeamFixture, tmp_path: Path) -> None:
    """The simulator uses [simulation]: its scans have noise, and inf where a beam hits nothing."""
    (tmp_path / "yard.world").write_text(WORLD)
    (tmp_path / "team.toml").write_text(TEAM)
    team.launch(tmp_path / "team.toml")
    scans: list[LaserScan] = []
    team.bus.subscribe("robot_1/base_scan", LaserScan, lambda _key, scan: scans.append(scan))
    team.until(lambda: len(scans) >= 15, within=10)
    side = [float(scan.ranges[30]) for scan in scans]
    assert side[0] == math.inf
    ahead = [float(scan.ranges[5]) for scan in scans if math.isfinite(scan.ranges[5])]
    assert len(set(ahead)) == len(ahead)


def test_a_team_file_sets_what_a_base_can_do(team: TeamFixture, tmp_path: Path) -> None:
    """Two robots want the same speed; the one whose table [robots.base] sets a lower limit keeps to it.

    `base_info` stays as the world has it.
    """
    (tmp_path / "yard.world").write_text(WORLD)
    slow = "[robots.base]\nmax_vel_x = 0.1\n"
    robots = f"behavior = 'forward'\nspeed = 0.4\n{slow}[[robots]]\nid = 1\nbehavior = 'forward'\nspeed = 0.4\n"
    (tmp_path / "team.toml").write_text(TEAM + robots)
    team.launch(tmp_path / "team.toml")
    team.wait_for_go()
    team.run(2.0)
    assert team.robot(0).distance_travelled == pytest.approx(0.2, abs=0.05)
    assert team.robot(1).distance_travelled == pytest.approx(0.8, abs=0.1)
    info = json.loads(team.command("topic", "echo", "robot_0/base_info", "--once", "--json").stdout)
    assert (info["model"], info["max_vel_x"], info["acc_lim_x"], len(info["footprint"]["points"])) == (
        "bot",
        1.0,
        None,
        4,
    )
