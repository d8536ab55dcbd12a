"""Robot descriptions: transforms from URDF files, as robot_state_publisher makes them.

Fixed joints become static transforms; the others, also mimics, follow `robot_N/joint_states`. Frames have the file's
own names; the merger puts a robot's prefix before them.
"""

import math
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from zteam.config.resources import read_file
from zteam.errors import ConfigError
from zteam.geometry import quaternion_from_rpy
from zteam.messages import JointState, Time, TransformStamped
from zteam.transforms.rigid import Floats, compose, stamped_transform

MAX_BYTES = 8 * 2**20
_KINDS = ("fixed", "revolute", "continuous", "prismatic")
_SKIPPED = ("floating", "planar")
"""Joints with more than one coordinate: another node has to publish the transforms of their children, as in ROS."""


class Joint(NamedTuple):
    """A joint between a parent link and a child link."""

    name: str
    kind: str
    parent: str
    child: str
    parent_from_joint: Floats
    axis: tuple[float, float, float]
    """A unit vector in the joint's frame."""
    mimic: tuple[str, float, float] | None
    """(joint, multiplier, offset) of a joint that follows another: position = multiplier * that one's + offset."""


class Description(NamedTuple):
    """A robot's joints."""

    joints: tuple[Joint, ...]

    def static_transforms(self) -> list[TransformStamped]:
        return [
            stamped_transform(Time(), joint.parent, joint.child, joint.parent_from_joint)
            for joint in self.joints
            if joint.kind == "fixed"
        ]

    def moving_transforms(self, state: JointState) -> list[TransformStamped]:
        """The transforms of the moving joints whose position is in the message; other names in it are ignored."""
        known = dict(zip(state.name, state.position.tolist(), strict=False))
        found = []
        for joint in self.joints:
            position = known.get(joint.name, math.nan)
            if joint.mimic is not None and joint.mimic[0] in known:
                leader, multiplier, offset = joint.mimic
                position = multiplier * known[leader] + offset
            if joint.kind != "fixed" and math.isfinite(position):
                moved = compose(joint.parent_from_joint, _moved(joint, position))
                found.append(stamped_transform(state.header.stamp, joint.parent, joint.child, moved))
        return found


def _moved(joint: Joint, position: float) -> Floats:
    """The transform of a joint at a position in radians or metres."""
    x, y, z = joint.axis
    if joint.kind == "prismatic":
        return (x * position, y * position, z * position, 0.0, 0.0, 0.0, 1.0)
    sine = math.sin(0.5 * position)
    return (0.0, 0.0, 0.0, x * sine, y * sine, z * sine, math.cos(0.5 * position))


def read_description(path: Path) -> Description:
    """The joints of a URDF file. Raises ConfigError that names the file and the joint."""
    data = read_file(path, "robot description", MAX_BYTES, ConfigError)
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        # LookupError: an encoding that Python does not have.
        raise ConfigError(f"{path}: not XML: {error}") from None
    if root.tag != "robot" or any(each.tag.startswith("{http://www.ros.org/wiki/xacro}") for each in root.iter()):
        raise ConfigError(f"{path}: not a URDF file, which is a <robot>; of a xacro file: xacro FILE > robot.urdf")
    joints = tuple(joint for element in root.findall("joint") if (joint := _read_joint(path, element)))
    for child, count in Counter(joint.child for joint in joints).items():
        if count > 1:
            raise ConfigError(f"{path}: link {child!r:.60} hangs on {count} joints: a link has one parent")
    return Description(joints)


def _read_joint(path: Path, element: ElementTree.Element) -> Joint | None:
    name = element.get("name") or ""
    place = f"{path}: joint {name or '(without a name)'!r:.60}"
    kind = element.get("type", "")
    if kind in _SKIPPED:
        return None
    parent, child = (_attribute(element, tag, "link") for tag in ("parent", "child"))
    if not name or kind not in _KINDS or not parent or not child:
        kinds = f"a type of {', '.join(_KINDS)} (not {kind!r:.40})"
        raise ConfigError(f"{place}: needs a name, {kinds}, <parent link=…/> and <child link=…/>")
    x, y, z = _numbers(place, element, "origin", "xyz", "0 0 0")
    roll, pitch, yaw = _numbers(place, element, "origin", "rpy", "0 0 0")
    ahead, left, up = axis = _numbers(place, element, "axis", "xyz", "1 0 0")
    length = math.hypot(*axis)
    if length < 1e-9:
        raise ConfigError(f"{place}: its axis has no direction")
    mimic = None
    if element.find("mimic") is not None:
        (multiplier,) = _numbers(place, element, "mimic", "multiplier", "1")
        (offset,) = _numbers(place, element, "mimic", "offset", "0")
        mimic = (_attribute(element, "mimic", "joint"), multiplier, offset)
    parent_from_joint = (x, y, z, *quaternion_from_rpy(roll, pitch, yaw))
    return Joint(name, kind, parent, child, parent_from_joint, (ahead / length, left / length, up / length), mimic)


def _attribute(element: ElementTree.Element, tag: str, name: str) -> str:
    found = element.find(tag)
    return found.get(name, "") if found is not None else ""


def _numbers(place: str, element: ElementTree.Element, tag: str, name: str, default: str) -> list[float]:
    """The numbers of an attribute, as many as `default` has, which holds without it. Raises ConfigError."""
    text, count = _attribute(element, tag, name) or default, len(default.split())
    values: list[float] = []
    with suppress(ValueError):
        values = [float(word) for word in text.split()]
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ConfigError(f"{place}: {tag} {name} must be {count} finite number{'s' * (count > 1)}, not {text!r:.60}")
    return values
