"""Lines of keys in TOML texts of every shape, held against a writer that knows where it wrote them."""

import json
import string
import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zteam.config.toml_values import KeyPath, TomlError, key_lines

words = st.text(string.ascii_letters + string.digits + "_-", min_size=1, max_size=4)
keys = words | st.sampled_from(["a b", "x.y", "", "ü", 'say "x"', "#", "[t]", "a = 1"])
scalars = st.sampled_from(
    [
        "1",
        "-2.5",
        "true",
        "nan",
        "1979-05-27 07:32:00",
        '"# [x] = 1"',
        "'''\n[no]\n'''",
        '"""\na = 1\n"x\\\\"""""',
        "''",
    ]
)
blanks = st.sampled_from(["", "\n", "# [c]\n", "\n\n# a = 'b\n"])


class Writer:
    """A TOML text that grows, and the line of every path in it."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.text = ""
        self.lines: dict[KeyPath, int] = {}
        self._draw = draw

    def _begin(self) -> None:
        """A header or a pair begins here: all that it holds has this line."""
        self._line = self.text.count("\n") + 1

    def _note(self, path: KeyPath) -> None:
        self.lines.setdefault(path, self._line)

    def _key(self, key: str) -> str:
        bare = key and set(key) <= set(string.ascii_letters + string.digits + "_-")
        styles = [json.dumps(key)] + ([key] if bare else []) + ([f"'{key}'"] if "'" not in key else [])
        return self._draw(st.sampled_from(styles))

    def pairs(self, table: KeyPath, depth: int) -> None:
        """Some keys with their values, a line each."""
        for key in self._draw(st.lists(keys, unique=True, max_size=3)):
            self.text += self._draw(blanks)
            self._begin()
            self._pair((*table, key), depth)
            self.text += self._draw(st.sampled_from(["\n", " # note = 1\n"]))

    def _pair(self, path: KeyPath, depth: int) -> None:
        self._note(path)
        self.text += self._key(str(path[-1]))
        if depth and self._draw(st.booleans()):
            path = (*path, "dotted")
            self._note(path)
            self.text += " . dotted"
        self.text += " = "
        self._value(path, depth)

    def _value(self, path: KeyPath, depth: int) -> None:
        kind = self._draw(st.sampled_from(["scalar", "array", "table"] if depth else ["scalar"]))
        if kind == "scalar":
            self.text += self._draw(scalars)
        elif kind == "array":
            self.text += "["
            for index in range(self._draw(st.integers(0, 3))):
                self.text += self._draw(blanks)
                self._note((*path, index))
                self._value((*path, index), depth - 1)
                self.text += " ,"
            self.text += self._draw(blanks) + "]"
        else:
            chosen = self._draw(st.lists(keys, unique=True, max_size=2))
            self.text += "{ "
            for number, key in enumerate(chosen):
                self.text += ", " if number else ""
                self._pair((*path, key), depth - 1)
            self.text += " }"

    def header(self, path: KeyPath, text: str) -> None:
        """A line in brackets that begins the table at `path`."""
        self._begin()
        self._note(path)
        self.text += text + self._draw(blanks.map(lambda blank: " " + blank.removesuffix("\n") + "\n"))


@st.composite
def documents(draw: st.DrawFn) -> Writer:
    """Keys, tables, arrays of tables with tables in them."""
    writer = Writer(draw)
    writer.pairs((), 2)
    for number in range(draw(st.integers(0, 2))):
        name = f"table{number}"
        writer.header((name,), f"[ {name} ]")
        writer.pairs((name,), 2)
    for index in range(draw(st.integers(0, 3))):
        writer.header(("array of tables", index), '[["array of tables"]]')
        writer.lines.setdefault(("array of tables",), writer.lines["array of tables", 0])
        writer.pairs(("array of tables", index), 1)
        if draw(st.booleans()):
            writer.header(("array of tables", index, "inner table"), "['array of tables'.'inner table']")
            writer.pairs(("array of tables", index, "inner table"), 1)
    return writer


def paths_in(value: Any, path: KeyPath = ()) -> set[KeyPath]:
    """Every path of a parsed document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return {path}.union(*(paths_in(item, (*path, key)) for key, item in items))


@given(documents())
def test_every_key_has_the_line_it_was_written_on(writer: Writer) -> None:
    """The lines are the writer's, for all that tomllib reads and nothing else."""
    lines = key_lines(writer.text)
    assert lines == writer.lines
    assert paths_in(tomllib.loads(writer.text)) - {()} == set(lines)


@given(st.text("[]{}\"'=.#\n\\,0aé-: ", max_size=60))
def test_what_tomllib_reads_has_lines(text: str) -> None:
    """Any text has lines, or is too deep or no TOML; where it is TOML, every path has one, within the text."""
    try:
        lines = key_lines(text)
    except TomlError as error:
        if "quote" in str(error):
            with pytest.raises(tomllib.TOMLDecodeError):
                tomllib.loads(text)
        return
    assert all(1 <= line <= text.count("\n") + 1 for line in lines.values())
    try:
        read = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    assert paths_in(read) - {()} <= set(lines)
