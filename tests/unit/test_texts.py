"""No sentence is a protocol: nothing in the package compares a text for people or searches it."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from support.wordless.sitecustomize import FIELDS, KEPT, is_text, literal, looked_for

PACKAGE = Path(__file__).resolve().parents[2] / "zteam"
FOREIGN = {
    "bus/router.py": "Zenoh", "bus/transport.py": "Zenoh", "bus/tls.py": "OpenSSL", "cli/options.py": "argparse",
    "cli/other_words.py": "users of ROS",
    "config/problems.py": "msgspec", "node/faults.py": "the system",
    "robot/teleop.py": "terminals", "team/file/sources.py": "tomllib", "view/files.py": "JavaScript",
}  # fmt: skip
"""Files that translate words of others: whose."""
FORMER = {"last", "before", "former", "shown", "logged", "told"}
"""Names of what was published before: whether a text has changed since may be asked."""
IN_SCRIPT = re.compile(
    r"""(?:[!=]==|\bcase|(?:includes|startsWith|endsWith|indexOf|match)\()\s*["'`/][^"'`\n]*\w\s\w"""
    r"""|["'`][^"'`\n]*\w\s\w[^"'`\n]*["'`][^\][{}()\n]*\]\.(?:includes|indexOf)"""
    r"""|\.(?:reason|text|detail)(?:\s*[!=]==\s*["'`]\w|\.(?:includes|startsWith|endsWith|indexOf|match|split)\b)"""
)
"""A line of the page's JavaScript that goes by a text."""


def parts(node: ast.AST) -> Iterator[ast.AST]:
    """The expressions that a value consists of, or that it may be."""
    yield node
    below: list[ast.expr] = []
    match node:
        case ast.Call(func=ast.Attribute(value=value, attr=name), args=args):
            below = [value, *(args if name in ("join", "format", "compile") else [])]
        case ast.Dict(keys=keys):
            below = [key for key in keys if key is not None]
        case ast.Call(func=ast.Name(id="str" | "repr" | "set" | "frozenset"), args=below) | ast.Tuple(elts=below):
            pass
        case ast.List(elts=below) | ast.Set(elts=below) | ast.BoolOp(values=below) | ast.JoinedStr(values=below):
            pass
        case ast.FormattedValue(value=value) | ast.NamedExpr(value=value) | ast.Subscript(value=value):
            below = [value]
        case ast.IfExp(body=first, orelse=second) | ast.BinOp(left=first, right=second):
            below = [first, second]
    for each in below:
        yield from parts(each)


def names_in(node: ast.AST) -> set[str]:
    """All names in an expression or a target."""
    return {str(getattr(each, "id", getattr(each, "attr", "?"))) for each in ast.walk(node)}


def has_text(node: ast.AST, known: set[str]) -> bool:
    """Whether an expression is a text, of a field of texts, or of a name in `known`."""
    for part in parts(node):
        match part:
            case ast.Name(id=name) if name in known or name in ("reason", "why"):
                return True
            case ast.Attribute(value=value, attr=name) if name in known or name in FIELDS or name == "args":
                if not getattr(value, "id", "")[:1].isupper():  # a class has its own names
                    return True
            case _ if is_text(literal(part)):
                return True
    return False


def constants(tree: ast.Module) -> set[str]:
    """A module's constants that are texts, patterns of them or collections of them; of a dict the keys count."""
    found = [node for node in tree.body if isinstance(node, ast.Assign) and has_text(node.value, set())]
    return {target.id for node in found for target in node.targets if isinstance(target, ast.Name)}


def goes_by_text(node: ast.AST, known: set[str]) -> bool:
    """Whether a node compares a text or searches it."""
    match node:
        case ast.Compare(ops=[ast.Eq() | ast.NotEq() | ast.In() | ast.NotIn(), *_]):
            sides, names = looked_for(node), names_in(node)
            is_empty = any(isinstance(side, ast.Constant) and not side.value for side in sides)
            is_former = bool({name.strip("_") for name in names} & FORMER)
            is_change = is_former and not any(map(literal, sides)) and not any(map(str.isupper, names))
            return not is_empty and not is_change and any(has_text(side, known) for side in sides)
        case ast.Call(func=ast.Attribute(attr="removesuffix"), args=[ast.Constant(value=": ")]):
            return False  # the end of a line that has no more
        case ast.Call(func=ast.Attribute(value=text), args=args) if looked_for(node):
            return any(has_text(each, known) for each in (text, *args))
        case ast.Call(func=ast.Attribute(attr="get"), args=[key, *_]) | ast.Subscript(slice=key, ctx=ast.Load()):
            return has_text(key, set()) and not literal(key)
        case ast.Match(subject=text):
            return has_text(text, known)
        case ast.MatchValue(value=value):
            return is_text(literal(value))
    return False


def scopes_of(tree: ast.Module) -> list[list[ast.AST]]:
    """The nodes of a module and of each function, without those of the functions in it."""
    found: list[list[ast.AST]] = [[tree]]
    for nodes in found:
        for node in nodes:
            for child in ast.iter_child_nodes(node):
                if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                    found.append([child])
                else:
                    nodes.append(child)
    return found


def uses(tree: ast.Module, known: set[str]) -> Iterator[str]:
    """`line: expression` of all that goes by a text; `known` are names of constants."""
    scopes = scopes_of(tree)
    errors = {node.name or "" for nodes in scopes for node in nodes if isinstance(node, ast.ExceptHandler)}
    for nodes in scopes:
        mine = known | errors
        for node in nodes:
            match node:
                case ast.Assign(targets=[ast.Name() as to], value=value) | ast.NamedExpr(target=to, value=value):
                    mine = mine | names_in(to) if has_text(value, mine) else mine
                case ast.For(target=to, iter=value) | ast.comprehension(target=to, iter=value):
                    mine = mine | names_in(to) if names_in(value) & known else mine
        for node in nodes:
            if goes_by_text(node, mine):
                yield f"{getattr(node, 'lineno', '?')}: {ast.unparse(node)}"


@cache
def found_in_package() -> dict[str, list[str]]:
    """What goes by a text, by file."""
    paths = {path.relative_to(PACKAGE).as_posix(): path for path in sorted(PACKAGE.rglob("*.py"))}
    trees = {name: ast.parse(path.read_bytes()) for name, path in paths.items() if name not in KEPT}
    own = {name: constants(tree) for name, tree in trees.items()}
    public = {each for names in own.values() for each in names if not each.startswith("_")}
    found = {name: list(uses(tree, own[name] | public)) for name, tree in trees.items()}
    return {name: lines for name, lines in found.items() if lines}


@pytest.mark.gate
def test_nothing_in_the_package_goes_by_a_text() -> None:
    """No file compares a text or searches it, but for those that translate words of others."""
    assert {name: lines for name, lines in found_in_package().items() if name not in FOREIGN} == {}


@pytest.mark.gate
def test_each_translation_is_there() -> None:
    """No entry of FOREIGN outlives what it allows."""
    assert not FOREIGN.keys() - found_in_package().keys()


@pytest.mark.parametrize(
    ("line", "is_found"),
    [
        ("status.text == 'waiting for GO'", True), ("'pose' in status.text", True), ("'stopped' == reason", True),
        ("status.reason.startswith('waits')", True), ("WHY.get(why)", True), ("TEXT in line", True),
        ("line.partition(TEXT)", True), ("re.search('the view is', line)", True), ("str(error) == OTHER", True),
        ("error.args[0] == OTHER", True), ("(said := str(error)) and said.endswith('lost')", True),
        ("any(each in line for each in TEXT)", True), ("match(status.text):\n   case _: pass", True),
        ("status.reason == ''", False), ("status.reason != self._last.reason", False), ("robots[1:]", False),
        ("name in ('robot', 'sim')", False), ("status.text and log.info('%s', status.text)", False),
        ("Reason(f'waits: {why}', waits_for=1).waits_for == 1", False), ("LOST = 'it is lost'", False),
    ],
)  # fmt: skip
def test_what_goes_by_a_text_is_found(line: str, is_found: bool) -> None:
    """Each way to compare a text or search it; emptiness, a change since the last time, and codes may be asked for."""
    found = uses(ast.parse(f"def f():\n try: g()\n except E as error:\n  {line}"), {"TEXT"})
    assert bool(list(found)) is is_found


def test_the_page_goes_by_no_text() -> None:
    """No line of the view's JavaScript compares a text or searches it; one that did would be found."""
    scripts = list((PACKAGE / "view" / "page" / "js").rglob("*.js"))
    assert len(scripts) > 50
    assert not [line for path in scripts for line in path.read_text().splitlines() if IN_SCRIPT.search(line)]
    for line in ('robot.state === "no behaviour"', 'case "is lost": return', "robot.reason.match(/waits/)"):
        assert IN_SCRIPT.search(line)
