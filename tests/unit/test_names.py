"""Key expressions, and keys of presence tokens."""

import pytest

from zteam import names
from zteam.messages import topics
from zteam.names import split_namespaced_token_key, token_key


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


@pytest.mark.parametrize("namespace", ["", "lab", "floor/2"])
def test_a_token_in_a_namespace_is_split(namespace: str) -> None:
    """A session without a namespace sees the namespace before the token's own key."""
    key = "/".join(filter(None, (namespace, token_key("robot_0", "1f"))))
    assert split_namespaced_token_key(key) == (namespace, "robot_0", "1f")


@pytest.mark.parametrize("key", ["", "robot_0", "alive/1f", "lab/robot_0/claim/1f", "lab/robot_0/alive/*"])
def test_other_keys_are_no_tokens(key: str) -> None:
    """Claims, wildcards and shorter keys are none."""
    assert split_namespaced_token_key(key) is None


@pytest.mark.parametrize(
    ("name", "robot_id"), [("nav_0", 0), ("nav_17", 17), ("nav_017", None), ("nav_", None), ("robot_1", None)]
)
def test_the_robot_of_a_navigation_process_is_in_its_name(name: str, robot_id: int | None) -> None:
    """Only `nav_N` with a robot's id navigates a robot."""
    assert names.navigated_robot_of(name) == robot_id
    assert robot_id is None or names.navigation_name(robot_id) == name


TAKEN = ("sim", "tf", "map", "monitor", "up", "view", "view_1f", "router", "operator")
"""Names of what is in every team."""
NEVER = ("clock", "tf_static", "team_status", "static", "ca", "Ca")
"""Names of topics, and those that mean something else to zteam."""
NO_CHUNK = ("", "a/b", "clock/x", "a*", "$*", "robot_$*", "@session", "a b", "a\n", "ü", "\u202e", "a?", "x" * 101)
"""What is no part of a key, or cannot be read."""


@pytest.mark.parametrize("name", [*NEVER, *NO_CHUNK])
def test_no_process_has_such_a_name(name: str) -> None:
    """One line says why."""
    told = names.name_problem(name)
    assert told and told.isprintable()


def test_names_that_a_user_may_choose() -> None:
    """Those of every team are no user's; those of robots, their navigation and bases, and of goals, may be."""
    free = ("crowd", "clock_2", "my.map", "robot_1", "nav_0", "base_3", "goals", "viewer", "t-f")
    assert not any(names.name_problem(name) for name in (*TAKEN, *free))
    assert [name for name in (*TAKEN, *free) if names.is_taken(name)] == [*TAKEN]


def test_no_key_of_the_team_is_below_a_name_that_a_user_may_choose() -> None:
    """In Zenoh `clock/**` includes `clock`."""
    for key in topics._TEAM:
        name = key.partition("/")[0]
        assert names.name_problem(name) or names.is_taken(name), key
