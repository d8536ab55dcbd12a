"""Requests and replies of the simulator's queries, shared with everyone who asks (`sim/status`, `sim/report`)."""

import msgspec


class SimStatus(msgspec.Struct):
    """Answer to `sim/status`."""

    world: str
    robots: list[int]
    interval: int
    """Nanoseconds of simulated time a tick."""
    seed: int
    now: int
    """Nanoseconds of simulated time; 0 before the first tick."""
    tick: int
    real_time_factor: float
    """Simulated seconds a second of the host over the last few seconds."""


class Gap(msgspec.Struct):
    """Distance between the centres of two robots since GO, in metres."""

    mean: float
    max: float
    end: float


class RobotReport(msgspec.Struct):
    """What one robot did since GO, by the simulator's own truth."""

    id: int
    follow: int | None
    pose: tuple[float, float, float]
    """x, y, yaw in `map`."""
    distance_m: float
    """Length of the path driven."""
    stalls: int
    """How often the robot ran into something."""
    gap_m: Gap | None
    """To the robot it follows."""
    scans: int
    late_steps: int
    """Ticks whose command had not come by the next tick."""


class Latency(msgspec.Struct):
    """Milliseconds from a robot's scan being sent to its command's arrival here."""

    p50: float | None
    p99: float | None
    count: int


class SimReport(msgspec.Struct):
    """Answer to `sim/report`; everything counts from GO on."""

    sim_seconds: float
    """Since GO; 0 before."""
    seed: int
    external_commands: int
    """Commands that did not come from the process that holds the robot's name."""
    finished: bool
    """Whether the time asked for with `--for` is over and the world stands still."""
    robots: list[RobotReport]
    latency_ms: Latency
