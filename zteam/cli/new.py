"""`zteam new behavior NAME` and `zteam new node NAME`: write a working example and its test into the current folder."""

import argparse
import keyword
import re
import string
import sys
from collections.abc import Mapping
from functools import partial
from importlib.machinery import PathFinder
from pathlib import Path

from zteam import names
from zteam.cli.options import Parser, add_log_options, run_tool
from zteam.cli.tables import format_table
from zteam.errors import UsageError, ZteamError, printable
from zteam.node.output import print_block

TEMPLATES = Path(__file__).parent / "templates"


KINDS = {
    "behavior": (
        "what a robot does: a class with step(view), and its test",
        (
            ("pytest test_$name.py", "run its test"),
            ("zteam check $name:$kind", "try it in awkward worlds"),
            ("zteam-sim arena", "start a world, in a terminal of its own"),
            ("zteam-tf", "start the transforms, likewise"),
            ("zteam-robot --id 0 --behavior $name:$kind --no-gate", "drive robot 0"),
        ),
    ),
    "node": (
        "a process that subscribes and publishes, and its test",
        (
            ("pytest test_$name.py", "run its test"),
            ("zteam up arena", "start a team, in a terminal of its own"),
            ("python $name.py", "start the node beside it, likewise"),
            ("zteam topic echo $name/nearest", "print what it publishes"),
        ),
    ),
}
"""What an example shows, and what to do with it next, as (command, what it does), by the word on the command line.

`templates/` has a file `KIND.txt` and `test_KIND.txt` for each."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam new", description=__doc__)
    for word, (text, _) in KINDS.items():
        sub = parser.add_verb(word, _run, text, add_log_options)
        sub.add_argument("name", metavar="NAME", help="the module's name, such as my_robot; writes NAME.py")
    return parser


def _run(args: argparse.Namespace) -> None:
    """Write both files, or none if one of them exists."""
    word, name = args.verb, args.name
    words = {"name": name, "kind": "".join(part[:1].upper() + part[1:] for part in name.split("_"))}
    texts = {f"{prefix}{name}.py": (TEMPLATES / f"{prefix}{word}.txt").read_text("utf-8") for prefix in ("", "test_")}
    _check_name(word, name, words["kind"], texts[f"{name}.py"])
    filled = {Path(file): fill(text, words) for file, text in texts.items()}
    write_files(filled, "choose another name, or remove the file")
    print_block(f"wrote {printable(' and '.join(texts))}\n")
    rows = [(fill(command, words), text) for command, text in KINDS[word][1]]
    print_block(format_table(("next", "does"), rows))


def write_files(texts: Mapping[Path, str], way_out: str, *, overwrite: bool = False) -> None:
    """Write these files, or none if one of them exists. Raises UsageError for that, and ZteamError if it cannot."""
    try:
        for path in () if overwrite else texts:
            if path.exists() or path.is_symlink():
                raise UsageError(f"{path} exists already; {way_out}")
        for path, text in texts.items():
            # Never over a file that has just come.
            with path.open("w" if overwrite else "x", encoding="utf-8") as file:
                file.write(text)
    except OSError as error:
        raise ZteamError(f"cannot write {error.filename or path}: {error.strerror or error}") from None


def fill(template: str, words: Mapping[str, object]) -> str:
    return string.Template(template).substitute(words)


def _check_name(word: str, name: str, kind: str, example: str) -> None:
    """Raise UsageError unless files and example can have this name."""
    if not name.isidentifier() or keyword.iskeyword(name):
        near = re.sub(r"\W+", "_", name.removesuffix(".py")).strip("_")
        hint = f"; did you mean {near}?" if near.isidentifier() and not keyword.iskeyword(near) else ""
        raise UsageError(f"{name!r} cannot be the name of a Python module{hint}")
    elsewhere = [folder for folder in sys.path if folder and not (Path(folder).is_dir() and Path(folder).samefile("."))]
    found = PathFinder.find_spec(name, elsewhere)
    # A folder without __init__.py (origin None) hides nothing and is hidden by a module.
    if name in sys.stdlib_module_names or (found is not None and found.origin is not None):
        raise UsageError(f"{name!r} is a module of Python or of an installed package: yours would hide it")
    if word == "node" and (problem := names.name_problem(name)):
        raise UsageError(problem)
    if word == "node" and (names.is_taken(name) or names.robot_id_of(name) is not None):
        raise UsageError(f"{name!r} is the name of a process of every team; choose another one")
    if word == "behavior" and (not kind.isidentifier() or re.search(rf"\b{kind}\b", example)):
        raise UsageError(f"{name!r}: the example cannot name its class {kind or name!r}; choose another name")


main = partial(run_tool, build_parser, None)
