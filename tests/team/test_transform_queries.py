"""Look-ups over the bus, answered by the aggregator of a running team."""

import math
from pathlib import Path

import pytest

from support.limits import ASKED
from support.transforms import stamped
from zteam import names
from zteam.messages import TFMessage, TransformStamped
from zteam.team.testing.team import TeamFixture
from zteam.tf import FrameInfo
from zteam.transforms.client import Lookup, TransformClient

pytestmark = pytest.mark.team


def test_several_broadcasters_of_a_robot_live_side_by_side(team: TeamFixture) -> None:
    """Another session's fixed frame takes nothing away and changes nothing that the simulator says, and the robots
    drive on; an aggregator that starts later has the sets of both.
    """
    team.start("arena", robots=2, behavior="forward", follow={1: 0}, params={0: {"speed": 0.05}})
    team.wait_for_go()
    client = TransformClient(team.bus)
    chain = [Lookup("map", "robot_0/base_laser_link"), Lookup("robot_0/base_link", "robot_0/camera")]
    other = team.bus.publisher("robot_0/tf_static", TFMessage, latched=True)
    other.put(TFMessage([stamped("map", "odom", 0, 99.0), stamped("base_link", "camera", 0, 0.1)]))
    client.lookup_transform("robot_0/base_link", "robot_0/camera", timeout=ASKED)
    for restart in (False, True):
        if restart:
            team.restart(names.AGGREGATOR)
        commands = team.robot(1).commands
        team.until(lambda least=commands: team.robot(1).commands > least + 5, within=5)
        scanner, camera = client.lookup_many(chain, timeout=ASKED)
        assert isinstance(scanner, TransformStamped)
        assert isinstance(camera, TransformStamped)
        assert math.dist((scanner.transform.translation.x, 0.0), (team.robot(0).pose.x, 0.0)) < 1.0
        assert camera.transform.translation.x == 0.1
    assert team.robot(1).speed > 0.0
    frames = team.bus.ask("tf/frames", dict[str, FrameInfo])
    assert (frames["robot_0/odom"].authority, frames["robot_0/camera"].authority) == (
        "sim",
        f"session {team.bus.instance}",
    )


URDF = """<robot name="bot">
  <joint name="mast_joint" type="fixed">
    <parent link="base_link"/><child link="mast"/><origin xyz="0 0 1"/>
  </joint>
  <joint name="wheel_left_joint" type="continuous">
    <parent link="base_link"/><child link="wheel_left"/><origin xyz="0 0.2 0.05"/><axis xyz="0 1 0"/>
  </joint>
</robot>"""


def test_a_described_robot_has_its_joints_in_the_tree(team: TeamFixture, tmp_path: Path) -> None:
    """The tree has the fixed joints with the robot's prefix, and a wheel turns as the robot drives."""
    (tmp_path / "bot.urdf").write_text(URDF)
    (tmp_path / "team.toml").write_text(
        '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "forward"\nspeed = 0.2\ndescription = "bot.urdf"\n'
    )
    team.launch(tmp_path / "team.toml")
    team.wait_for_go()
    client = TransformClient(team.bus)
    mast = client.lookup_transform("robot_0/base_link", "robot_0/mast", timeout=ASKED)
    assert mast.transform.translation.z == 1.0
    # What comes in a tick is in the tree from the next one on.
    team.run(0.1)
    before = client.lookup_transform("robot_0/base_link", "robot_0/wheel_left", timeout=ASKED).transform.rotation
    team.until(lambda: team.robot(0).distance_travelled > 0.2, within=20)
    after = client.lookup_transform("robot_0/base_link", "robot_0/wheel_left").transform.rotation
    assert abs(before.y * after.y + before.w * after.w) < 0.99
