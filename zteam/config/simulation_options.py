"""Options of a simulator, as of `zteam-sim`; those of contacts and sensors are a team file's `[simulation]` table."""

import math
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from zteam.config.fault import Fault
from zteam.config.numbers import MAX_SECONDS, NotNegative, Share
from zteam.config.option import Seed, option
from zteam.config.problems import CheckedOptions
from zteam.geometry import Pose2

PHYSICS = ("dynamic", "stage", "kinematic")
"""Values of `Options.physics`."""
_Angle = Annotated[float, msgspec.Meta(ge=0.0, le=2.0 * math.pi)]
_Cell = Annotated[float, msgspec.Meta(ge=1e-4, le=1e4)]
LOCKSTEP_TIMEOUT = 10.0
"""Host seconds until lock-step leaves a living participant behind that does not answer."""


class Options(CheckedOptions, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The defaults are Stage's: exact lasers, and odometry as the world has it. Raises ValueError out of range."""

    physics: Annotated[
        Literal["dynamic", "stage", "kinematic"] | None,
        option("how contacts are simulated (default: what the world says, else dynamic)"),
    ] = None
    no_hit: Annotated[Literal["range_max", "inf"], option("range of a beam that hits nothing")] = "range_max"
    below_min: Annotated[
        Literal["measured", "-inf", "zero"], option("range of a beam that hits something nearer than range_min")
    ] = "measured"
    gaussian_noise: Annotated[NotNegative, option("noise of all lasers: standard deviation, m", "M")] = 0.0
    proportional_noise: Annotated[NotNegative, option("noise of all lasers: standard deviation / range", "SHARE")] = 0.0
    odom_alphas: Annotated[
        tuple[NotNegative, NotNegative, NotNegative, NotNegative] | None,
        option("noise of all odometry (Thrun), e.g. 0.05,0.01,0.02,0.01", "A1,A2,A3,A4"),
    ] = None
    dazzle: Annotated[
        Literal["off", "drop", "max", "short", "scan"], option("interference of lasers that see each other")
    ] = "off"
    dazzle_angle: Annotated[_Angle, option("angle on either side of the other laser", "RAD")] = math.radians(2.0)
    dazzle_probability: Annotated[Share, option("share of dazzled scans", "P")] = 1.0
    map_resolution: Annotated[
        _Cell, option("cell size of the published map, metres", "M", typed=(1e-4, 1e4, "metres a cell"))
    ] = 0.05


class LockStepOptions(msgspec.Struct, frozen=True):
    """How the simulator keeps lock-step."""

    expected: Annotated[
        tuple[str, ...],
        option(
            "hold the first tick until these join, e.g. tf planner; needs --lockstep", "NAME", flag="expect", nargs="+"
        ),
    ] = ()
    timeout: Annotated[
        float,
        option(
            "stop waiting for a live participant that does not answer for so long",
            "SECONDS",
            flag="lockstep-timeout",
            typed=(1e-3, 3600.0, "host seconds"),
        ),
    ] = LOCKSTEP_TIMEOUT
    gate: Annotated[bool, option("do not wait for the monitor's GO in lock-step; needs --lockstep")] = True
    recorded: Path | None = None
    """The ticks whose inputs are those of this run (`simulator.process.recorded`); nothing from outside counts then."""


class SimOptions(msgspec.Struct, frozen=True):
    world: Path
    seed: Seed = 1
    has_map: Annotated[bool, option("publish no map: zteam-map serves another one", flag="no-map")] = True
    added: tuple[tuple[int, str, Pose2], ...] = ()
    """Further robots: id, model, pose in `map`."""
    world_robots: Annotated[bool, option("leave out the world's own robots", flag="only-added")] = True
    follows: dict[int, int] = msgspec.field(default_factory=dict)
    """Pairs whose gap is measured: follower -> leader."""
    engine: Options = Options()
    run_for: Annotated[
        float | None,
        option(
            "pause this many simulated seconds after GO, and keep answering queries",
            "SECONDS",
            flag="for",
            # The shortest run ends with the tick of GO.
            typed=(1e-6, MAX_SECONDS, "simulated seconds"),
        ),
    ] = None
    # The first tick is sent in any case.
    until: Annotated[
        int | None, option("pause before this tick, and keep answering queries", "TICK", typed=(2, 10**12, "a tick"))
    ] = None
    speed: Annotated[
        float | None,
        option("simulated seconds per host second, or max (default: 1; max in lock-step)", "X", default=None),
    ] = 1.0
    """None = as fast as possible."""
    paused: Annotated[bool, option("pause at the first tick ('zteam sim resume' continues)")] = False
    pause_at: int | None = None
    """Pause after this tick."""
    lockstep: LockStepOptions | None = None
    faults: tuple[Fault, ...] = ()
    """On purpose, in lock-step: those that the simulator can carry out."""
