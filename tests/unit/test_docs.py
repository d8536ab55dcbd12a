"""The pages are true: examples run, links and named files exist, and the reference names what the parser knows."""

import ast
import re
from pathlib import Path

import pytest

from support.pages import DOCS, PAGES, ROOT, all_blocks, find_file
from support.rooms import PICTURE, draw, layers
from zteam.simulator.world import properties
from zteam.simulator.world.devices import MODELS

PACKAGES = ["behaviors", "errors", "messages", "planning", "sim", "testing", "tf", "world"]
PUBLIC = {"zteam", *(f"zteam.{package}" for package in PACKAGES)}


def prose(page: Path) -> str:
    """A page without its code blocks."""
    return re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def names_in(path: Path) -> set[str]:
    """The functions, classes, methods (`Class.method`) and constants that a module defines."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return found


def where_is_what() -> list[list[str]]:
    """The rows of the architecture page's table "Where is what": question, place, answer."""
    section = (DOCS / "architecture.md").read_text().split("## Where is what\n")[1].split("\n## ")[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows[2:]]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    """Every relative link of a page names a file that exists, and a heading of it."""
    broken = []
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.is_file() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    assert not broken


def test_files_of_the_architecture_page_exist() -> None:
    """Every file and folder that the architecture page names is in the package."""
    page = prose(DOCS / "architecture.md")
    package = ROOT / "zteam"
    named = {name for name in re.findall(r"`([\w./]+)`", page) if "/" in name and name.endswith((".py", "/"))}
    for row in re.findall(r"^\| (`[\w/]+/`(?:, `[\w/]+/`)*) \| (.*) \|$", page, re.MULTILINE):
        folders = re.findall(r"`([\w/]+/)`", row[0])
        named |= {folders[0] + name for name in re.findall(r"`(\w+\.py)`", row[1])}
    assert len(named) > 30
    assert not {name for name in named if not any((root / name).exists() for root in (package, ROOT))}


def test_the_picture_is_that_of_the_contract() -> None:
    """The rooms and their layers are those that import-linter checks (`python tests/support/rooms.py` draws them)."""
    assert PICTURE.read_text() == draw()
    assert sum(map(len, layers())) > 20


def test_the_questions_are_answered() -> None:
    """In the table "Where is what" each file that it names defines the names beside it."""
    rows = where_is_what()
    assert len(rows) > 12
    missing = []
    for _, place, answer in rows:
        assert len(answer) > 40
        for path, names in re.findall(r"`([\w/]+\.py)`: ((?:`[\w.]+`(?:, )?)+)", f"{place}; {answer}"):
            defined = names_in(ROOT / "zteam" / path)
            missing += [f"{path}: {name}" for name in re.findall(r"`([\w.]+)`", names) if name not in defined]
    assert not missing


def test_examples_import_public_names_only() -> None:
    """No example of a page imports an internal module of zteam."""
    internal = []
    for block in all_blocks("python"):
        for node in ast.walk(ast.parse(block.code)):
            if isinstance(node, ast.ImportFrom) and node.module:
                modules = [node.module]
            elif isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            else:
                continue
            internal += [name for name in modules if name.split(".")[0] == "zteam" and name not in PUBLIC]
    assert not internal


def test_a_team_of_ones_own_is_short() -> None:
    """The leader and its followers on the page of behaviours, with their team file, are at most 30 lines."""
    code = "\n".join(find_file(name, DOCS / "behaviors.md").code for name in ("convoy.py", "convoy.toml"))
    assert len([line for line in code.splitlines() if line.strip()]) <= 30


def test_every_property_is_in_the_reference() -> None:
    """The tables hold all names that the parser reads, ignores or remarks, and every model type."""
    named = set(re.findall(r"[a-z_]+", " ".join(re.findall(r"`([^`]+)`", prose(DOCS / "world-files.md")))))
    known = set().union(
        *properties.READ.values(),
        *properties.SILENT.values(),
        properties.REMARKED,
        properties.TYPES,
        MODELS,
        *(model.properties for model in MODELS.values()),
        properties._DISPLAY,
    )
    missing = {name.removesuffix("[]") for name in known} - named
    assert not missing
