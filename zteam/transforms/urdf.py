"""Robot descriptions: transforms from URDF files, as robot_state_publisher makes them.

Fixed joints become static transforms; the others, also mimics, follow `robot_N/joint_states`. Frames have the file's
own names; the merger puts a robot's prefix before them.
"""

import math
from contextlib import suppress
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.parsers import expat

from zteam.config.resources import read_file
from zteam.errors import ConfigError, did_you_mean
from zteam.geometry import quaternion_from_rpy
from zteam.kernels.transforms import Floats, compose
from zteam.messages import JointState, Time, TransformStamped
from zteam.transforms.rigid import stamped_transform

MAX_BYTES = 8 * 2**20
_MOVING = ("revolute", "continuous", "prismatic")
_KINDS = ("fixed", *_MOVING, "floating", "planar")
"""The last two have more than one coordinate: as in ROS, another node has to publish where their children are."""
_PLACE = "place of an element"
"""The attribute, of a name that no file can have, with the file and line of an element."""


class Joint(NamedTuple):
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
    """A robot's joints; those that mimic another one stand behind it."""

    joints: tuple[Joint, ...]

    def static_transforms(self) -> list[TransformStamped]:
        return [
            stamped_transform(Time(), joint.parent, joint.child, joint.parent_from_joint)
            for joint in self.joints
            if joint.kind == "fixed"
        ]

    def moving_transforms(self, state: JointState) -> list[TransformStamped]:
        """The transforms of the moving joints whose position is in the message; other names in it are ignored."""
        said = zip(state.name, state.position.tolist(), strict=False)
        known = {name: position for name, position in said if math.isfinite(position)}
        found = []
        for joint in self.joints:
            if joint.mimic is not None and joint.mimic[0] in known:
                leader, multiplier, offset = joint.mimic
                # As in robot_state_publisher, a position of its own goes first.
                known.setdefault(joint.name, multiplier * known[leader] + offset)
            position = known.get(joint.name, math.nan)
            if joint.kind in _MOVING and math.isfinite(position):
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
    """The joints of a URDF file. Raises ConfigError that names the file, the line and the joint.

    As in urdfdom, the joints must make one tree of all links.
    """
    root = _read_xml(path)
    if root.tag != "robot":
        raise ConfigError(f"{path}: not a URDF file, which is a <robot>, but a <{root.tag:.40}>")
    elements = dict[tuple[str, str], ElementTree.Element]()
    for element in root:
        if element.tag in ("link", "joint"):
            key = element.tag, element.get("name", "")
            if not key[1] or key in elements:
                wrong = f"a second {element.tag} has this name" if key[1] else "needs a name"
                raise ConfigError(f"{_place(element)}: {wrong}")
            elements[key] = element
    links = [name for tag, name in elements if tag == "link"]
    joints, above = dict[tuple[str, str], Joint](), dict[tuple[str, str], list[tuple[str, str]]]()
    for element in root.findall("joint"):
        joint, place = _read_joint(element), _place(element)
        key = "joint", joint.name
        for link in (joint.parent, joint.child):
            if ("link", link) not in elements:
                raise ConfigError(f'{place}: there is no <link name="{link:.60}"/>{did_you_mean(link, links)}')
        if ("link", joint.child) in above:
            raise ConfigError(f"{place}: link {joint.child!r:.60} hangs on a joint above: a link has one parent")
        joints[key], above["link", joint.child] = joint, [("link", joint.parent)]
        above[key] = [("joint", joint.mimic[0])] if joint.mimic else []
    roots = [name for name in links if ("link", name) not in above]
    if len(roots) != 1:
        text = f"a robot has one <link> that hangs on no joint; here: {', '.join(roots) or 'none'}"
        raise ConfigError(f"{(elements['link', roots[-1]] if roots else root).attrib[_PLACE]}: {text:.200}")
    try:
        order = [*TopologicalSorter(above).static_order()]
    except CycleError as error:
        circle = error.args[1]
        verb = {"link": "hangs on", "joint": "mimics"}[circle[0][0]]
        text = f"it {verb} itself: {', '.join(name for _, name in circle):.60}"
        raise ConfigError(f"{_place(elements[circle[0]])}: {text}") from None
    return Description(tuple(joints[key] for key in order if key in joints))


def _read_xml(path: Path) -> ElementTree.Element:
    """The root of an XML file. As in urdfdom, prefixes need no declaration: below <gazebo> people leave it out.

    A file that xacro has written may still declare its namespace; it has no elements and no values of it.
    """
    data = read_file(path, "robot description", MAX_BYTES, ConfigError)
    builder, parser, xacro = ElementTree.TreeBuilder(), expat.ParserCreate(), {"xacro"}

    def begin(tag: str, attributes: dict[str, str]) -> None:
        place, items = f"{path}:{parser.CurrentLineNumber}", attributes.items()
        declared = [name for name, value in items if value.rstrip("/").endswith(("/xacro", "#xacro"))]
        # `xmlns` alone: the namespace of this element, whose tag has no prefix.
        xacro.update(name[len("xmlns:") :] for name in declared if name.startswith("xmlns"))
        of_xacro = [f'{name}="{value}"' for name, value in items if "${" in value or "$(" in value]
        of_xacro += [name for name in attributes if ":" in name and name.partition(":")[0] in xacro]
        of_xacro += [f"<{tag}>"] if tag.rpartition(":")[0] in xacro else []
        if of_xacro:
            raise ConfigError(f"{place}: {of_xacro[0]:.60} is of xacro, not of URDF: xacro {path.name} > robot.urdf")
        builder.start(tag, {**attributes, _PLACE: place})

    def refuse(*_: Any) -> None:
        raise ConfigError(f"{path}:{parser.CurrentLineNumber}: a robot description defines no entities")

    parser.StartElementHandler, parser.EndElementHandler, parser.EntityDeclHandler = begin, builder.end, refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        # LookupError: an encoding that Python does not have.
        raise ConfigError(f"{path}: not XML: {error}") from None
    return builder.close()


def _place(element: ElementTree.Element) -> str:
    return f"{element.get(_PLACE)}: {element.tag} {element.get('name') or '(without a name)'!r:.60}"


def _read_joint(element: ElementTree.Element) -> Joint:
    """A joint; of each kind those of its elements that urdfdom reads."""
    place, name, kind = _place(element), element.get("name", ""), element.get("type", "")
    parent, child = (_attribute(element, tag, "link") for tag in ("parent", "child"))
    if kind not in _KINDS or not parent or not child:
        kinds = f"a type of {', '.join(_KINDS)} (not {kind!r:.40})"
        raise ConfigError(f"{place}: needs {kinds}, <parent link=…/> and <child link=…/>")
    x, y, z = _numbers(place, element, "origin", "xyz", "0 0 0")
    roll, pitch, yaw = _numbers(place, element, "origin", "rpy", "0 0 0")
    ahead, left, up = _numbers(place, element, "axis", "xyz", "1 0 0") if kind in _MOVING else (1.0, 0.0, 0.0)
    length = math.hypot(ahead, left, up)
    if length < 1e-9:
        raise ConfigError(f"{place}: its axis has no direction")
    mimic = None
    if element.find("mimic") is not None:
        (multiplier,) = _numbers(place, element, "mimic", "multiplier", "1")
        (offset,) = _numbers(place, element, "mimic", "offset", "0")
        mimic = (_attribute(element, "mimic", "joint"), multiplier, offset)
        if not mimic[0]:
            raise ConfigError(f"{place}: needs <mimic joint=…/>, the joint that it follows")
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
