"""What a behaviour does wrong, and where."""

import inspect
import linecache
import os
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path
from types import FrameType
from typing import Literal

import msgspec

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.import_errors import is_own

Kind = Literal[
    "raises",
    "type",
    "number",
    "limit",
    "ignored",
    "changed",
    "slow",
    "hangs",
    "clock",
    "random",
    "state",
    "old",
    "touched",
]


class Fault(msgspec.Struct, frozen=True):
    """One thing that a behaviour does wrong in one trial."""

    kind: Kind
    text: str
    """What it does, with the behaviour as the subject that is left out: `step raises …`."""
    hint: str = ""
    """What to do instead."""
    place: str = ""
    """`file:line: source` of the author's own line; empty where there is none."""
    is_remark: bool = False
    """Whether no robot ever gets there, so that it is not wrong."""


def place_of_error(error: BaseException, kind: type[Behavior]) -> str:
    """The innermost line of the author's that raised."""
    return _innermost(((f.filename, f.lineno or 0) for f in traceback.extract_tb(error.__traceback__)), kind)


def place_of_frame(frame: FrameType, kind: type[Behavior]) -> str:
    """The author's line that runs in `frame` or has called what runs there."""
    return _innermost(((f.filename, f.lineno or 0) for f in traceback.extract_stack(frame)), kind)


def place_of_step(kind: type[Behavior], method: str = "step") -> str:
    """Where its `step`, or another method, begins."""
    code = getattr(inspect.unwrap(getattr(kind, method)), "__code__", None)
    return "" if code is None else _text(code.co_filename, code.co_firstlineno)


def _innermost(lines: Iterable[tuple[str, int]], kind: type[Behavior]) -> str:
    own = [(name, line) for name, line in lines if is_authors(name, kind)]
    return _text(*own[-1]) if own else place_of_step(kind)


def is_authors(filename: str, kind: type[Behavior]) -> bool:
    """Whether the author wrote this file of code: that of the class counts also where it is installed or shipped."""
    return is_own(filename) or filename == getattr(sys.modules.get(kind.__module__), "__file__", "")


def _text(file: str, line: int) -> str:
    source = linecache.getline(file, line).strip()
    path = Path(file)
    shown = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return f"{os.fspath(shown)}:{line}: {source}".removesuffix(": ")
