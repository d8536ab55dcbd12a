"""The report of a run: its file, its table, and the counts in it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from support.limits import LIMIT
from zteam.bus import NoRequest
from zteam.bus.memory import MemoryHub
from zteam.errors import BusError, UsageError, ZteamError
from zteam.node.lockstep import RoundTiming
from zteam.robot.client import SafetyReply
from zteam.simulator.client import Gap, Latency, RobotReport, SimReport, Timing
from zteam.team.launch.process import ProcessReport
from zteam.team.run.report import (
    RunReport,
    check_writable,
    format_report,
    read_report,
    write_report,
)

POSE = (1.0, 2.0, 0.5)
ROBOTS = [
    RobotReport(id=0, follow=None, pose=POSE, distance_m=6.0, stalls=0, gap_m=None, scans=300, late_steps=1),
    RobotReport(id=1, follow=0, pose=POSE, distance_m=5.0, stalls=2, gap_m=Gap(1.0, 1.5, 1.25), scans=3, late_steps=0),
]
ROW = ProcessReport("sim", 7, 0, 0, 150.0, 90.0, 3.0)
REPORT = RunReport(
    sim_seconds=30.0,
    wall_seconds=31.5,
    go_after_seconds=1.2,
    seed=4,
    external_commands=0,
    robots=ROBOTS,
    processes=[ROW, ProcessReport("up", 6, 0, 0, 50.0, 20.0, 0.5)],
    safety_stops={"robot_1": 3},
    latency_ms=Latency(2.0, 9.0, 600),
)
COUNTED = SimReport(
    sim_seconds=30.0,
    seed=4,
    external_commands=5,
    finished=True,
    robots=ROBOTS,
    latency_ms=Latency(2.0, 9.0, 600),
    ticks=301,
    wall_seconds=10.0,
    real_time_factor=3.0,
    trajectory_sha256="abc",
    lockstep=True,
    resends=1,
    hung=["robot_1"],
    timing_ms=Timing(1.0, 2.0, 3.0, 4.0, 5.0),
    lateness_p99_ms=6.0,
)


def test_a_place_for_the_report_is_tried_before_the_run(tmp_path: Path) -> None:
    """A file that is there, a device and a folder with room are no mistake, and nothing is left or changed; what cannot
    be written is one error before the run and after it."""
    path = tmp_path / "r.json"
    check_writable(path)
    assert list(tmp_path.iterdir()) == []
    write_report(path, b"old")
    check_writable(path)
    assert path.read_bytes() == b"old"
    check_writable(Path(os.devnull))
    with pytest.raises(UsageError):
        check_writable(tmp_path / "no" / "r.json")
    with pytest.raises(ZteamError):
        write_report(Path("/dev/full"), b"{}")


def counted_report() -> RunReport:
    """What the processes of a team tell: the simulator, a robot, and one that has refused two payloads."""
    hub = MemoryHub()
    bus = hub.bus()
    bus.serve("sim/report", NoRequest, lambda _: COUNTED)
    bus.serve("robot_0/timing", NoRequest, lambda _: RoundTiming(301, 0.5, 0.25))
    bus.serve("robot_1/safety", NoRequest, lambda _: SafetyReply(3))
    bus.serve_stats("monitor")
    for _ in range(2):
        bus.counters.drop("clock", "test")
    return read_report(hub.bus())


def test_a_report_has_the_keys_and_values_that_scripts_read() -> None:
    """Every key of the file, and where its value comes from. The gap of a robot that follows none is null."""
    report = counted_report()
    report.wall_seconds, report.go_after_seconds, report.processes = 31.235, 1.0, [ROW]
    report.restarts, report.recovery_seconds = {"robot_1": 2}, {"robot_1": 0.212}
    text = msgspec.json.encode(report)
    assert msgspec.json.decode(text, type=RunReport) == report
    found: dict[str, Any] = json.loads(text)
    assert found.pop("rounds").keys() == {"robot_0"}
    assert found.pop("robots") == [
        {
            "id": 0, "follow": None, "pose": [1.0, 2.0, 0.5], "distance_m": 6.0, "stalls": 0, "gap_m": None,
            "scans": 300, "late_steps": 1, "late_commands": 0,
        },
        {
            "id": 1, "follow": 0, "pose": [1.0, 2.0, 0.5], "distance_m": 5.0, "stalls": 2,
            "gap_m": {"mean": 1.0, "max": 1.5, "end": 1.25}, "scans": 3, "late_steps": 0, "late_commands": 0,
        },
    ]  # fmt: skip
    assert found == {
        "sim_seconds": 30.0,
        "wall_seconds": 31.235,
        "go_after_seconds": 1.0,
        "seed": 4,
        "external_commands": 5,
        "dropped": {"clock": 2},
        "safety_stops": {"robot_1": 3},
        "restarts": {"robot_1": 2},
        "chaos": None,
        "processes": [
            {
                "name": "sim", "pid": 7, "exit": 0, "restarts": 0, "rss_mb": 150.0, "pss_mb": 90.0, "cpu_seconds": 3.0,
            }
        ],
        "recovery_seconds": {"robot_1": 0.212},
        "latency_ms": {"p50": 2.0, "p99": 9.0, "count": 600},
        "ticks": 301,
        "real_time_factor": 3.0,
        "trajectory_sha256": "abc",
        "lockstep": True,
        "resends": 1,
        "hung": ["robot_1"],
        "timing_ms": {"wait": 1.0, "physics": 2.0, "sensors": 3.0, "publish": 4.0, "idle": 5.0},
        "lateness_p99_ms": 6.0,
    }  # fmt: skip


def test_the_table_has_a_row_per_robot() -> None:
    """One row per robot, with its gap if it follows, and the memory of all processes together. One is singular, and a
    factor has the digits that mean something."""
    lines = format_report(REPORT).splitlines()
    assert lines[0] == "30 simulated seconds after GO, seed 4"
    header = ["robot", "follows", "driven, m", "last gap, m", "stalls", "safety stops", "late steps"]
    assert re.split("  +", lines[1]) == header
    assert len({len(line) for line in lines[1:4]}) == 1
    assert lines[2].split() == ["0", "-", "6.00", "-", "0", "-", "1"]
    assert lines[3].split() == ["1", "0", "5.00", "1.25", "2", "3", "0"]
    assert lines[4] == "2 processes, 110 MB together (PSS)"
    short = msgspec.structs.replace(REPORT, sim_seconds=1.0, real_time_factor=1234.5678, processes=[ROW])
    first, *_, last = format_report(short).splitlines()
    assert (first, last) == ("1 simulated second after GO, seed 4, 1235 x real time", "1 process, 90 MB together (PSS)")


def test_drops_are_summed_over_all_processes() -> None:
    """Two processes' drops on one key are one sum; keys without a drop are left out; keys are sorted."""
    hub = MemoryHub()
    first, second = hub.bus(), hub.bus()
    first.serve_stats("sim")
    second.serve_stats("robot_0")
    for bus, key in ((first, "robot_1/cmd_vel"), (first, "clock"), (second, "clock"), (second, "clock")):
        bus.counters.drop(key, "test")
    second.counters.of("map").received += 1
    first.serve("sim/report", NoRequest, lambda _: COUNTED)
    assert [*read_report(hub.bus()).dropped.items()] == [("clock", 3), ("robot_1/cmd_vel", 1)]


def test_a_silent_simulator_is_an_error() -> None:
    """Without a simulator there is no report."""
    with pytest.raises(BusError, match="sim/report"):
        read_report(MemoryHub().bus())


def test_the_launcher_is_a_process_too() -> None:
    """The launcher has a row with its process id, memory and processor time."""
    row = ProcessReport("up", os.getpid(), exit=0)
    row.measure()
    assert (row.name, row.pid, row.exit, row.restarts) == ("up", os.getpid(), 0, 0)
    assert 1 < row.pss_mb <= row.rss_mb
    assert row.cpu_seconds > 0


def uptime() -> float:
    """The clock that the kernel dates the start of a process by, in seconds."""
    return float(Path("/proc/uptime").read_text().split()[0])


def test_the_start_is_the_processs_own() -> None:
    """The time since the start includes the interpreter and the imports of this process alone."""
    code = (
        "def uptime(): return float(open('/proc/uptime').readline().split()[0])\n"
        "begun = uptime()\n"
        "from zteam.team.run.report import seconds_since_start\n"
        "print(uptime() - begun, seconds_since_start())"
    )
    before = uptime()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True)
    importing, told = map(float, done.stdout.split())
    # The kernel counts in hundredths.
    assert importing - 0.02 < told < uptime() - before + 0.02


def test_the_page_names_each_field() -> None:
    """And no other: the file and Python have the same names."""
    page = (Path(__file__).parents[4] / "docs" / "time.md").read_text()
    section = page.partition("### The report of a run")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (.*?) \| (.*) \|$", section, re.M)
    named = {name for first, _ in rows for name in re.findall(r"`(\w+)`", first)}
    of_robots = set(RobotReport.__struct_fields__)
    assert named - of_robots == set(RunReport.__struct_fields__)
    assert set(RunReport.__struct_encode_fields__) == set(RunReport.__struct_fields__)
    text = dict(rows)
    assert of_robots - {"gap_m"} <= {*re.findall(r"`(\w+)`", text["`robots`"])}
    for field, kind in (("timing_ms", Timing), ("latency_ms", Latency), ("processes", ProcessReport)):
        assert {*kind.__struct_fields__} == {*re.findall(r"`(\w+)`", text[f"`{field}`"])}
