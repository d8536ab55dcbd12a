"""Keys of presence tokens."""

import pytest

from zteam.names import split_namespaced_token_key, token_key


@pytest.mark.parametrize("namespace", ["", "lab", "floor/2"])
def test_a_token_in_a_namespace_is_split(namespace: str) -> None:
    """A session without a namespace sees the namespace before the token's own key."""
    key = "/".join(filter(None, (namespace, token_key("robot_0", "1f"))))
    assert split_namespaced_token_key(key) == (namespace, "robot_0", "1f")


@pytest.mark.parametrize("key", ["", "robot_0", "alive/1f", "lab/robot_0/claim/1f", "lab/robot_0/alive/*"])
def test_other_keys_are_no_tokens(key: str) -> None:
    """Claims, wildcards and shorter keys are none."""
    assert split_namespaced_token_key(key) is None
