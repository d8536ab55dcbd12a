"""Texts for people, readable in a pipe: tables, with columns as wide as their widest cell; durations, messages."""

import shutil
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

from zteam.errors import printable
from zteam.messages import Message, to_plain

_GAP = "  "
_SHORT = 12
"""Elements of an array that the text output shows without --full."""
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
    lines: list[Sequence[str]] = [[printable(cell) for cell in line] for line in (header, *rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
    if width is not None:
        before = len(indent) + sum(each + len(_GAP) for each in widths[:-1])
        lines = [part for line in lines for part in _wrapped(line, width - before)]
    first_right = len(header) if numbers_from is None else numbers_from
    align = [str.ljust if column < first_right else str.rjust for column in range(len(header))]
    cells = [[put(cell, room) for put, cell, room in zip(align, line, widths, strict=True)] for line in lines]
    return "\n".join((indent + _GAP.join(line)).rstrip() for line in cells)


def _wrapped(line: Sequence[str], room: int) -> list[Sequence[str]]:
    """The line, and below it what its last cell has beyond `room`."""
    if room < _MIN_ROOM:
        return [line]
    # A command or the name of a process stays whole.
    first, *more = textwrap.wrap(line[-1], room, break_long_words=False, break_on_hyphens=False) or [""]
    blank = [""] * (len(line) - 1)
    return [[*line[:-1], first], *([*blank, text] for text in more)]


def duration_text(seconds: float) -> str:
    """Seconds as a reader counts them: 42 s, 3 min 20 s, 2 h 05 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole // 3600} h {whole // 60 % 60:02} min"


def in_ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.1f} ms"


def format_message(message: Message, full: bool) -> str:
    """The message as `ros2 topic echo` prints it: one field per line, nested fields indented, long arrays cut."""
    return "\n".join(_lines(to_plain(message), "", full))


def _lines(plain: Any, indent: str, full: bool) -> list[str]:
    lines = []
    for name, value in plain.items():
        if isinstance(value, dict):
            lines += [f"{indent}{name}:", *_lines(value, indent + "  ", full)]
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            lines.append(f"{indent}{name}:")
            for item in value:
                first, *rest = _lines(item, indent + "  ", full)
                lines += [f"{indent}- {first.lstrip()}", *rest]
        elif isinstance(value, list):
            shown = value if full else value[:_SHORT]
            more = "" if len(shown) == len(value) else f", … ({len(value)} in all)"
            lines.append(f"{indent}{name}: [{', '.join(map(_word, shown))}{more}]")
        else:
            lines.append(f"{indent}{name}: {_word(value)}")
    return lines


def _word(value: Any) -> str:
    if value is None:
        return "inf"
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{printable(value)}'" if isinstance(value, str) else str(value)
