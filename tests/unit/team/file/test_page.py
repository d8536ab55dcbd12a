"""The page on team files is held to the code: it lists every key, with its default, and shows each in an example."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec
import pytest

from support.pages import DOCS, blocks_of
from zteam.config.simulation_options import Options
from zteam.config.toml_values import parse_value
from zteam.team.file.entries import NodeEntry, RobotEntry, Security, StaticTransform, TeamSection
from zteam.team.file.groups import GROUP_KEYS
from zteam.team.file.reading import Tables

PATH = DOCS / "team-files.md"
KINDS: Mapping[str, type[msgspec.Struct]] = {
    "team": TeamSection,
    "robots": RobotEntry,
    "nodes": NodeEntry,
    "static_transforms": StaticTransform,
    "simulation": Options,
    "security": Security,
}
"""The tables of a team file that have keys of their own."""


def keys_of(table: str) -> set[str]:
    """The keys that a table takes, as a user writes them; those of the file for an empty name."""
    if not table:
        return set(Tables.__struct_fields__)
    further = set(GROUP_KEYS) if table == "robots" else set()
    # Parameters have names of their own, which the behaviour knows.
    return {*KINDS[table].__struct_fields__, *further} - {"params"}


def listed(table: str) -> Iterator[tuple[str, list[str]]]:
    """Each key of the page's list for a table, with the further cells of its row."""
    sections = re.split(r"^## ", PATH.read_text(), flags=re.MULTILINE)
    (section,) = [s for s in sections if s.splitlines()[0].strip("`[] ") == (table or "# Team files")]
    rows = section.split("| --- |", 1)[1].splitlines()[1:]
    for row in rows:
        if not row.startswith("|"):
            return
        keys, *cells = (cell.strip() for cell in row.removeprefix("|").split("|"))
        yield from ((key, cells) for key in re.findall(r"`(\w+)`", keys))


def shown() -> Iterator[tuple[str, str]]:
    """(table, key) of everything in the page's examples."""
    for block in blocks_of(PATH):
        if block.language == "toml":
            content: dict[str, Any] = tomllib.loads(block.code)
            for name, value in content.items():
                yield "", name
                for table in value if isinstance(value, list) else [value]:
                    yield from ((name, key) for key in table) if isinstance(table, dict) else ()


@pytest.mark.parametrize("table", ["", *KINDS])
def test_every_key_is_listed_once(table: str) -> None:
    """No key of the schema is missing, and no other one is listed."""
    keys = [key for key, _ in listed(table)]
    assert sorted(keys) == sorted(keys_of(table))


@pytest.mark.parametrize("table", KINDS)
def test_the_defaults_are_those_of_the_code(table: str) -> None:
    """A default is written as in a file; a key without one has none in the code, or it is said in words."""
    fields = {field.encode_name: field.default for field in msgspec.structs.fields(KINDS[table])}
    for key, (default, *_) in listed(table):
        if default and key != "behavior":
            value = fields[key]
            expected = pytest.approx(value, rel=1e-3) if isinstance(value, float) else value
            assert parse_value(default.strip("`")) == expected, key
        elif key in fields:
            assert fields[key] in (None, msgspec.NODEFAULT) or key in ("base", "behavior"), key


def test_every_key_is_in_an_example() -> None:
    """The blocks of the page are executed by tests/unit/test_docs_blocks.py."""
    known = {(table, key) for table in ("", *KINDS) for key in keys_of(table)}
    assert not known - set(shown())
