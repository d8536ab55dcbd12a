"""Message types that a user defines."""

from collections.abc import Iterator
from typing import Annotated

import pytest

from zteam.errors import UsageError
from zteam.messages import Message, Twist, decode, encode, float64, from_text, message_type
from zteam.messages.message import REGISTERED


@pytest.fixture(autouse=True)
def _forget() -> Iterator[None]:
    """The types that a test defines end with it."""
    before = dict(REGISTERED)
    yield
    REGISTERED.clear()
    REGISTERED.update(before)


def test_a_class_defined_anew_replaces_the_one_before() -> None:
    """A notebook's cell may run twice; the name then means the newest class, with its own bytes."""

    class Level(Message):
        ros_type = "my_msgs/msg/Level"
        metres: float64 = 0.0

    first = Level

    class Level(Message):  # type: ignore[no-redef]
        ros_type = "my_msgs/msg/Level"
        metres: float64 = 0.0
        name: str = ""

    assert message_type("Level") is Level is not first
    assert decode(Level, encode(Level(2.0, "tank"))) == Level(2.0, "tank")
    assert decode(first, encode(first(2.0))) == first(2.0)


def test_a_bare_name_means_zteams_own_type_first() -> None:
    """A user's type of the same bare name is reached by its full name."""

    class Other(Message):
        ros_type = "a_msgs/msg/Twist"

    assert message_type("Twist") is Twist
    assert message_type("a_msgs/Twist") is Other


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("Level", "Level: ros_type is 'Level'; write it as 'my_msgs/msg/Level'"),
        ("my_msgs/Level", "write it as 'my_msgs/msg/Level'"),
        ("my msgs/msg/Level", "write it as"),
        ("geometry_msgs/msg/Twist", "geometry_msgs/msg/Twist is a type of zteam's own; choose another package name"),
    ],
)
def test_a_wrong_ros_type_is_refused(name: str, text: str) -> None:
    """It is told where the class is defined."""
    with pytest.raises(UsageError, match=text):
        type("Level", (Message,), {"ros_type": name, "__module__": __name__})


@pytest.mark.parametrize("hint", [float, Annotated[float, "float16"], Annotated[list[int], "uint64[]"], dict[str, int]])
def test_a_field_without_a_form_on_the_wire_is_named(hint: object) -> None:
    """Encoding, decoding and reading text say which field it is and what to write."""
    fields = {"__annotations__": {"metres": hint}, "metres": None}
    kind = type("Level", (Message,), {"ros_type": "my_msgs/msg/Level", "__module__": __name__, **fields})
    for use in (lambda: encode(kind()), lambda: decode(kind, bytes(40)), lambda: from_text(kind, "{metres: 1}")):
        with pytest.raises(UsageError, match=r"^Level\.metres: .* has no form on the wire; use float64, Float64Seq"):
            use()
