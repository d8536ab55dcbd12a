"""A robot with a description: its joints in the tree of transforms, looked up over the bus."""

from pathlib import Path

import pytest

from support.limits import ASKED
from zteam.team.testing.team import TeamFixture
from zteam.transforms.client import TransformClient

pytestmark = pytest.mark.team


URDF = """<robot name="bot">
  <link name="base_link"/><link name="mast"/><link name="wheel_left"/>
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
