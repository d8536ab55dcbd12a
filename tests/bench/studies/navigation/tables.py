"""The figures of the study `nav` as a table."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from zteam.cli.bench import figure
from zteam.cli.tables import format_table

if TYPE_CHECKING:
    from studies.navigation.row import NavFigure


def format_navigation(rows: "Sequence[NavFigure]") -> str:
    """One row a figure."""
    header = ["figure", "measured", "required", "remark"]
    cells = [
        [row.what, f"{figure(row.value)} {row.unit}".strip(), "-" if row.must is None else f"{row.must:g}", row.detail]
        for row in rows
    ]
    return format_table(header, cells)
