"""Message types as text, against an independent reader."""

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from zteam.messages import LaserScan, Message, NavigationStatus, all_types
from zteam.messages.message import RULE, definition_of


def sections(kind: type[Message]) -> dict[str, str]:
    """The text of each type in a definition, by its full name."""
    first, *held = definition_of(kind).split(RULE + "\n")
    named = [text.removeprefix("MSG: ").partition("\n") for text in held]
    return {kind.ros_type: first, **{name.replace("/", "/msg/"): text for name, _, text in named}}


def test_a_text_has_the_fields_of_ros_2() -> None:
    """Every type that ROS 2 has too is read as ROS 2's own, with all types that it holds."""
    known = get_typestore(Stores.ROS2_JAZZY).fielddefs
    own = [kind for kind in all_types().values() if kind.__module__.startswith("zteam.")]
    compared = 0
    for held, text in {section for kind in own for section in sections(kind).items()}:
        read = get_types_from_msg(text, held)
        assert [*read] == [held]
        if held in known:
            # Without the constants, which take no bytes.
            assert read[held][1] == known[held][1], held
            compared += 1
    assert compared > 40


def test_each_held_type_is_told_once() -> None:
    """A time in two fields has one section, and a scan's text is ROS 2's."""
    assert definition_of(NavigationStatus).count("MSG: builtin_interfaces/Time\n") == 1
    assert definition_of(LaserScan).startswith("std_msgs/Header header\nfloat32 angle_min\n")
    assert "float32[] ranges\n" in definition_of(LaserScan)
