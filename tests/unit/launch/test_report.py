"""What a run's report holds."""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

from zteam.bus.memory import MemoryHub
from zteam.clock import monotonic
from zteam.errors import BusError, ZteamError
from zteam.launch.process import Usage, measure_usage
from zteam.launch.report import (
    ProcessReport,
    RunReport,
    format_report,
    read_dropped,
    read_sim_report,
    report_processes,
    write_report,
)
from zteam.services.simulator import Gap, RobotReport

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
    latency_ms={"p50": 2.0, "p99": 9.0, "count": 600},
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


def test_a_report_without_room_leaves_no_file(tmp_path: Path) -> None:
    """A disk that is full is told, an older report stays whole, and nothing half-written is left."""
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


def test_a_report_goes_where_it_is_sent(tmp_path: Path) -> None:
    """A link keeps pointing at its file; a device is written to and stays a device."""
    link, target = tmp_path / "link.json", tmp_path / "target.json"
    target.touch()
    link.symlink_to(target)
    write_report(link, b"{}")
    assert link.is_symlink() and target.read_bytes() == b"{}"
    write_report(Path(os.devnull), b"{}")
    assert Path(os.devnull).is_char_device()
    with pytest.raises(ZteamError, match="No space left on device"):
        write_report(Path("/dev/full"), b"{}")


def test_every_promised_key_is_written() -> None:
    """The file's keys are those that other people's scripts read."""
    written = json.loads(msgspec.json.encode(REPORT))
    scalars = {"sim_seconds", "wall_seconds", "go_after_seconds", "seed", "external_commands"}
    assert set(written) >= scalars | {"robots", "processes", "dropped"}
    promised = {"id", "follow", "pose", "distance_m", "stalls", "gap_m", "scans", "late_steps"}
    assert all(set(robot) == promised for robot in written["robots"])
    assert written["robots"][0]["gap_m"] is None
    assert written["robots"][1]["gap_m"] == {"mean": 1.0, "max": 1.5, "end": 1.25}
    assert written["robots"][1]["pose"] == [0.0, 2.0, 0.5]
    process = {"name", "pid", "exit", "restarts", "rss_mb", "pss_mb", "cpu_seconds"}
    assert all(set(row) == process for row in written["processes"])


def test_the_table_is_for_people() -> None:
    """One row a robot, the gap where there is one, the memory of all processes together."""
    lines = format_report(REPORT).splitlines()
    assert lines[0] == "30.0 simulated seconds after GO, seed 4"
    assert lines[2].split() == ["0", "-", "6.00", "-", "0", "1"]
    assert lines[3].split() == ["1", "0", "5.00", "1.25", "2", "0"]
    assert lines[4] == "2 processes, 110 MB together (PSS)"


def test_drops_are_summed_over_everybody() -> None:
    """What two processes refused on one key is one sum; keys without a drop are not listed; keys are sorted."""
    hub = MemoryHub()
    first, second, asking = hub.bus(), hub.bus(), hub.bus()
    first.serve_stats("sim")
    second.serve_stats("robot_0")
    first.counters.drop("robot_1/cmd_vel", "test")
    first.counters.drop("clock", "test")
    second.counters.drop("clock", "test")
    second.counters.drop("clock", "test")
    second.counters.receive("map")
    dropped = read_dropped(asking)
    assert dropped == {"clock": 3, "robot_1/cmd_vel": 1}
    assert list(dropped) == ["clock", "robot_1/cmd_vel"]


def test_a_silent_simulator_is_an_error() -> None:
    """No report is made up when nobody counts."""
    with pytest.raises(BusError, match="sim/report"):
        read_sim_report(MemoryHub().bus())


def test_the_launcher_is_a_process_too() -> None:
    """Its own row: this pid, memory and time of its own."""
    own = Usage()
    measure_usage(os.getpid(), own)
    (row,) = report_processes({}, "up", own)
    assert (row.name, row.pid, row.exit, row.restarts) == ("up", os.getpid(), 0, 0)
    assert 1 < row.pss_mb <= row.rss_mb
    assert row.cpu_seconds > 0


def test_the_start_is_the_processs_own() -> None:
    """Time since the start counts interpreter and imports of this process, and nothing from before it."""
    code = (
        "from zteam.clock import monotonic\n"
        "begun = monotonic()\n"
        "from zteam.launch.report import seconds_since_start\n"
        "print(monotonic() - begun, seconds_since_start())"
    )
    before = monotonic()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True)
    importing, told = map(float, done.stdout.split())
    # The kernel counts in hundredths.
    assert importing - 0.02 < told < monotonic() - before + 0.02


def test_usage_starts_empty() -> None:
    """A process that was never measured has no figures."""
    assert Usage() == Usage(0.0, 0.0, 0.0)
