"""The package and its documents speak of a process as "it", never as of a person."""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

PERSONS = re.compile(r"\b(who|whoever|whom|nobody|somebody|everybody|anybody|everyone|anyone|himself|he|his)\b", re.I)

COVERED = (".ci", "CONTRIBUTING.md", "README.md", "deploy", "docker-compose.yml", "docs", "zteam")
"""Files and folders; of a folder, all text files in it."""
ALLOWED: dict[tuple[str, str], str] = {
    (
        "zteam/view/page/vendor/uplot/LICENSE",
        "copies of the Software, and to permit persons to whom the Software is",
    ): "a licence stays as it is",
}
"""(file, a line without its indentation): the person that the line means, such as a user or a student."""


def find_persons(text: str) -> Iterator[tuple[int, str]]:
    """(line number, line without its indentation) of all lines that speak of a person."""
    for number, line in enumerate(text.splitlines(), 1):
        if PERSONS.search(line):
            yield number, line.strip()


def files_below(name: str) -> Iterator[Path]:
    """The file `name`, or all files in the folder `name`; fails if there is neither."""
    path = ROOT / name
    assert path.exists(), f"{name} does not exist: correct the lists of this test"
    found = [path] if path.is_file() else sorted(path.rglob("*"))
    return (file for file in found if file.is_file() and "__pycache__" not in file.parts)


@cache
def persons_in(path: Path) -> list[str]:
    """`file:line: text` of all lines of a file that speak of a person and are not in ALLOWED."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return []  # a picture
    name = path.relative_to(ROOT).as_posix()
    return [f"{name}:{number}: {line}" for number, line in find_persons(text) if (name, line) not in ALLOWED]


def test_a_process_is_not_a_person() -> None:
    """No line outside ALLOWED speaks of a person."""
    paths = [path for name in COVERED for path in files_below(name)]
    assert not [line for path in paths for line in persons_in(path)]


def test_every_allowed_line_exists() -> None:
    """No entry of ALLOWED outlives its line."""
    files = {name: (ROOT / name).read_text(encoding="utf-8") for name, _ in ALLOWED}
    assert not [entry for entry in ALLOWED if entry[1] not in {line for _, line in find_persons(files[entry[0]])}]


def test_persons_are_found_in_any_case() -> None:
    """A line is found wherever a whole word stands in it; a longer word, and the relative "whose", are no persons."""
    text = "# Who waits?\nx = 1\n    # Nobody.\nwhole, the history, whose, NOBODYS, nobody_else\n"
    assert list(find_persons(text)) == [(1, "# Who waits?"), (3, "# Nobody.")]
