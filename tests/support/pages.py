"""The code blocks of the pages, and what a comment above a block says of it.

A comment of one line directly above a block holds notes, separated by semicolons:

    <!-- file: crowd.py; needs: my_robot.py, team; shows: crowd -->

`file` is the block's file name. `needs` are the files of other blocks that are saved beside it, and `team` if it needs
a running team. `process` is the name of a process that runs until it is stopped. `shows` is a part of the output. `run`
marks a shell block that is executed.
"""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]

TEAM = "team"
LANGUAGES = {"python": "example.py", "toml": "team.toml", "xml": "example.xml", "sh": "example.sh", "text": ""}
"""The languages of blocks, and the name of a file that says none."""
NOTES = {"file", "needs", "process", "shows", "run"}

_BLOCK = re.compile(
    r"(?:^<!-- (?P<notes>[^\n]*) -->\n)?^ *```(?P<language>\w*)\n(?P<code>.*?)^ *```$", re.MULTILINE | re.DOTALL
)


class Block(NamedTuple):
    """A code block."""

    page: Path
    line: int
    language: str
    code: str
    notes: dict[str, str]

    @property
    def id(self) -> str:
        """Page and line, for the name of a test."""
        return f"{self.page.name}:{self.line}"

    @property
    def file(self) -> str:
        """The name under which the block is saved."""
        return self.notes.get("file", LANGUAGES[self.language])

    @property
    def needs(self) -> list[str]:
        """The names in `needs`."""
        return re.findall(r"[\w.\-]+", self.notes.get("needs", ""))

    @property
    def needs_team(self) -> bool:
        """Whether it works only while a team runs."""
        return TEAM in self.needs

    @property
    def is_run(self) -> bool:
        """Whether it is a shell block that is executed."""
        return "run" in self.notes

    @property
    def tests(self) -> list[str]:
        """The names of the tests that it defines."""
        return re.findall(r"^def (test_\w+)\(", self.code, re.MULTILINE) if self.language == "python" else []

    @property
    def has_team_tests(self) -> bool:
        """Whether its tests take the fixture `team`, or a shared one."""
        return self.shares_team or bool(re.search(r"^def test_\w+\(team\b", self.code, re.MULTILINE))

    @property
    def shares_team(self) -> bool:
        """Whether its tests take a shared team, as only pytest gives it."""
        return self.language == "python" and "(team_module)" in self.code

    def save(self, folder: Path) -> Path:
        """Save it and the files that it needs in a folder; return its own path."""
        for name in self.needs:
            if name != TEAM:
                find_file(name, self.page).save(folder)
        path = folder / self.file
        path.write_text(self.code)
        return path


def _read_notes(text: str | None) -> dict[str, str]:
    notes = {}
    for note in (text or "").split(";"):
        name, _, value = note.partition(":")
        if name.strip():
            notes[name.strip()] = value.strip()
    return notes


@cache
def blocks_of(page: Path) -> list[Block]:
    """All blocks of a page."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            page,
            text.count("\n", 0, match.start("language")) + 1,
            match["language"],
            match["code"],
            _read_notes(match["notes"]),
        )
        for match in _BLOCK.finditer(text)
    ]


def all_blocks(*languages: str) -> Iterator[Block]:
    """The blocks of all pages in these languages."""
    return (block for page in PAGES for block in blocks_of(page) if block.language in languages)


def find_file(name: str, page: Path) -> Block:
    """The block that is saved as `name`: of this page, else of the README, else of any page."""
    for candidate in (page, *PAGES):
        for block in blocks_of(candidate):
            if block.notes.get("file") == name:
                return block
    raise LookupError(f"{page.name}: no block of any page has the note 'file: {name}'")
