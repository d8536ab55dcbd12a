"""The figures of `zteam bench` as tables, with units."""

import msgspec
import pytest

from zteam.cli.bench import figure, format_simulation, format_team
from zteam.cli.bench_team import InProcessFigures, SimulationFigures, TeamFigures
from zteam.node.lockstep import RoundTiming
from zteam.simulator.client import Timing

TEAM = TeamFigures(
    world="office", robots=1, beams=1081, lockstep=True, rtf=44.61234, ticks_per_s=446.1234,
    timing_ms=Timing(1.17345, 0.20712, 0.15634, 0.64678, 0.0130001),
    rounds={"robot_0": RoundTiming(300, 0.0070749998, 0.1999)},
    go_after_seconds=2.34, latency_p50_ms=1.0912, latency_p99_ms=3.2134, lateness_p99_ms=None, late_steps=1, resends=0,
    trajectory_sha256="29c3", pss_mb=217.6, cpu_seconds={"sim": 0.87, "robot_0": 0.28}, dropped=2,
    least_driven_m=14.93,
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


def test_the_core_has_one_line_a_figure() -> None:
    """What the factor is a ratio of, and units."""
    text = format_simulation(SimulationFigures(1, 1081, 2.0, 917.4, 9.91e6, 0.10912, 163.2))
    assert text.splitlines() == [
        "1 robot and 1081 beams a laser, 2 simulated seconds",
        "real-time factor  917 (simulated seconds / CPU seconds of this process)",
        "rays              9.91 million/s",
        "tick              0.109 ms",
        "memory            163 MB (resident, at its peak)",
    ]


def test_a_team_in_lockstep_has_its_run_and_the_parts_of_a_tick() -> None:
    """The factor, what was lost, and tables of the parts, all with units."""
    text = format_team(TEAM)
    assert text.splitlines() == [
        "office: 1 robot and 1081 beams a laser, lock-step, as fast as it runs",
        "real-time factor  44.6 (simulated seconds / host seconds, from GO on)",
        "ticks             446 /s",
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
    ]


def test_a_team_in_one_process_stands_beside_the_processes_and_the_core() -> None:
    """Their factors and ratios, whether the trajectories are the same, and the time of a robot's step."""
    one = InProcessFigures(150.0, 440.0, 71.4, True, 210.0)
    lines = format_team(msgspec.structs.replace(TEAM, in_process=one)).splitlines()
    begin = lines.index("the same team in        real-time factor  to processes")
    assert [line.split() for line in lines[begin + 1 : begin + 4]] == [
        ["processes", "44.6", "1.00"],
        ["one", "process", "150", "3.36"],
        ["simulator's", "core", "alone", "440", "9.86"],
    ]
    assert lines[begin + 4] == "trajectory: the same in processes and in one; memory of the one process: 210 MB"
    assert lines[begin + 5] == "a robot's step with its answer: 71.4 µs"
    other = msgspec.structs.replace(one, same_trajectory=False)
    assert "NOT the same" in format_team(msgspec.structs.replace(TEAM, in_process=other))


def test_a_team_in_real_time_has_no_ratio_but_lateness() -> None:
    """Figures that were not measured have no line."""
    figures = TeamFigures(**{
        **{name: getattr(TEAM, name) for name in TEAM.__struct_fields__},
        "lockstep": False, "rounds": {}, "timing_ms": None, "lateness_p99_ms": 3.25,
    })  # fmt: skip
    lines = format_team(figures).splitlines()
    assert lines[0].endswith("real time")
    assert "ticks late by     3.25 ms (99 %)" in lines
    assert not any(line.startswith(("inputs", "Parts")) for line in lines)
    assert lines[-3].split() == ["process", "CPU,", "s"]
