"""Tables for people: columns as wide as their widest cell, readable in a plain pipe."""

from collections.abc import Sequence


def format_table(
    header: Sequence[str], rows: Sequence[Sequence[str]], indent: str = "", *, numbers_from: int | None = None
) -> str:
    """The header and the rows as lines; no line ends with blanks. The columns from `numbers_from` on align right."""
    lines = [header, *rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
    right = [numbers_from is not None and column >= numbers_from for column in range(len(header))]
    return "\n".join((indent + "  ".join(map(_aligned, line, widths, right))).rstrip() for line in lines)


def _aligned(cell: str, width: int, right: bool) -> str:
    return cell.rjust(width) if right else cell.ljust(width)
