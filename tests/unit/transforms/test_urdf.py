"""URDF files as transforms."""

import math
from pathlib import Path

import numpy as np
import pytest

from zteam.errors import ConfigError
from zteam.messages import Header, JointState, TFMessage, TransformStamped, time_from_ns
from zteam.transforms.merge import Merger
from zteam.transforms.urdf import read_description

URDF = """<?xml version="1.0"?>
<robot name="bot">
  <link name="base_link"/>
  <joint name="camera_joint" type="fixed">
    <parent link="base_link"/><child link="camera"/><origin xyz="0.1 0 0.3" rpy="0 0 1.5707963267948966"/>
  </joint>
  <joint name="wheel_left_joint" type="continuous">
    <parent link="base_link"/><child link="wheel_left"/><origin xyz="0 0.2 0.05"/><axis xyz="0 2 0"/>
  </joint>
  <joint name="wheel_right_joint" type="continuous">
    <parent link="base_link"/><child link="wheel_right"/><axis xyz="0 1 0"/>
    <mimic joint="wheel_left_joint" multiplier="-2" offset="0.5"/>
  </joint>
  <joint name="lift" type="prismatic"><parent link="camera"/><child link="hook"/><axis xyz="0 0 1"/></joint>
  <joint name="loose" type="floating"><parent link="base_link"/><child link="cable"/></joint>
</robot>
"""


def joint(name: str, parent: str, child: str, rest: str = "") -> str:
    """A joint that turns."""
    return f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>{rest}</joint>'


def joints(*parts: str) -> str:
    """A robot of these."""
    return f"<robot>{''.join(parts)}</robot>"


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """A description of a robot with wheels, a camera and a lift."""
    path = tmp_path / "bot.urdf"
    path.write_text(URDF)
    return path


def by_child(transforms: list[TransformStamped]) -> dict[str, TransformStamped]:
    """Transforms by child."""
    return {transform.child_frame_id: transform for transform in transforms}


def test_fixed_joints_are_static(urdf: Path) -> None:
    """Only fixed joints become static transforms, with their origin and angles."""
    (camera,) = read_description(urdf).static_transforms()
    assert (camera.header.frame_id, camera.child_frame_id) == ("base_link", "camera")
    t, r = camera.transform.translation, camera.transform.rotation
    assert (t.x, t.z, r.z, r.w) == pytest.approx((0.1, 0.3, math.sqrt(0.5), math.sqrt(0.5)))


def test_moving_joints_follow_their_states(urdf: Path) -> None:
    """A wheel turns about its axis, a lift slides along it, a mimic follows; without a position nothing does."""
    state = JointState(
        Header(time_from_ns(5)), ["wheel_left_joint", "lift", "unknown"], np.array([math.pi / 2, 0.25, 1.0])
    )
    found = by_child(read_description(urdf).moving_transforms(state))
    assert set(found) == {"wheel_left", "wheel_right", "hook"}
    left, right, hook = found["wheel_left"].transform, found["wheel_right"].transform, found["hook"].transform
    assert (left.translation.y, left.rotation.y, left.rotation.w) == pytest.approx(
        (0.2, math.sqrt(0.5), math.sqrt(0.5))
    )
    angle = -2 * math.pi / 2 + 0.5
    assert (right.rotation.y, right.rotation.w) == pytest.approx((math.sin(angle / 2), math.cos(angle / 2)))
    assert hook.translation.z == 0.25
    assert found["hook"].header.stamp == time_from_ns(5)
    for still in (JointState(name=["lift"], position=np.array([math.inf])), JointState(name=["lift"])):
        assert read_description(urdf).moving_transforms(still) == []


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("<robot", "not XML"),
        ("<model/>", "which is a <robot>"),
        ('<?xml version="1.0" encoding="klingon"?><robot/>', "not XML"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>', "xacro"),
        ('<robot><joint name="a" type="ball"/></robot>', "joint 'a': needs a name, a type"),
        ('<robot><joint name="a" type="fixed"><parent link="x"/></joint></robot>', "child link"),
        (joints(joint("a", "x", "y", '<origin xyz="1 2"/>')), "origin xyz must be 3 finite numbers"),
        (joints(joint("a", "x", "y", '<axis xyz="0 0 0"/>')), "axis has no direction"),
        (joints(joint("a", "x", "y"), joint("b", "z", "y")), "'y' hangs on 2 joints"),
    ],
)
def test_a_wrong_file_is_one_error(tmp_path: Path, text: str, error: str) -> None:
    """The error names the file, the joint and the mistake."""
    path = tmp_path / "x.urdf"
    path.write_text(text)
    with pytest.raises(ConfigError, match=error) as caught:
        read_description(path)
    assert "x.urdf" in str(caught.value)
    with pytest.raises(ConfigError, match="cannot read"):
        read_description(tmp_path / "gone.urdf")


def test_a_description_gives_way_to_the_base(urdf: Path) -> None:
    """Frames get the robot's prefix; the base's own transform replaces the description's, without a conflict."""
    described = read_description(urdf).static_transforms()
    mine = TransformStamped(Header(frame_id="base_link"), "camera", described[0].transform)
    mine.transform.translation.x = 0.7
    described = read_description(urdf).static_transforms()
    for base_first in (False, True):
        merger = Merger()
        for base in (base_first, not base_first):
            if base:
                merger.receive_static(3, TFMessage([mine]))
            else:
                merger.describe(3, described)
        (said,) = merger.statics.message().transforms
        assert (said.child_frame_id, said.transform.translation.x) == ("robot_3/camera", 0.7)
        assert merger.take_conflicts() == []
