"""What the processes of a team may write and change is what the page on keys says."""

import re
from collections.abc import Iterator

from support.pages import DOCS
from zteam.bus.transport import matches
from zteam.team.file.reading import read_team_tables
from zteam.team.security.access import CHANGES, Rights, rights_of

PAGE = (DOCS / "keys.md").read_text()
WRITERS = {
    "simulator": "sim",
    "base": "base_0",
    "robot": "robot_0",
    "navigation": "nav_0",
    "monitor": "monitor",
    "aggregator": "tf",
    "zteam-map": "map",
}
"""The certificates that words of the column "publisher" stand for. Tools need a grant."""


def rows(column: str) -> Iterator[tuple[list[tuple[str, str]], list[str]]]:
    """The rows of the page's table with this second column: its keys, each with its mark, and the further cells."""
    for row in PAGE.split(f"| {column} |", 1)[1].split("\n\n", 1)[0].splitlines()[2:]:
        first, *rest = row.strip("| ").split(" | ")
        yield re.findall(r"`([^`]+)`(\*?)", first), rest


def writers() -> dict[str, set[str]]:
    """The certificates that may write each key of the page, as it says. Keys with a process's name are left out."""
    found: dict[str, set[str]] = {}
    for keys, (_, publisher) in rows("type | publisher"):
        robots = keys[0][0].startswith("robot_N/")
        for key, _ in keys:
            whole = f"robot_N/{key}" if robots and not key.startswith("robot_N/") else key
            if not whole.startswith("<name>"):
                words = set(re.findall(r"[\w-]+", publisher)) & WRITERS.keys()
                found.setdefault(whole, set()).update(WRITERS[word] for word in words)
    return found


def rights() -> dict[str, Rights]:
    """Of a team with all kinds of processes; a simulator and bases are two teams."""
    robots = [{"id": 0, "navigation": True}, {"id": 1}]
    found: dict[str, Rights] = {}
    for world in ("none", "arena"):
        found |= rights_of(read_team_tables("team", {"team": {"world": world}, "robots": robots}).team)
    return found


def test_all_queries_that_change_something_need_a_grant() -> None:
    """Those that the page marks are those of the access control."""
    marked = [key for row, _ in rows("does") for key, mark in row if mark]
    assert sorted(key.replace("robot_N", "robot_$*") for key in marked) == sorted(CHANGES)


def test_a_key_is_written_by_its_publishers_alone() -> None:
    """No other certificate may write it; a robot, its base and its navigation write the keys of no other robot."""
    all_rights = {name: each for name, each in rights().items() if not each.links}

    def allowed(key: str) -> set[str]:
        return {name for name, each in all_rights.items() if any(matches(key, own) for own in each.publishes)}

    told = writers()
    assert len(told) > 30
    for key, expected in told.items():
        own = key.replace("robot_N", "robot_0").replace("sonar_i", "sonar_3")
        assert allowed(own) == expected, own
        if own != key:
            assert allowed(own.replace("robot_0", "robot_7")) == expected & {"sim"}, own


def test_what_carries_a_name_is_written_by_that_process_alone() -> None:
    """The log and the answers of lock-step."""
    all_rights = rights()
    for name, each in all_rights.items():
        for topic in () if each.links else ("log", "done"):
            key = f"{name}/{topic}"
            assert [other for other, its in rights().items() if any(matches(key, own) for own in its.publishes)] == [
                name
            ]
