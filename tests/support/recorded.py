"""Recordings of a small run in lock-step, made message by message."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from zteam.messages import (
    Clock,
    Done,
    Header,
    LaserScan,
    Message,
    Odometry,
    String,
    Tick,
    Twist,
    Vector3,
    encode,
    time_from_ns,
)
from zteam.record.writing import Entry, RecordingWriter

FACTS = {"command": "zteam up two --lockstep", "seed": "3", "keys": ""}
STEP = 100_000_000
"""Nanoseconds of a tick."""


def entry(key: str, message: Message, tick: int, time: int = -1) -> Entry:
    """A message in a tick; one outside of ticks has a time."""
    return Entry(key, message.ros_type, time if time >= 0 else tick * STEP, encode(message), tick)


def drive(ticks: int, session: str = "s1") -> list[Entry]:
    """A run of two robots that drive 0.1 m in each tick, with a log and a status beside it."""
    found = [entry("sim/log", String("it begins"), 0, 0)]
    for tick in range(1, ticks + 1):
        stamp = time_from_ns(tick * STEP)
        found.append(entry("sim/tick", Tick(stamp, 1, tick, sessions=[session], sent=4), tick))
        for robot in (0, 1):
            truth = Odometry(Header(stamp, "map"), f"robot_{robot}/base_footprint")
            truth.pose.pose.position.x, truth.pose.pose.position.y = 0.1 * tick, float(robot)
            found.append(entry(f"robot_{robot}/base_pose_ground_truth", truth, tick))
        for robot in (0, 1):
            done = Done(1, tick, True, Twist(Vector3(1.0)), sent=len(session))
            found.append(entry(f"robot_{robot}/done", done, tick))
    return found


def write(path: Path, entries: Iterable[Entry], *, finished: bool = True, **end: str) -> Path:
    """A recording with these messages; one that is not finished ends where its recorder was killed."""
    writer = RecordingWriter(path, FACTS, {"launch.json": b"{}", "files/two.toml": b"[team]"}, force=True)
    for each in entries:
        writer.put(each)
    if finished:
        writer.finish({"is_whole": "True", "lost": "0", **end})
    else:
        writer.flush()
        writer.abandon()
    return path


def assorted(count: int) -> Iterator[Entry]:
    """Messages with arrays, texts and nested messages."""
    for tick in range(1, count + 1):
        scan = LaserScan(Header(time_from_ns(tick * STEP), "robot_0/base_laser_link"))
        scan.ranges = [0.5 * tick] * tick
        yield entry("robot_0/base_scan", scan, tick)
        yield entry("clock", Clock(time_from_ns(tick * STEP)), tick)
        yield entry("sim/log", String(f"tick {tick}, a “text”\nof two lines"), 0, tick * STEP)
