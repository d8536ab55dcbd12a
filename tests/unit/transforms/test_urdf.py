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
  <link name="base_link"/><link name="camera"/><link name="wheel_left"/><link name="wheel_right"/>
  <link name="hook"/><link name="cable"/>
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


def joint(name: str, parent: str, child: str, rest: str = "", kind: str = "continuous") -> str:
    """A joint, which turns unless it is of another kind."""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{rest}</joint>'


def robot(links: str, *parts: str, attributes: str = "") -> str:
    """A robot of these links, each a letter, and these joints."""
    elements = "".join([f'<link name="{link}"/>' for link in links] + [*parts])
    return f"<robot {attributes}>{elements}</robot>"


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


def mimic(name: str, child: str, leader: str, factor: float = 1.0) -> str:
    """A joint on link x that follows another one."""
    return joint(name, "x", child, f'<mimic joint="{leader}" multiplier="{factor}"/>')


def position_of(path: Path, text: str, said: dict[str, float], child: str) -> float | None:
    """The angle of a link about its joint's axis after joint states; None if it has no transform."""
    path.write_text(text)
    state = JointState(name=[*said], position=np.array([*said.values()]))
    found = by_child(read_description(path).moving_transforms(state)).get(child)
    return None if found is None else 2 * math.atan2(found.transform.rotation.x, found.transform.rotation.w)


@pytest.mark.parametrize(
    ("said", "angle"),
    [
        ({"c": 0.1}, 0.1 * 2 * 3),
        ({"b": 0.1}, 0.3),
        ({"a": 0.1, "b": 0.2, "c": 0.3}, 0.1),
        ({"c": 0.3, "a": math.nan}, 1.8),
        ({"d": 0.1}, None),
    ],
)
def test_a_mimic_follows_what_is_known(tmp_path: Path, said: dict[str, float], angle: float | None) -> None:
    """A mimic follows through a chain in any order of the file; a position that is published for it goes first."""
    text = robot("xabc", mimic("a", "a", "b", 3.0), mimic("b", "b", "c", 2.0), joint("c", "x", "c"))
    assert position_of(tmp_path / "x.urdf", text, said, "a") == (angle if angle is None else pytest.approx(angle))


GAZEBO = '<gazebo reference="x"><sensor:camera gz:name="a"/></gazebo>'


@pytest.mark.parametrize(
    "text",
    [
        robot("xy", joint("a", "x", "y", '<axis xyz="0 0 0"/>', "fixed")),
        robot("xy", joint("a", "x", "y", '<axis xyz="no"/>', "fixed")),
        robot("xy", joint("a", "x", "y", '<axis xyz="0 0 0"/>', "floating")),
        robot("xy", joint("a", "x", "y", '<axis xyz="0 0 0"/>', "planar")),
        robot("xy", joint("a", "x", "y", '<limit effort="?"/><dynamics damping="?"/>')),
        robot("xy", joint("a", "x", "y"), GAZEBO, attributes='xmlns:xacro="http://www.ros.org/wiki/xacro"'),
        robot("xy", joint("a", "x", "y"), attributes='xmlns="http://www.ros.org"'),
        "<!DOCTYPE robot>" + robot("xy", joint("a", "x", "y"), "<transmission><joint name='a'/></transmission>"),
    ],
)
def test_what_is_not_read_is_no_mistake(tmp_path: Path, text: str) -> None:
    """Elements that a joint of its kind does not use, and those of other programs, refuse no file."""
    path = tmp_path / "x.urdf"
    path.write_text(text)
    assert [(each.name, each.parent, each.child) for each in read_description(path).joints] == [("a", "x", "y")]


XACRO = "is of xacro"


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("<robot", "not XML"),
        ("<model/>", "which is a <robot>"),
        ('<?xml version="1.0" encoding="klingon"?><robot/>', "not XML"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><robot name="&a;"/>', ":1: a robot description defines no entities"),
        (robot("x", "<xacro:macro/>", attributes='xmlns:xacro="http://www.ros.org/wiki/xacro"'), XACRO),
        (robot("x", "<xacro:macro/>", attributes='xmlns:xacro="http://ros.org/wiki/xacro"'), XACRO),
        (robot("x", "<x:macro/>", attributes='xmlns:x="http://wiki.ros.org/xacro/"'), XACRO),
        (robot("x", "\n<xacro:macro/>"), f":2: <xacro:macro> {XACRO}"),
        (robot("x", "<x:macro/>", attributes='xmlns:x="http://playerstage.sourceforge.net/#xacro"'), XACRO),
        (robot("x", '<macro xmlns="http://www.ros.org/wiki/xacro"/>'), f":1: <macro> {XACRO}"),
        (robot("x", "", attributes='xmlns="http://www.ros.org/wiki/xacro"'), f":1: <robot> {XACRO}"),
        (robot("x", '<link xacro:if="1" name="b"/>'), f":1: xacro:if {XACRO}"),
        (robot("x", '<link x:if="1" name="b" xmlns:x="http://ros.org/wiki/xacro"/>'), f":1: x:if {XACRO}"),
        (robot("x").replace("x", "${namespace}base_link"), XACRO),
        (robot("x", '<link name="y"><mesh filename="$(find me)/a.stl"/></link>'), XACRO),
        (robot("x", '\n<joint name="a" type="ball"/>'), ":2: joint 'a': needs a type"),
        (robot("x", '<joint name="a" type="fixed"><parent link="x"/></joint>'), "child link"),
        (robot("xy", joint("", "x", "y")), "needs a name"),
        (robot("xy", joint("a", "x", "y", '<origin xyz="1 2"/>')), "origin xyz must be 3 finite numbers"),
        (robot("xy", joint("a", "x", "y", '<axis xyz="0 0 0"/>')), "axis has no direction"),
        (robot("xy", joint("a", "x", "y", "<mimic/>")), "needs <mimic joint=…/>"),
        (robot("xyz", joint("a", "x", "y"), joint("b", "z", "y")), ":1: joint 'b': link 'y' hangs on a joint above"),
        (robot("xyz", joint("a", "x", "y"), joint("a", "x", "z")), "joint 'a': a second joint"),
        (robot("xx"), "link 'x': a second link"),
        (robot(""), "has one <link> that hangs on no joint; here: none"),
        (robot("xy"), ":1: a robot has one <link> that hangs on no joint; here: x, y"),
        (robot("x", joint("a", "base_link", "x"), '<link name="base_lnk"/>'), "base_link.*did you mean base_lnk"),
        (robot("x", joint("a", "x", "y")), "joint 'a': there is no <link name=\"y\"/>"),
        (robot("xy", joint("a", "x", "y"), joint("b", "y", "x")), "here: none"),
        (robot("xyz", joint("a", "y", "z"), joint("b", "z", "y")), "link '.': it hangs on itself"),
        (robot("xyz", joint("z", "y", "z"), "\n" + joint("y", "z", "y")), ":1: link '.': it hangs on itself"),
        (robot("xab", mimic("a", "a", "b"), mimic("b", "b", "a")), "joint '.': it mimics itself"),
        (robot("xa", mimic("a", "a", "a")), "joint '.': it mimics itself"),
    ],
)
def test_a_wrong_file_is_one_error(tmp_path: Path, text: str, error: str) -> None:
    """The error names the file, the line, the joint and the mistake."""
    path = tmp_path / "x.urdf"
    path.write_text(text)
    with pytest.raises(ConfigError, match=error) as caught:
        read_description(path)
    assert "x.urdf" in str(caught.value)
    assert "\n" not in str(caught.value)
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
        assert merger.conflicts() == []
