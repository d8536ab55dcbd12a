"""What import-linter cannot see of the rooms: modules that strings name, and circles between files."""

import ast
from pathlib import Path

import pytest

import zteam

PACKAGE = Path(str(zteam.__file__)).parent
MODULES = {
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
    for path in PACKAGE.glob("**/*.py")
    if "worlds" not in path.parts
}


def nodes_of(module: str) -> list[ast.AST]:
    return list(ast.walk(ast.parse(MODULES[module].read_text())))


def imports_of(module: str) -> set[str]:
    """Those for the type checker alone included."""
    found = {
        name
        for node in nodes_of(module)
        if isinstance(node, ast.ImportFrom) and node.module
        for each in node.names
        for name in (f"{node.module}.{each.name}", node.module)
        if name in MODULES and not (name == node.module and f"{node.module}.{each.name}" in MODULES)
    }
    return found - {module}


@pytest.mark.gate
def test_no_string_names_a_module_of_cli() -> None:
    """A room that starts a command, or imports it by its name, depends on what stands above it."""
    rooms = [module for module in MODULES if not module.startswith("zteam.cli") and module != "zteam.__main__"]
    named = [
        (module, node.value)
        for module in rooms
        for node in nodes_of(module)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "zteam.cli" in node.value
    ]
    assert named == []


@pytest.mark.gate
def test_files_import_each_other_in_no_circle() -> None:
    """Of two files that need each other, neither can be read alone."""
    graph = {module: imports_of(module) for module in MODULES}
    size = 0
    while len(graph) != size:
        size, imported = len(graph), set().union(*graph.values())
        graph = {
            each: found & graph.keys() for each, found in graph.items() if each in imported and found & graph.keys()
        }
    assert graph == {}
