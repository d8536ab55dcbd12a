"""Python imports this when it starts with this folder in PYTHONPATH: each text of zteam is `x` from where it is made.

A text is a string with a letter and a space, wherever it is, and each string of a reason or an error.
"""

import ast
import re
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any

KEPT = {
    "messages/cdr.py": "the source of the codec, which Python compiles",
    "config/toml_values.py": "TOML",
    "bus/options.py": "Zenoh's settings",
    "simulator/world/builder.py": "models in Stage's language",
    "simulator/world/text.py": "names of the tokens of Stage's language, which are an Enum's values",
    "team/launch/process.py": "a shell's script",
}
"""Files of which strings with a space are no texts: what they are."""
FIELDS = {"reason", "text", "why", "detail", "message", "words"}
"""Arguments that are texts."""
LOGS = {"debug", "info", "warning", "error", "exception", "critical"}
READS = {"partition", "rpartition", "startswith", "endswith", "removeprefix", "removesuffix", "split", "index", "find"}
READS |= {"compile", "search", "match", "fullmatch", "findall", "finditer", "sub"}
"""Calls that look for their first argument in a text: it is not made there."""
_WORDS = re.compile(r"[^\W\d_].*\s|\s.*[^\W\d_]", re.S)


def is_text(value: object) -> bool:
    """Whether a constant is words for people."""
    return isinstance(value, str) and _WORDS.search(value) is not None and not value.endswith(" *")  # a type of C


def literal(node: ast.AST) -> str:
    """What a string says of itself, without its expressions; empty for all else."""
    if isinstance(node, ast.JoinedStr):
        return "".join(literal(part) or "0" for part in node.values)
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def looked_for(node: ast.AST) -> list[ast.expr]:
    """What a comparison or a call compares with or looks for."""
    if isinstance(node, ast.Compare):
        return [node.left, *node.comparators]
    is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in READS
    return node.args[:1] if is_call else []


class Wordless(ast.NodeTransformer):
    """Makes a module's texts `x`."""

    def visit(self, node: ast.AST) -> Any:
        for each in looked_for(node):
            each.is_read = True  # type: ignore[attr-defined]
        if (literal(node) and hasattr(node, "is_read")) or (isinstance(node, ast.Expr) and literal(node.value)):
            return node  # the last: a docstring
        if isinstance(node, ast.Constant | ast.JoinedStr) and is_text(literal(node)):
            return _x(node)
        for field, value in ast.iter_fields(node):
            if isinstance(value, list):
                value[:] = [self.visit(each) if isinstance(each, ast.AST) else each for each in value]
            elif isinstance(value, ast.AST) and field not in ("annotation", "returns"):
                setattr(node, field, self.visit(value))
        if isinstance(node, ast.Call):
            self._call(node)
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            node.exc.args = [_x(each) if literal(each) else each for each in node.exc.args]
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod) and literal(node.left) == "x":
            return _x(node)
        return node

    def _call(self, node: ast.Call) -> None:
        if isinstance(node.func, ast.Attribute) and node.func.attr in LOGS and node.args and literal(node.args[0]):
            node.args[:] = [_x(node)]  # its other arguments are for the words
        if getattr(node.func, "id", "") == "Reason":
            node.args[0] = ast.copy_location(ast.BoolOp(ast.And(), [node.args[0], _x(node)]), node)
        for keyword in node.keywords:
            if keyword.arg in FIELDS and literal(keyword.value):
                keyword.value = _x(node)


def _x(place: ast.AST) -> ast.expr:
    return ast.copy_location(ast.Constant("x"), place)


def compile_wordless(loader: SourceFileLoader, name: str) -> CodeType | None:
    """A module's code; of zteam's without its texts."""
    path = loader.get_filename(name)
    _, inside, file = path.rpartition("/zteam/")
    if not inside or name.partition(".")[0] not in ("zteam", "__main__") or file in KEPT:
        return _get_code(loader, name)
    return compile(Wordless().visit(ast.parse(Path(path).read_bytes())), path, "exec", dont_inherit=True)


_get_code = SourceFileLoader.get_code
SourceFileLoader.get_code = compile_wordless  # type: ignore[assignment]
