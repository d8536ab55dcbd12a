"""Commands called within the test's own process, and in processes of their own."""

from collections.abc import Callable, Sequence
from pathlib import Path

import zteam

IMPORTED_FROM = str(Path(zteam.__file__).parents[1])
"""PYTHONPATH of a process that has the zteam that is tested."""


def exit_code(main: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """The exit code of a command, whether its entry point returns it or its command line's parser ends with it."""
    try:
        return main(words)
    except SystemExit as end:
        assert isinstance(end.code, int)
        return end.code
