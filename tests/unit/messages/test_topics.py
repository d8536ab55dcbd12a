"""The types of keys, for payloads that name none."""

import pytest

from zteam import names
from zteam.messages import Done, Log
from zteam.messages.topics import type_of_key


@pytest.mark.parametrize("name", ["robot_0", "sim", "planner"])
def test_every_process_has_a_log(name: str) -> None:
    """`<name>/log` carries lines and `<name>/done` answers, whatever the process."""
    assert type_of_key(names.log_key(name)) is Log
    assert type_of_key(names.done_key(name)) is Done


@pytest.mark.parametrize("key", ["log", "/log", "*/log", "robot_$*/log", "a/b/log", "robot_0/logs"])
def test_other_keys_are_no_logs(key: str) -> None:
    """Neither a wildcard nor a longer key is the log of a process."""
    assert names.process_of(key, names.LOG) is None
