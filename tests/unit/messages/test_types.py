"""Types by name, defaults, equality and JSON."""

import math

import msgspec
import numpy as np
import pytest

from zteam import messages
from zteam.errors import UsageError
from zteam.messages import (
    LaserScan,
    Odometry,
    Point32,
    Polygon,
    PolygonStamped,
    PoseStamped,
    TFMessage,
    Time,
    Twist,
    all_types,
    decode,
    encode,
    encoding_of,
    from_text,
    message_type,
    ns_from_time,
    time_from_ns,
    to_json,
    to_plain,
    type_of_encoding,
)
from zteam.messages.jsonform import from_words


def test_types_have_three_names() -> None:
    """ROS 2's, ROS 1's and the bare name mean the same type; a mistyped name gets the nearest right ones."""
    for name in ("sensor_msgs/msg/LaserScan", "sensor_msgs/LaserScan", "LaserScan"):
        assert message_type(name) is LaserScan
    with pytest.raises(UsageError, match="did you mean LaserScan"):
        message_type("LaserScam")


def test_every_type_is_importable_by_its_bare_name() -> None:
    """zteam.messages exports each type, and its encoding leads back to it."""
    own = {name: kind for name, kind in all_types().items() if kind.__module__.startswith("zteam.")}
    assert "sensor_msgs/msg/LaserScan" in own
    for ros_type, kind in own.items():
        assert getattr(messages, ros_type.rpartition("/")[2]) is kind
        assert type_of_encoding(encoding_of(kind)) is kind
    assert type_of_encoding("text/plain") is None


def test_defaults_are_not_shared() -> None:
    """Changing one message's parts leaves the next one's alone, and default arrays refuse changes."""
    Twist().linear.x = 5.0
    TFMessage().transforms.append(messages.TransformStamped())
    assert Twist().linear.x == 0.0
    assert TFMessage().transforms == []
    with pytest.raises(ValueError, match="read-only"):
        Odometry().pose.covariance[0] = 1.0


def test_messages_compare_by_value() -> None:
    """Equality looks into arrays, and counts NaN as equal to itself."""
    a = LaserScan(ranges=np.array([1.0, math.nan], np.float32))
    b = LaserScan(ranges=np.array([1.0, math.nan], np.float32))
    assert a == b
    assert not a != b  # noqa: SIM202 - the operator is what is tested
    b.ranges = np.array([1.0, 2.0], np.float32)
    assert a != b
    assert Twist() != Odometry()


def test_stamps_round_trip() -> None:
    """Nanoseconds to a stamp and back is exact."""
    for ns in (0, 1, 999_999_999, 1_000_000_000, 1_795_221_285_894_000_001):
        assert ns_from_time(time_from_ns(ns)) == ns


def test_json_has_no_infinity() -> None:
    """inf and NaN become null, float32 values keep their short form."""
    scan = LaserScan(ranges=np.array([0.1, math.inf, math.nan], np.float32), range_max=math.inf)
    plain = msgspec.json.decode(to_json(scan))
    assert plain["ranges"] == [0.1, None, None]
    assert plain["range_max"] is None


def test_single_float32_values_have_their_short_form_too() -> None:
    """Also in messages within messages, and the text leads back to the same bytes; float64 keeps all its digits."""
    sent = PolygonStamped(polygon=Polygon([Point32(0.1, -0.225, 3.0), Point32(2.0, 0.0, 1.0)]))
    arrived = decode(PolygonStamped, encode(sent))
    assert arrived.polygon.points[0].x != 0.1
    assert to_plain(arrived)["polygon"]["points"][0] == {"x": 0.1, "y": -0.225, "z": 3.0}
    assert encode(from_text(PolygonStamped, to_json(arrived).decode())) == encode(sent)
    assert to_plain(Point32(1e300, math.nan))["x"] == 1e300
    assert to_plain(messages.Point(x=0.1 + 0.2))["x"] == 0.1 + 0.2


@pytest.mark.parametrize("text", ['{"linear": {"x": 0.2}}', "{linear: {x: 0.2}}", "linear:\n  x: 0.2"])
def test_messages_are_typed_as_json_or_yaml(text: str) -> None:
    """What a ROS user types is a message; missing fields keep their defaults."""
    assert from_text(Twist, text).linear.x == 0.2
    assert from_text(Twist, text).angular.z == 0.0


def test_a_number_with_an_exponent_is_one_without_a_dot_too() -> None:
    """As YAML 1.2 and ROS read it."""
    assert from_text(Twist, "{linear: {x: 5e-2}}").linear.x == 0.05


@pytest.mark.parametrize(
    ("kind", "text", "place"),
    [
        (Twist, "{linear: {q: 1}}", "Twist.linear has no field 'q'"),
        (Twist, "{linear: {x: fast}}", "Twist.linear.x: expected a number"),
        (Twist, "[1, 2]", "Twist: expected fields"),
        (Twist, "{linear: ", "neither JSON nor YAML at character 10: expected the node content"),
        (Twist, "linear:{x:", "in"),
        (Twist, "{linear: {x:0.5}}", "no field 'x:0.5': its fields are x, y, z$"),
        (messages.RobotStatus, "{robot_id: 1.0e+20}", "RobotStatus.robot_id: expected a whole number"),
        (messages.RobotStatus, "{robot_id: .inf}", "RobotStatus.robot_id: expected a whole number"),
        (messages.RobotStatus, "{robot_id: .nan}", "RobotStatus.robot_id: expected a whole number"),
        (messages.RobotStatus, f"{{robot_id: 1{'0' * 400}}}", "RobotStatus.robot_id: expected a whole number"),
        (Twist, f"{{linear: {{x: 1{'0' * 400}}}}}", r"Twist.linear.x: expected a number up to 1.8e\+308"),
        (Point32, "{y: -1.0e+39}", r"Point32.y: expected a number up to 3.4e\+38"),
        (messages.Header, "{frame_id: 2020-13-45}", "neither JSON nor YAML: month must be in 1..12"),
        (messages.Bool, "{data: 1}", "Bool.data: expected true or false"),
        (Odometry, "{pose: {covariance: [1]}}", "covariance: expected 36 numbers"),
        (TFMessage, "{transforms: [{header: 3}]}", r"transforms\[0\].header: expected fields"),
    ],
)
def test_wrong_input_names_the_field(kind: type[messages.Message], text: str, place: str) -> None:
    """A mistake in a typed message is answered with the field and what it takes."""
    with pytest.raises(UsageError, match=place):
        from_text(kind, text)


def test_the_words_of_ros_1_are_the_fields_in_order() -> None:
    """`rostopic pub` takes a list for each field; a list also fills a nested message. The error names the fields whose
    values are expected."""
    command = from_words(Twist, ["[0.5, 0, 0]", "[0, 0, -1.5]"])
    assert (command.linear.x, command.angular.z) == (0.5, -1.5)
    assert from_words(Twist, ["{linear: [0.5, 0, 0]}"]).linear.x == 0.5
    assert from_words(Twist, []) == Twist()
    for words, text in (
        (["[0.5, 0, 0]", "[0, 0, 0]", "[]"], "Twist: expected the values of linear, angular, got"),
        (["[0.5, 0]", "[0, 0, 0]"], "Twist.linear: expected the values of x, y, z, got"),
        (["0.5", "[0, 0, 0]"], "Twist.linear: expected fields"),
    ):
        with pytest.raises(UsageError, match=text):
            from_words(Twist, words)


def test_now_is_the_time_of_the_caller() -> None:
    """The words `now` for a stamp and `auto` for a header become the given time; without one they are refused. A text
    field keeps the word, and any other message refuses it."""
    for text in ("{header: {stamp: now}}", "{header: auto}", '{"header": {"stamp": "now"}}'):
        assert from_text(PoseStamped, text, lambda: Time(12, 5)).header.stamp == Time(12, 5)
        with pytest.raises(UsageError, match=r"PoseStamped\.header.*: expected fields"):
            from_text(PoseStamped, text)
    assert from_text(messages.String, "{data: now}", Time).data == "now"
    with pytest.raises(UsageError, match=r"Twist\.linear: expected fields"):
        from_text(Twist, "{linear: now}", Time)


def test_json_round_trip() -> None:
    """What `topic echo --json` prints, `topic pub` takes."""
    scan = LaserScan(ranges=np.array([1.5, 2.5], np.float32), angle_min=-1.0)
    scan.header.frame_id = "robot_0/base_laser_link"
    assert from_text(LaserScan, to_json(scan).decode()) == scan


@pytest.mark.few(1)
@pytest.mark.parametrize("text", ["[" * 5000, '{"linear":' * 5000])
def test_deeply_nested_text_is_refused(text: str) -> None:
    """One line, however it is nested."""
    with pytest.raises(UsageError, match=r"^Twist: it is nested too deeply$"):
        from_text(Twist, text)
