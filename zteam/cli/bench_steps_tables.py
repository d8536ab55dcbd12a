"""The figures of `zteam bench steps` as a table for people."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from zteam.cli.bench_tables import figure
from zteam.cli.tables import format_table

if TYPE_CHECKING:
    from zteam.bench.steps.figures import StepFigures

_LEGEND = [
    "µs of a step with 1081 beams, the least of several rounds: mux and safety layer, behaviour, both; medians.",
    "ratio: both / a fixed piece of Python and numpy on the same machine. In the rows of teleop no behaviour drives.",
]


def format_steps(rows: "Sequence[StepFigures]") -> str:
    """One row a scene."""
    from zteam.bench.hops import ROBOT_BUDGET_US

    header = ["scene", "robots", "mux, safety", "behaviour", "both", "90 %", "most", "ratio", f"<= {ROBOT_BUDGET_US:g}"]
    cells = [
        [
            row.scene,
            f"{row.robots}",
            *map(figure, (row.safety_us, row.behavior_us, row.total_us, row.p90_us, row.max_us, row.ratio)),
            "yes" if row.total_us <= ROBOT_BUDGET_US else "no",
        ]
        for row in rows
    ]
    return "\n".join([*format_table(header, cells, numbers_from=1).splitlines(), *_LEGEND])
