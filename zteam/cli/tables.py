"""Tables for people: columns as wide as their widest cell, readable in a plain pipe."""

import shutil
import sys
import textwrap
from collections.abc import Sequence

_GAP = "  "
_MIN_ROOM = 20
"""Columns of the least room into which a text is wrapped."""


def terminal_width() -> int | None:
    """The width of the terminal that standard output is; None where lines are not to be wrapped."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def format_table(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    indent: str = "",
    *,
    numbers_from: int | None = None,
    width: int | None = None,
) -> str:
    """The header and the rows as lines; no line ends with blanks.

    The columns from `numbers_from` on align right. The last column is wrapped where a line would exceed `width`.
    """
    lines = [header, *rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
    if width is not None:
        lines = [part for line in lines for part in _wrapped(line, width - len(indent) - _width(widths[:-1]))]
    right = [numbers_from is not None and column >= numbers_from for column in range(len(header))]
    return "\n".join((indent + _GAP.join(map(_aligned, line, widths, right))).rstrip() for line in lines)


def _width(widths: Sequence[int]) -> int:
    return sum(width + len(_GAP) for width in widths)


def _wrapped(line: Sequence[str], room: int) -> list[Sequence[str]]:
    """The line, and below it what its last cell has beyond `room`."""
    if room < _MIN_ROOM:
        return [line]
    first, *more = textwrap.wrap(line[-1], room) or [""]
    blank = [""] * (len(line) - 1)
    return [[*line[:-1], first], *([*blank, text] for text in more)]


def _aligned(cell: str, width: int, right: bool) -> str:
    return cell.rjust(width) if right else cell.ljust(width)
