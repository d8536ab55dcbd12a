"""Classes, functions and files of the package stay small enough to be read at once."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "zteam"

MAX_CLASS, MAX_FUNCTION, MAX_FILE = 150, 40, 300
"""Lines, from the first one of a definition to its last; decorators do not count."""

ALLOWED = {
    ("kernels/binding.py", ""): "all of the kernels' checks, beside each other",
    ("tf/buffer.py", "Buffer"): "tf2's whole interface in one class, as its users know it",
    ("tf/paths.py", "PlanarPath.solve"): "every look-up runs it: a call for each kind of step would slow it down",
}
"""(file, qualified name of a class or function, or empty for the file): the reason for its size."""


def oversized(code: str) -> Iterator[str]:
    """Qualified names of a module's classes and functions above the limits; an empty name for the module itself."""
    if len(code.splitlines()) > MAX_FILE:
        yield ""
    yield from _oversized(ast.parse(code), "")


def _oversized(parent: ast.AST, prefix: str) -> Iterator[str]:
    for node in ast.iter_child_nodes(parent):
        name = prefix
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            name = f"{prefix}.{node.name}".lstrip(".")
            assert node.end_lineno is not None
            limit = MAX_CLASS if isinstance(node, ast.ClassDef) else MAX_FUNCTION
            if node.end_lineno - node.lineno + 1 > limit:
                yield name
        yield from _oversized(node, name)


@cache
def found() -> set[tuple[str, str]]:
    """Everything above the limits: (file, qualified name)."""
    return {
        (path.relative_to(PACKAGE).as_posix(), name)
        for path in sorted(PACKAGE.rglob("*.py"))
        for name in oversized(path.read_text(encoding="utf-8"))
    }


def test_everything_is_within_the_limits() -> None:
    """No class, function or file is above its limit without a reason in ALLOWED."""
    assert not sorted(found() - set(ALLOWED)), f"classes <= {MAX_CLASS}, functions <= {MAX_FUNCTION} lines"


def test_no_exception_outlives_its_reason() -> None:
    """Every entry of ALLOWED is still above a limit."""
    assert not sorted(set(ALLOWED) - found())


def _lines(count: int, indent: str) -> str:
    return f"{indent}x = 1\n" * count


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("def f():\n" + _lines(39, "    "), []),
        ("def f():\n" + _lines(40, "    "), ["f"]),
        ("async def f():\n" + _lines(40, "    "), ["f"]),
        ("class C:\n" + _lines(149, "    "), []),
        ("class C:\n" + _lines(150, "    "), ["C"]),
        ("class C:\n    def m(self):\n" + _lines(40, "        "), ["C.m"]),
        ("if True:\n    def f():\n        def g():\n" + _lines(40, " " * 12), ["f", "f.g"]),
        (_lines(300, ""), []),
        (_lines(301, ""), [""]),
    ],
)
def test_sizes_are_measured(code: str, names: list[str]) -> None:
    """Every definition is measured, nested ones too, and so is the file."""
    assert list(oversized(code)) == names
