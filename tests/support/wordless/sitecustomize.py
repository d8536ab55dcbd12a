"""Python imports this when it starts with this folder in PYTHONPATH: each text of zteam is `x` where it is made.

A text is a string with a letter and a space, wherever it is, and each string of a reason, an error or a log line.
"""

import ast
import re
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any

KEPT = {
    "messages/cdr.py": "the source of the codec, which Python compiles",
    "config/foreign_files.py": "patterns of other programs' files",
    "config/toml_values.py": "TOML",
    "bus/options.py": "Zenoh's settings",
    "simulator/world/builder.py": "models in Stage's language",
    "simulator/world/text.py": "names of the tokens of Stage's language, which are an Enum's values",
    "team/launch/process.py": "a shell's script",
}
"""Files of which strings with a space are no texts: what they are."""
FIELDS = {"reason", "why", "text", "detail", "waiting_for"}
"""Names of arguments and attributes that are texts."""
LOGS = {"debug", "info", "warning", "error", "exception", "critical"}
READS = {"partition", "rpartition", "startswith", "endswith", "removeprefix", "removesuffix", "split", "index", "find"}
READS |= {"count", "compile", "search", "match", "fullmatch", "findall", "finditer", "sub"}
"""Calls that look for their first argument in a text, or that have a text for it."""
_WORDS = re.compile(r"[^\W\d_].*\s|\s.*[^\W\d_]", re.S)


def is_text(value: str) -> bool:
    """Whether a string is words for people."""
    return _WORDS.search(value) is not None and not value.endswith((" *", " *[]"))  # a type of C


def literal(node: ast.AST) -> str:
    """What a string has besides its expressions; empty for all else."""
    if isinstance(node, ast.JoinedStr):
        return "".join(literal(part) or "0" for part in node.values)
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def looked_for(node: ast.AST) -> list[ast.expr]:
    """What a comparison compares, or a call looks for: that is not where a text is made."""
    if isinstance(node, ast.Compare):
        return [node.left, *node.comparators]
    is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in READS
    return node.args[:1] if is_call else []  # type: ignore[attr-defined]


class Wordless(ast.NodeTransformer):
    """Makes a module's texts `x`."""

    def __init__(self) -> None:
        self._kept: set[ast.AST] = set()

    def visit(self, node: ast.AST) -> Any:
        self._kept.update(looked_for(node))
        is_docstring = isinstance(node, ast.Expr) and literal(node.value)
        if is_docstring or (literal(node) and node in self._kept):
            return node
        if is_text(literal(node)):
            return _x(node)
        for field, value in ast.iter_fields(node):
            if isinstance(value, list):
                value[:] = [self.visit(each) if isinstance(each, ast.AST) else each for each in value]
            elif isinstance(value, ast.AST) and field not in ("annotation", "returns"):
                setattr(node, field, self.visit(value))
        match node:
            case ast.Call(func=ast.Attribute(attr=name), args=[words, *_]) if name in LOGS and literal(words):
                node.args[:] = [_x(node)]  # the others are for the words
            case ast.Call(func=ast.Name(id="Reason"), args=[words, *_]):
                node.args[0] = _x_if(words)
            case ast.Call(func=ast.Name(id="RobotStatus" | "NavigationStatus"), keywords=keywords):
                for keyword in keywords:
                    keyword.value = _x_if(keyword.value) if keyword.arg in FIELDS else keyword.value
            case ast.Raise(exc=ast.Call(args=args)):
                args[:] = [_x(each) if literal(each) else each for each in args]
            case ast.keyword(arg=name, value=words) if name in FIELDS and literal(words):
                node.value = _x(words)
            case ast.BinOp(left=words, op=ast.Mod()) if literal(words) == "x":
                return _x(node)
        return node


def _x(place: ast.AST) -> ast.expr:
    return ast.copy_location(ast.Constant("x"), place)


def _x_if(text: ast.expr) -> ast.expr:
    return ast.copy_location(ast.BoolOp(ast.And(), [text, _x(text)]), text)


def _get_code(loader: SourceFileLoader, name: str, own: Any = SourceFileLoader.get_code) -> CodeType | None:
    path = loader.get_filename(name)
    file = path.rpartition("/zteam/")[2]
    if file == path or name.partition(".")[0] not in ("zteam", "__main__") or file in KEPT:
        return own(loader, name)  # type: ignore[no-any-return]
    return compile(Wordless().visit(ast.parse(Path(path).read_bytes())), path, "exec", dont_inherit=True)


if __name__ == "sitecustomize":
    SourceFileLoader.get_code = _get_code  # type: ignore[assignment]
