"""Commands called within the test's own process, and in processes of their own."""

import importlib
import shlex
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import zteam
from zteam.cli import processes
from zteam.cli.main import PROCESSES
from zteam.cli.options import Parser

IMPORTED_FROM = str(Path(zteam.__file__).parents[1])
"""PYTHONPATH of a process that has the zteam that is tested."""


class Printed(NamedTuple):
    """What a command has printed."""

    out: str
    err: str


Run = Callable[..., Printed]
"""Of `run(command, code)`: the command must end with `code`, by default 0."""


def exit_code(main: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """The exit code of a command, whether its entry point returns it or its command line's parser ends with it."""
    try:
        return main(words)
    except SystemExit as end:
        assert isinstance(end.code, int)
        return end.code


def run_here(command: str) -> int:
    """Run a command such as `zteam topic list` or `zteam-sim arena` in this process; its exit code."""
    name, *words = shlex.split(command)
    return exit_code(command_of("main" if name == "zteam" else name)[1], words)


def command_of(name: str) -> tuple[Callable[[], Parser], Callable[[Sequence[str]], int]]:
    """What makes the parser of a module of `zteam.cli` or of the command of a process, and what runs it."""
    if name in PROCESSES and name != "zteam-router":
        return partial(processes.build_parser, name), partial(processes.main, name)
    module = importlib.import_module(f"zteam.cli.{name.replace('-', '_')}")
    return getattr(module, "build_parser", Parser), module.main
