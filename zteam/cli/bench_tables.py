"""The figures of `zteam bench` as tables for people, with units, and with what each ratio is a ratio of."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec

from zteam.cli.tables import format_table
from zteam.numbers import counted

if TYPE_CHECKING:
    from zteam.bench.casting import KernelFigures
    from zteam.bench.coding import CodecFigures
    from zteam.bench.running import InProcessFigures, TeamFigures
    from zteam.bench.simulation import SimulationFigures
    from zteam.bench.transforms import BufferFigures, ListenerFigures


def figure(value: float | None) -> str:
    """A measured number with three digits, which is what a repetition gives again; `-` for none."""
    if value is None:
        return "-"
    text = f"{value:#.3g}".rstrip(".")
    return f"{float(text):,.0f}" if "e+" in text else text


class _Column(NamedTuple):
    heading: str
    cell: Callable[[Any], str]


def _table(columns: Sequence[_Column], rows: Iterable[Any]) -> list[str]:
    header = [column.heading for column in columns]
    return format_table(header, [[c.cell(row) for c in columns] for row in rows], numbers_from=1).splitlines()


def _pairs(pairs: Sequence[tuple[str, str]]) -> list[str]:
    return format_table(pairs[0], pairs[1:]).splitlines()


def format_codec(rows: "Sequence[CodecFigures]") -> str:
    """One row a message type."""
    columns = [
        _Column("message type", lambda row: row.type),
        _Column("bytes", lambda row: f"{row.bytes}"),
        _Column("encode, µs", lambda row: figure(row.encode_us)),
        _Column("decode, µs", lambda row: figure(row.decode_us)),
    ]
    return "\n".join(_table(columns, rows))


def format_kernels(rows: "Sequence[KernelFigures]") -> str:
    """One row a laser."""
    columns = [
        _Column("rays against", lambda row: row.target),
        _Column("beams", lambda row: f"{row.beams}"),
        _Column("million rays/s", lambda row: figure(row.rays_per_s / 1e6)),
        _Column("ratio", lambda row: figure(row.ratio)),
    ]
    legend = [
        "One core, 100 scans, the world's first bitmap.",
        "ratio: time of a fixed piece of numpy / time of the scans, the median of alternating rounds.",
    ]
    return "\n".join([*_table(columns, rows), *legend])


def format_transforms(rows: "Sequence[BufferFigures | ListenerFigures]") -> str:
    """One row a tree, and the cost of listening to a large team."""
    *buffers, listener = msgspec.to_builtins(rows)
    is_compared = buffers[0]["set_ratio"] is not None
    columns = [_Column("robots", lambda row: f"{row['robots']}")]
    for name, label in (("set", "set"), ("latest", "newest"), ("past", "past")):
        columns.append(_Column(f"{label}, 1000/s", partial(_thousands, f"{name}_per_s")))
        if is_compared:
            columns.append(_Column("ratio", partial(_ratio, f"{name}_ratio")))
    ratio = "ratio: time of tf2_py / time of zteam; above 1, zteam is faster."
    missing = "Nothing to compare with: tf2_py cannot be imported (--tf2-path DIR)."
    legend = "Calls on one core: set a transform, look up the newest one, look up a past one."
    cost = (
        f"Listening to {counted(listener['robots'], 'robot')}, {listener['transforms_per_s']:,} transforms a second: "
        f"{figure(100.0 * listener['core_share'])} % of a core; "
        f"the buffer holds {listener['samples']:,} samples after {listener['seconds']} s."
    )
    return "\n".join([*_table(columns, buffers), legend, ratio if is_compared else missing, cost])


def _thousands(key: str, row: dict[str, float]) -> str:
    return figure(row[key] / 1e3)


def _ratio(key: str, row: dict[str, float | None]) -> str:
    return figure(row[key])


def format_simulation(rows: "Sequence[SimulationFigures]") -> str:
    """The figures of the one run."""
    (row,) = rows
    return "\n".join(
        [
            f"{counted(row.robots, 'robot')} and {row.beams} beams a laser, {row.seconds:g} simulated seconds",
            *_pairs(
                [
                    ("real-time factor", f"{figure(row.rtf)} (simulated seconds / CPU seconds of this process)"),
                    ("rays", f"{figure(row.rays_per_s / 1e6)} million/s"),
                    ("tick", f"{figure(row.step_ms)} ms"),
                    ("memory", f"{figure(row.rss_mb)} MB (resident, at its peak)"),
                ]
            ),
        ]
    )


def format_team(rows: "Sequence[TeamFigures]") -> str:
    """The figures of the one run, then the parts of a tick."""
    (row,) = rows
    pace = "lock-step, as fast as it runs" if row.lockstep else "real time"
    lines = [
        f"{row.world}: {counted(row.robots, 'robot')} and {row.beams} beams a laser, {pace}",
        *_pairs(_run_of(row)),
    ]
    if row.in_process is not None:
        lines += ["", *_in_process_of(row, row.in_process)]
    if row.timing_ms is not None:
        parts = [(name, f"{figure(cost)} ms") for name, cost in msgspec.to_builtins(row.timing_ms).items()]
        lines += ["", "Parts of a tick in the simulator", *_pairs(parts)]
    columns = [
        _Column("process", lambda name: name),
        _Column("CPU, s", lambda name: figure(row.cpu_seconds.get(name))),
        _Column("inputs, ms/tick", lambda name: figure(row.rounds[name].inputs if name in row.rounds else None)),
        _Column("acting, ms/tick", lambda name: figure(row.rounds[name].act if name in row.rounds else None)),
    ]
    lines += ["", *_table(columns if row.rounds else columns[:2], row.cpu_seconds)]
    if row.rounds:
        lines.append("inputs: from the tick's arrival until all its inputs are there. acting: its work and the answer.")
    if row.hops_us:
        steps = [(name.replace("_", " "), f"{figure(cost)} µs") for name, cost in row.hops_us.items()]
        lines += ["", "Steps of a tick, each alone", *_pairs(steps)]
    return "\n".join(lines)


def _in_process_of(row: "TeamFigures", one: "InProcessFigures") -> list[str]:
    """The three ways to run the team, one row each."""
    from zteam.bench.hops import ROBOT_BUDGET_US

    ways = [("processes", row.rtf), ("one process", one.rtf), ("simulator's core alone", one.core_rtf)]
    columns = [
        _Column("the same team in", lambda way: way[0]),
        _Column("real-time factor", lambda way: figure(way[1])),
        _Column("to processes", lambda way: figure(way[1] / row.rtf if way[1] and row.rtf else None)),
    ]
    same = "the same in processes and in one" if one.same_trajectory else "NOT the same in one process"
    alone = figure(row.hops_us.get("behavior_and_safety"))
    budget = f"{alone} µs a robot and tick, alone (budget {ROBOT_BUDGET_US:g})"
    return [
        *_table(columns, ways),
        f"trajectory: {same}; memory of the one process: {figure(one.memory_mb)} MB",
        f"behaviour and safety: {budget}; {figure(one.robot_us)} µs in the team, with the answer",
    ]


def _run_of(row: "TeamFigures") -> list[tuple[str, str]]:
    pairs = [
        ("real-time factor", f"{figure(row.rtf)} (simulated seconds / host seconds, from GO on)"),
        ("ticks", f"{figure(row.ticks_per_s)} /s"),
    ]
    if row.floor_rtf is not None:
        pairs += [
            ("bare Zenoh", f"{figure(row.floor_rtf)} (real-time factor of the same messages without zteam)"),
            ("ratio", f"{figure(row.floor_ratio)} (bare Zenoh / team; 1 is as fast as the transport alone)"),
        ]
    pairs += [
        ("GO", f"{figure(row.go_after_seconds)} s after the start"),
        ("scan to command", f"{figure(row.latency_p50_ms)} ms (median), {figure(row.latency_p99_ms)} ms (99 %)"),
    ]
    if row.lateness_p99_ms is not None:
        pairs.append(("ticks late by", f"{figure(row.lateness_p99_ms)} ms (99 %)"))
    late, again = counted(row.late_steps, "late step"), counted(row.resends, "tick")
    return [
        *pairs,
        ("driven", f"{figure(row.least_driven_m)} m by the robot that drove least"),
        ("lost", f"{late}, {again} sent again, {counted(row.dropped, 'message')} refused"),
        ("memory", f"{figure(row.pss_mb)} MB (PSS of all processes, each at its peak)"),
        ("trajectory", row.trajectory_sha256),
    ]
