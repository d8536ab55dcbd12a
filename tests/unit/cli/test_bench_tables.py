"""The figures of `zteam bench` as tables, with units."""

import msgspec
import pytest

from zteam.bench.casting import KernelFigures
from zteam.bench.coding import CodecFigures
from zteam.bench.running import InProcessFigures, TeamFigures
from zteam.bench.simulation import SimulationFigures
from zteam.bench.transforms import BufferFigures, ListenerFigures
from zteam.cli.bench_tables import (
    figure,
    format_codec,
    format_kernels,
    format_simulation,
    format_team,
    format_transforms,
)
from zteam.runtime.participant import RoundTiming
from zteam.services.simulator import Timing

TEAM = TeamFigures(
    world="office", robots=1, beams=1081, lockstep=True, rtf=44.61234, ticks_per_s=446.1234,
    timing_ms=Timing(1.17345, 0.20712, 0.15634, 0.64678, 0.0130001),
    rounds={"robot_0": RoundTiming(300, 0.0070749998, 0.1999)},
    go_after_seconds=2.34, latency_p50_ms=1.0912, latency_p99_ms=3.2134, lateness_p99_ms=None, late_steps=1, resends=0,
    trajectory_sha256="29c3", pss_mb=217.6, cpu_seconds={"sim": 0.87, "robot_0": 0.28}, dropped=2,
    least_driven_m=14.93,
    hops_us={"encode_scan": 1.6, "look_up": 2.1},
    floor_rtf=125.3, floor_ratio=2.7895,
)  # fmt: skip


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (0.0, "0.00"),
        (0.30000000000000004, "0.300"),
        (0.013, "0.0130"),
        (1.4, "1.40"),
        (99.96, "100"),
        (125.3, "125"),
        (1234567.0, "1,230,000"),
    ],
)
def test_a_figure_has_three_digits(value: float | None, text: str) -> None:
    """Neither noise behind them nor an exponent, and no figure at all is a dash."""
    assert figure(value) == text


def test_the_codec_is_a_table() -> None:
    """Numbers stand below their headings, which have the units."""
    rows = [CodecFigures("geometry_msgs/msg/Twist", 52, 0.36712, 0.70234), CodecFigures("a/msg/B", 4380, 1.738, 12.5)]
    assert format_codec(rows).splitlines() == [
        "message type             bytes  encode, µs  decode, µs",
        "geometry_msgs/msg/Twist     52       0.367       0.702",
        "a/msg/B                   4380        1.74        12.5",
    ]


def test_the_kernels_are_a_table_that_says_what_the_ratio_is() -> None:
    """Rays a second in millions, and what is divided by what."""
    heading, row, *legend = format_kernels([KernelFigures("bitmap", 1081, 2.75e7, 5.4567)]).splitlines()
    assert heading.split("  ")[0] == "rays against"
    assert row.split() == ["bitmap", "1081", "27.5", "5.46"]
    assert "ratio: time of a fixed piece of numpy / time of the scans" in "\n".join(legend)


def test_the_buffer_is_compared_where_tf2_is_there() -> None:
    """With tf2_py each rate has its ratio, and the legend says of what; without it a line says how to get one."""
    listener = ListenerFigures(100, 20000, 0.06885, 200400, 60)
    alone = format_transforms([BufferFigures(4, 6.97e5, 3.04e5, 2.15e5, None, None, None), listener]).splitlines()
    assert alone[0].split() == ["robots", "set,", "1000/s", "newest,", "1000/s", "past,", "1000/s"]
    assert alone[1].split() == ["4", "697", "304", "215"]
    assert "tf2_py cannot be imported (--tf2-path DIR)" in alone[3]
    assert alone[4].startswith("Listening to 100 robots, 20,000 transforms a second: 6.88 % of a core")
    beside = format_transforms([BufferFigures(4, 6.97e5, 3.04e5, 2.15e5, 2.0, 3.0, 1.5), listener]).splitlines()
    assert beside[1].split() == ["4", "697", "2.00", "304", "3.00", "215", "1.50"]
    assert beside[3] == "ratio: time of tf2_py / time of zteam; above 1, zteam is faster."


def test_the_core_has_one_line_a_figure() -> None:
    """What the factor is a ratio of, and units."""
    text = format_simulation([SimulationFigures(1, 1081, 2.0, 917.4, 9.91e6, 0.10912, 163.2)])
    assert text.splitlines() == [
        "1 robot and 1081 beams a laser, 2 simulated seconds",
        "real-time factor  917 (simulated seconds / CPU seconds of this process)",
        "rays              9.91 million/s",
        "tick              0.109 ms",
        "memory            163 MB (resident, at its peak)",
    ]


def test_a_team_in_lockstep_has_its_run_and_the_parts_of_a_tick() -> None:
    """The factor and its ratio to bare Zenoh, what was lost, and tables of the parts, all with units."""
    text = format_team([TEAM])
    assert text.splitlines() == [
        "office: 1 robot and 1081 beams a laser, lock-step, as fast as it runs",
        "real-time factor  44.6 (simulated seconds / host seconds, from GO on)",
        "ticks             446 /s",
        "bare Zenoh        125 (real-time factor of the same messages without zteam)",
        "ratio             2.79 (bare Zenoh / team; 1 is as fast as the transport alone)",
        "GO                2.34 s after the start",
        "scan to command   1.09 ms (median), 3.21 ms (99 %)",
        "driven            14.9 m by the robot that drove least",
        "lost              1 late step, 0 ticks sent again, 2 messages refused",
        "memory            218 MB (PSS of all processes, each at its peak)",
        "trajectory        29c3",
        "",
        "Parts of a tick in the simulator",
        "wait     1.17 ms",
        "physics  0.207 ms",
        "sensors  0.156 ms",
        "publish  0.647 ms",
        "idle     0.0130 ms",
        "",
        "process  CPU, s  inputs, ms/tick  acting, ms/tick",
        "sim       0.870                -                -",
        "robot_0   0.280          0.00707            0.200",
        "inputs: from the tick's arrival until all its inputs are there. acting: its work and the answer.",
        "",
        "Steps of a tick, each alone",
        "encode scan  1.60 µs",
        "look up      2.10 µs",
    ]


def test_a_team_in_one_process_stands_beside_the_processes_and_the_core() -> None:
    """Their factors and ratios, whether the trajectories are the same, and the budget of a robot's step."""
    one = InProcessFigures(150.0, 440.0, 71.4, True, 210.0)
    hops = {"behavior_and_safety": 31.2}
    lines = format_team([msgspec.structs.replace(TEAM, in_process=one, hops_us=hops)]).splitlines()
    begin = lines.index("the same team in        real-time factor  to processes")
    assert [line.split() for line in lines[begin + 1 : begin + 4]] == [
        ["processes", "44.6", "1.00"],
        ["one", "process", "150", "3.36"],
        ["simulator's", "core", "alone", "440", "9.86"],
    ]
    assert lines[begin + 4] == "trajectory: the same in processes and in one; memory of the one process: 210 MB"
    assert "31.2 µs a robot and tick, alone (budget 150); 71.4 µs in the team" in lines[begin + 5]
    other = msgspec.structs.replace(one, same_trajectory=False)
    assert "NOT the same" in format_team([msgspec.structs.replace(TEAM, in_process=other)])


def test_a_team_in_real_time_has_no_ratio_but_lateness() -> None:
    """Figures that were not measured have no line."""
    figures = TeamFigures(**{
        **{name: getattr(TEAM, name) for name in TEAM.__struct_fields__},
        "lockstep": False, "rounds": {}, "hops_us": {}, "timing_ms": None, "floor_rtf": None, "floor_ratio": None,
        "lateness_p99_ms": 3.25,
    })  # fmt: skip
    lines = format_team([figures]).splitlines()
    assert lines[0].endswith("real time")
    assert "ticks late by     3.25 ms (99 %)" in lines
    assert not any(line.startswith(("ratio", "bare Zenoh", "inputs", "Parts", "Steps")) for line in lines)
    assert lines[-3].split() == ["process", "CPU,", "s"]
