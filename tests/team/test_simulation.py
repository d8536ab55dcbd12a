"""The simulator process: the messages of every device."""

import json
import math
from pathlib import Path

import pytest

from zteam.messages import Blobs, Bumper, Fiducials, JointState, Twist, Vector3
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
