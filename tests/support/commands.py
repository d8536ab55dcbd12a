"""Commands called within the test's own process."""

from collections.abc import Callable, Sequence


def exit_code(main: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """The exit code of a command, whether its entry point returns it or its command line's parser ends with it."""
    try:
        return main(words)
    except SystemExit as end:
        assert isinstance(end.code, int)
        return end.code
