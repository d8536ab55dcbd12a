"""The report of a run: its file, its table, and the counts in it."""

import json
import os
import re
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
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
from zteam.simulator.client import Gap, Latency, RobotReport, RunFigures, SimReport, Timing
from zteam.team.launch.process import Usage
from zteam.team.run.report import (
    ProcessReport,
    RunReport,
    check_writable,
    complete,
    format_report,
    process_row,
    read_dropped,
    read_report,
    read_sim_report,
    write_report,
)

ROBOTS = [
    RobotReport(id=0, follow=None, pose=(1.0, 2.0, 0.5), distance_m=6.0, stalls=0, gap_m=None, scans=300, late_steps=1),
    RobotReport(
        id=1,
        follow=0,
        pose=(0.0, 2.0, 0.5),
        distance_m=5.0,
        stalls=2,
        gap_m=Gap(mean=1.0, max=1.5, end=1.25),
        scans=300,
        late_steps=0,
    ),
]
REPORT = RunReport(
    sim_seconds=30.0,
    wall_seconds=31.5,
    go_after_seconds=1.2,
    seed=4,
    external_commands=0,
    robots=ROBOTS,
    processes=[ProcessReport("sim", 7, 0, 0, 150.0, 90.0, 3.0), ProcessReport("up", 6, 0, 0, 50.0, 20.0, 0.5)],
    dropped={"robot_0/cmd_vel": 3},
    safety_stops={"robot_1": 3},
    latency_ms=Latency(2.0, 9.0, 600),
)


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """No file of this process grows beyond `size` bytes, as on a disk that is nearly full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_report_on_a_full_disk_leaves_no_file(tmp_path: Path) -> None:
    """A full disk is one error; an older report stays whole, and no partial file is left."""
    path = tmp_path / "r.json"
    with files_of_at_most(10), pytest.raises(ZteamError, match=r"--report .*r\.json: cannot write: File too large"):
        write_report(path, b"x" * 100)
    assert list(tmp_path.iterdir()) == []
    write_report(path, b"old")
    with files_of_at_most(10), pytest.raises(ZteamError):
        write_report(path, b"x" * 100)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    write_report(path, b"new")
    assert path.read_bytes() == b"new"


def test_a_report_is_written_through_a_link_or_to_a_device(tmp_path: Path) -> None:
    """A link still points at its file, and a device is still a device."""
    link, target = tmp_path / "link.json", tmp_path / "target.json"
    target.touch()
    link.symlink_to(target)
    write_report(link, b"{}")
    assert link.is_symlink() and target.read_bytes() == b"{}"
    write_report(Path(os.devnull), b"{}")
    assert Path(os.devnull).is_char_device()
    with pytest.raises(ZteamError, match="No space left on device"):
        write_report(Path("/dev/full"), b"{}")


def test_a_place_for_the_report_is_tried_before_the_run(tmp_path: Path) -> None:
    """A file that is there, a device and a folder with room are no mistake, and nothing is left or changed."""
    path = tmp_path / "r.json"
    check_writable(path)
    assert list(tmp_path.iterdir()) == []
    path.write_bytes(b"old")
    check_writable(path)
    assert path.read_bytes() == b"old"
    check_writable(Path(os.devnull))
    with pytest.raises(UsageError, match="there is no folder"):
        check_writable(tmp_path / "no" / "r.json")


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
ROW = ProcessReport("sim", 7, 0, 0, 150.0, 90.0, 3.0)


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


def written() -> dict[str, Any]:
    """The file of a run whose simulator counted COUNTED."""
    report = counted_report()
    complete(report, 31.23456, 1.00049, [ROW], {"robot_1": 2}, {"robot_1": 0.21234})
    found: dict[str, Any] = json.loads(msgspec.json.encode(report))
    return found


def test_a_report_has_the_keys_and_values_that_scripts_read() -> None:
    """Every key of the file, where its value comes from, and that times are rounded to milliseconds."""
    found = written()
    assert found.pop("rounds").keys() == {"robot_0"}
    assert found.pop("robots") == json.loads(msgspec.json.encode(ROBOTS))
    assert found.pop("processes") == [msgspec.to_builtins(ROW)]
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
        "recovery_seconds": {"robot_1": 0.212},
        "latency_ms": {"p50": 2.0, "p99": 9.0, "count": 600},
        "ticks": 301,
        "rtf": 3.0,
        "trajectory_sha256": "abc",
        "lockstep": True,
        "resends": 1,
        "hung": ["robot_1"],
        "timing_ms": {"wait": 1.0, "physics": 2.0, "sensors": 3.0, "publish": 4.0, "idle": 5.0},
        "lateness_p99_ms": 6.0,
    }


def test_what_did_not_stop_hung_too() -> None:
    """The report names it once, behind those that lock-step left behind."""
    report = counted_report()
    complete(report, 1.0, 1.0, [ROW], {}, {}, ["robot_2", "robot_1"])
    assert report.hung == ["robot_1", "robot_2"]


def test_every_figure_of_the_simulator_is_in_the_report() -> None:
    """A new figure is added to RunFigures alone: the launcher copies every field and repeats none."""
    own = {
        "wall_seconds", "go_after_seconds", "processes", "dropped", "rounds", "restarts", "real_time_factor", "chaos",
        "recovery_seconds", "safety_stops",
    }  # fmt: skip
    assert set(RunReport.__struct_fields__) - set(RunFigures.__struct_fields__) == own - {"real_time_factor"}
    assert own == set(RunReport.__annotations__)
    assert {"finished", "wall_seconds"} == set(SimReport.__annotations__)


def test_a_run_without_go_has_no_time_of_go() -> None:
    """The value is null."""
    report = counted_report()
    complete(report, 1.0, None, [], {}, {})
    assert report.go_after_seconds is None


def test_a_report_can_be_read_back() -> None:
    """The benchmarks read the file as the type that wrote it."""
    text = msgspec.json.encode(REPORT)
    assert msgspec.json.decode(text, type=RunReport) == REPORT


def test_every_row_of_a_robot_has_its_keys() -> None:
    """The gap is null for a robot that follows none, and the pose is x, y, yaw."""
    promised = {"id", "follow", "pose", "distance_m", "stalls", "gap_m", "scans", "late_steps", "late_commands"}
    leader, follower = written()["robots"]
    assert set(leader) == set(follower) == promised
    assert leader["gap_m"] is None
    assert follower["gap_m"] == {"mean": 1.0, "max": 1.5, "end": 1.25}
    assert follower["pose"] == [0.0, 2.0, 0.5]


def test_every_row_of_a_process_has_its_keys() -> None:
    """Name, process id, exit code, restarts, memory and processor time."""
    (row,) = written()["processes"]
    assert set(row) == {"name", "pid", "exit", "restarts", "rss_mb", "pss_mb", "cpu_seconds"}


def test_the_table_has_a_row_per_robot() -> None:
    """One row per robot, with its gap if it follows, and the memory of all processes together."""
    lines = format_report(REPORT).splitlines()
    assert lines[0] == "30 simulated seconds after GO, seed 4"
    header = ["robot", "follows", "driven, m", "last gap, m", "stalls", "safety stops", "late steps"]
    assert re.split("  +", lines[1]) == header
    assert len({len(line) for line in lines[1:4]}) == 1
    assert lines[2].split() == ["0", "-", "6.00", "-", "0", "-", "1"]
    assert lines[3].split() == ["1", "0", "5.00", "1.25", "2", "3", "0"]
    assert lines[4] == "2 processes, 110 MB together (PSS)"


def test_the_table_of_a_short_run_has_no_noise() -> None:
    """One is singular, and a factor has the digits that mean something."""
    short = msgspec.structs.replace(REPORT, sim_seconds=1.0, real_time_factor=1234.5678, processes=REPORT.processes[:1])
    lines = format_report(short).splitlines()
    assert lines[0] == "1 simulated second after GO, seed 4, 1235 x real time"
    assert lines[-1] == "1 process, 90 MB together (PSS)"
    noisy = msgspec.structs.replace(REPORT, sim_seconds=0.1 + 0.2, real_time_factor=1.00321)
    assert format_report(noisy).startswith("0.3 simulated seconds after GO, seed 4, 1.00 x real time\n")


def test_drops_are_summed_over_all_processes() -> None:
    """Two processes' drops on one key are one sum; keys without a drop are left out; keys are sorted."""
    hub = MemoryHub()
    first, second, asking = hub.bus(), hub.bus(), hub.bus()
    first.serve_stats("sim")
    second.serve_stats("robot_0")
    first.counters.drop("robot_1/cmd_vel", "test")
    first.counters.drop("clock", "test")
    second.counters.drop("clock", "test")
    second.counters.drop("clock", "test")
    second.counters.of("map").received += 1
    dropped = read_dropped(asking)
    assert dropped == {"clock": 3, "robot_1/cmd_vel": 1}
    assert list(dropped) == ["clock", "robot_1/cmd_vel"]


def test_a_silent_simulator_is_an_error() -> None:
    """Without a simulator there is no report."""
    with pytest.raises(BusError, match="sim/report"):
        read_sim_report(MemoryHub().bus())


def test_the_launcher_is_a_process_too() -> None:
    """The launcher has a row with its process id, memory and processor time."""
    row = process_row("up", os.getpid())
    assert (row.name, row.pid, row.exit, row.restarts) == ("up", os.getpid(), 0, 0)
    assert 1 < row.pss_mb <= row.rss_mb
    assert row.cpu_seconds > 0


UPTIME = "def uptime(): return float(open('/proc/uptime').readline().split()[0])\n"
"""The clock that the kernel dates the start of a process by."""


def uptime() -> float:
    """Its time, in seconds."""
    return float(Path("/proc/uptime").read_text().split()[0])


def test_the_start_is_the_processs_own() -> None:
    """The time since the start includes the interpreter and the imports of this process alone."""
    code = (
        f"{UPTIME}begun = uptime()\n"
        "from zteam.team.run.report import seconds_since_start\n"
        "print(uptime() - begun, seconds_since_start())"
    )
    before = uptime()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True)
    importing, told = map(float, done.stdout.split())
    # The kernel counts in hundredths.
    assert importing - 0.02 < told < uptime() - before + 0.02


def test_usage_starts_empty() -> None:
    """A process that was never measured has no figures."""
    assert Usage() == Usage(0.0, 0.0, 0.0)
