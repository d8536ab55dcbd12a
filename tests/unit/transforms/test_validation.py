"""Samples that are refused for their names or numbers change nothing."""

import math

import pytest

from support.transforms import S, stamped
from zteam.messages import Quaternion, TransformStamped
from zteam.tf import Buffer, LookupException


def test_a_quaternion_is_normalised() -> None:
    """A quaternion that is slightly too long does not scale what it rotates (in tf2 it does)."""
    buffer = Buffer()
    long = stamped("map", "a", 0, 0.0, 0.0, 0.3)
    rotation = long.transform.rotation
    rotation.z, rotation.w = rotation.z * 1.004, rotation.w * 1.004
    assert buffer.set_transform_static(long, "test") is None
    buffer.set_transform_static(stamped("a", "b", 0, 10.0), "test")
    pose, _ = buffer.lookup_pose2("map", "b", 0)
    assert math.hypot(pose.x, pose.y) == pytest.approx(10.0, abs=1e-12)


@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_numbers_that_are_not_finite_are_refused(value: float) -> None:
    """A sample with inf or NaN is refused, and its frames stay unknown."""
    buffer = Buffer()
    refused = buffer.set_transform(stamped("map", "base", S, value), "robot_1")
    assert refused is not None
    assert refused.code == "TF_NAN_INPUT"
    assert "robot_1" in refused.text
    assert buffer.frames() == {}
    with pytest.raises(LookupException):
        buffer.lookup_transform("map", "base", 0)


@pytest.mark.parametrize(
    ("parent", "child", "code"),
    [
        ("map", "", "TF_NO_CHILD_FRAME_ID"),
        ("map", "/", "TF_NO_CHILD_FRAME_ID"),
        ("", "base", "TF_NO_FRAME_ID"),
        ("/", "base", "TF_NO_FRAME_ID"),
        ("base", "base", "TF_SELF_TRANSFORM"),
        ("/base", "base", "TF_SELF_TRANSFORM"),
    ],
)
@pytest.mark.parametrize("static", [False, True], ids=["moving", "static"])
def test_bad_names_are_refused_without_a_trace(parent: str, child: str, code: str, static: bool) -> None:
    """The refusal has tf2's code and names the authority; both frames stay unknown."""
    buffer = Buffer()
    put = buffer.set_transform_static if static else buffer.set_transform
    refused = put(stamped(parent, child, S), "robot_1")
    assert refused is not None
    assert refused.code == code
    assert "robot_1" in refused.text
    for name in ("map", "base"):
        with pytest.raises(LookupException):
            buffer.lookup_transform(name, "other", 0)


@pytest.mark.parametrize(("square", "accepted"), [(0.985, False), (0.9901, True), (1.0099, True), (1.011, False)])
def test_how_far_from_a_unit_quaternion_is_accepted(square: float, accepted: bool) -> None:
    """The tolerance of the squared length is tf2's, and an accepted quaternion is normalised."""
    buffer = Buffer()
    transform = stamped("map", "base", S)
    transform.transform.rotation = Quaternion(0.0, 0.0, 0.0, math.sqrt(square))
    refused = buffer.set_transform(transform, "test")
    if accepted:
        assert refused is None
        assert buffer.lookup_transform("map", "base", S).transform.rotation.w == pytest.approx(1.0, abs=1e-15)
    else:
        assert refused is not None
        assert refused.code == "TF_DENORMALIZED_QUATERNION"


def test_a_refused_sample_changes_nothing() -> None:
    """A refused sample adds no frame and changes neither authority nor parent."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", 20 * S, 1.0), "first")
    before = buffer.frames()
    for transform in (
        stamped("other", "base", 20 * S, 5.0),
        stamped("other", "base", 9 * S),
        stamped("base", "map", S),
    ):
        assert buffer.set_transform(transform, "second") is not None
    assert buffer.frames() == before
    with pytest.raises(LookupException, match="other"):
        buffer.lookup_transform("other", "base", 0)


def _second(**changes: float) -> TransformStamped:
    """A sample that follows a planar one at 1 s, with one number changed."""
    message = stamped("map", "base", 2 * S, 2.0, 0.0, 0.3)
    for name, value in changes.items():
        part, field = name.split("_")
        pose = message.transform
        setattr(pose.translation if part == "t" else pose.rotation, field, value)
    return message


@pytest.mark.parametrize("field", ["t_x", "t_y", "t_z", "r_x", "r_y", "r_z", "r_w"])
@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_a_stream_is_checked_as_its_first_sample_was(field: str, value: float) -> None:
    """Every sample of a stream is checked as its first one was, also in the short cut for new samples."""
    buffer = Buffer()
    assert buffer.set_transform(stamped("map", "base", S, 1.0), "test") is None
    refused = buffer.set_transform(_second(**{field: value}), "robot_1")
    assert refused is not None
    assert refused.code == "TF_NAN_INPUT"
    assert buffer.frames()["base"].newest == S
    assert buffer.set_transform(_second(), "test") is None
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 2.0


def test_numbers_of_any_size_are_kept() -> None:
    """Two finite coordinates are stored although their sum overflows."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    assert buffer.set_transform(_second(t_x=1.5e308, t_y=1.5e308), "test") is None
    assert buffer.lookup_pose2("map", "base", 2 * S)[0][:2] == (1.5e308, 1.5e308)


def test_a_quaternion_is_normalised_in_a_stream_too() -> None:
    """After other samples too, a slightly long quaternion is normalised and a much longer one refused."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    buffer.set_transform_static(stamped("base", "tip", 0, 10.0), "test")
    assert buffer.set_transform(_second(r_z=0.6 * 1.004, r_w=0.8 * 1.004), "test") is None
    pose, _ = buffer.lookup_pose2("map", "tip", 2 * S)
    assert math.hypot(pose.x - 2.0, pose.y) == pytest.approx(10.0, abs=1e-12)
    for scale in (0.0, 0.99, 1.01):
        message = stamped("map", "base", 3 * S)
        message.transform.rotation = Quaternion(0.0, 0.0, 0.6 * scale, 0.8 * scale)
        refused = buffer.set_transform(message, "test")
        assert refused is not None
        assert refused.code == "TF_DENORMALIZED_QUATERNION"


def test_a_slash_is_stripped_from_every_sample() -> None:
    """Samples of one stream may have names with and without a leading slash."""
    buffer = Buffer()
    for second, (parent, child) in enumerate([("map", "base"), ("/map", "base"), ("map", "/base"), ("/map", "/base")]):
        assert buffer.set_transform(stamped(parent, child, second * S + S, float(second)), "test") is None
    assert list(buffer.frames()) == ["base"]
    assert buffer.frames()["base"].samples == 4
