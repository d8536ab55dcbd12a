"""The figures of the study `robots` as tables for people."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from zteam.cli.tables import format_table
from zteam.config.numbers import counted

if TYPE_CHECKING:
    from studies.chains.figures import ChainFigures
    from studies.formations import FormationFigures

_LEGEND = [
    "wall, touch: tours on which a robot hit a wall, or robots hit each other. arrived: tours on which all came home.",
    "deviation: of the last robot from the leader's path, 50 % and 90 % of all samples, and the largest.",
    "gap: arc length between neighbours, mean and rms of the error; rms of the first and of the last gap of the chain.",
    "must: no hit, all arrived, deviation (90 %) and gap rms at most so many metres.",
]
_FORMATION_LEGEND = [
    "On a slalom: seconds until all are in formation from the slowest start; distance from the slots from then on;",
    "least distance between two robots' centres; runs in which robots touched.",
    "Through a passage of 1 m: contacts likewise; how far from its middle; seconds until formed again after it.",
    "must: no contact, in formation within so many seconds, rms at most so many metres.",
]


def format_robots(rows: "Sequence[ChainFigures | FormationFigures]") -> str:
    """One table a world, and one of the formations."""
    from studies.formations import FormationFigures

    formations = [row for row in rows if isinstance(row, FormationFigures)]
    worlds: dict[str, list[ChainFigures]] = {}
    for row in rows:
        if not isinstance(row, FormationFigures):
            worlds.setdefault(row.world, []).append(row)
    tables = [_chains(world, found) for world, found in worlds.items()]
    return "\n\n".join([*tables, *([_formations(formations)] if formations else [])])


def _formations(rows: "Sequence[FormationFigures]") -> str:
    from studies.formations import RMS, SETTLE, SPACING, SPEED

    header = [
        "formed, s",
        "off, m: rms",
        "max",
        "nearest, m",
        "contacts",
        "passage: contacts",
        "aside, m",
        "again, s",
        "must",
    ]
    cells = [
        [
            row.shape,
            f"{row.settle_s:.1f}",
            f"{row.rms_m:.3f}",
            f"{row.max_m:.3f}",
            f"{row.nearest_m:.2f}",
            f"{row.contacts}",
            f"{row.passage_contacts}",
            f"{row.passage_aside_m:.2f}",
            f"{row.passage_back_s:.1f}",
            f"{SETTLE:g} {RMS:g}: {'reached' if row.reached else 'MISSED'}",
        ]
        for row in rows
    ]
    title = (
        f"{rows[0].robots} robots {SPACING:g} m apart behind a leader at {SPEED:g} m/s, from {rows[0].starts} starts"
    )
    return "\n".join([title, format_table(["shape", *header], cells, numbers_from=1), *_FORMATION_LEGEND])


def _chains(world: str, rows: "Sequence[ChainFigures]") -> str:
    header = ["robots", "wall", "touch", "arrived", "deviation, m", "gap, m", "rms", "first to last", "must"]
    table = format_table(["chain", *header], [_cells(row) for row in rows], numbers_from=1)
    chain = rows[0].chain
    title = f"{world}: chains on {counted(rows[0].tours, 'tour')} at {chain.speed:g} m/s"
    return "\n".join([title, table, *_LEGEND])


def _cells(row: "ChainFigures") -> list[str]:
    deviation = f"{row.deviation_p50:.3f}  {row.deviation_p90:.3f}  {row.deviation_max:.3f}"
    ends = f"{row.gap_rms_by_robot[0]:.3f}  {row.gap_rms_by_robot[-1]:.3f}"
    counts = [f"{row.chain.robots}", *(f"{n}/{row.tours}" for n in (row.wall_hits, row.touches, row.arrived))]
    return [row.row, *counts, deviation, f"{row.gap_mean:.2f}", f"{row.gap_rms:.3f}", ends, _target(row)]


def _target(row: "ChainFigures") -> str:
    if row.target is None:
        return "-"
    gap = "" if row.target.gap_rms is None else f"  {row.target.gap_rms:g}"
    return f"{row.target.deviation:g}{gap}: {'reached' if row.reached else 'MISSED'}"
