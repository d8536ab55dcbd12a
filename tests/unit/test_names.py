"""Key expressions."""

import pytest

from zteam import names


@pytest.mark.parametrize(
    ("key_expr", "keys"),
    [
        ("robot_0/odom", ["robot_0/odom"]),
        ("robot_$*/odom", ["robot_1/odom", "robot_3/odom"]),
        ("robot_$*/camera/image", ["robot_1/camera/image", "robot_3/camera/image"]),
        ("robot_$*", []),
        ("robot_$*/*", []),
        ("*/done", []),
        ("**", []),
    ],
)
def test_a_wildcard_over_robots_is_a_key_of_each(key_expr: str, keys: list[str]) -> None:
    """Only the wildcard over all robots can be resolved: what other wildcards mean is not known."""
    assert names.keys_in(key_expr, [1, 3]) == keys
