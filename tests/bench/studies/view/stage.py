"""What a view is measured with: a router, a simulator of many robots or a team, and the view, as real processes."""

import math
import re
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from studies.bare_zenoh import START_LIMIT
from studies.router import start_router
from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.errors import ZteamError
from zteam.messages import Clock, Twist, Vector3
from zteam.node.kinds import ROUTER
from zteam.team.launch.process import Process, Usage, zteam_command
from zteam.team.launch.supervisor import Supervisor

TOKEN = "bench"
SPACING = 2.0
"""Metres between two robots of a crowd."""
CIRCLE = Twist(Vector3(0.2), Vector3(z=0.8))
"""Of 0.25 m radius."""
_CROWD = """
resolution 0.02
define bench_robot position
(
  size [0.35 0.35 0.25]
  origin [-0.05 0 0 0]
  drive "diff"
  ranger ( pose [0.05 0 -0.1 0] size [0.05 0.05 0.1] sensor ( range [0 8] fov 270 samples {beams} ) )
)
define post model ( size [0.3 0.3 0.5] color "gray" )
model ( name "walls" size [{side} {side} 0.5] boundary 1 )
"""


def crowd_world(robots: int, beams: int) -> str:
    """A square room with so many robots, and as many posts between them."""
    columns = math.ceil(math.sqrt(robots))
    lines = [_CROWD.format(beams=beams, side=SPACING * (columns + 1))]
    for i in range(robots):
        x, y = (SPACING * (place - (columns - 1) / 2) for place in (i % columns, i // columns))
        lines.append(f"bench_robot ( pose [{x:.2f} {y:.2f} 0 {i * 37 % 360}] )")
        lines.append(f"post ( pose [{x + SPACING / 2:.2f} {y + SPACING / 2:.2f} 0 0] )")
    return "\n".join(lines) + "\n"


class Stage(NamedTuple):
    """Running processes."""

    supervisor: Supervisor
    endpoint: str
    port: int
    """Of the view's page."""

    def view_usage(self) -> Usage:
        """Memory of the view's process at its peak."""
        process = self.supervisor.processes["view"]
        process.measure()
        return process.usage

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://127.0.0.1:{self.port}/#token={TOKEN}"


@contextmanager
def crowd(robots: int, beams: int, *options: str) -> Iterator[Stage]:
    """A simulator of many robots that drive in real time, without any other process of a team, and a view with these
    options."""
    with (
        TemporaryDirectory() as folder,
        processes() as (supervisor, endpoint),
        closing(connect(BusOptions(connect=endpoint, namespace=""), patience=START_LIMIT)) as bus,
    ):
        world = Path(folder) / "crowd.world"
        world.write_text(crowd_world(robots, beams))
        simulator = supervisor.start("sim", zteam_command("zteam-sim", str(world), "--connect", endpoint))
        _wait_for(supervisor, simulator, rf"{robots} robots?, a tick every")
        drive(bus, robots)
        yield Stage(supervisor, endpoint, start_view(supervisor, endpoint, *options))


def drive(bus: Bus, robots: int) -> None:
    """Command so many robots at each tick: each drives a circle in its own place."""
    wheels = [bus.publisher(names.robot_key(i, names.CMD_VEL), Twist) for i in range(robots)]

    def command(_key: str, _tick: Clock) -> None:
        for each in wheels:
            each.put(CIRCLE)

    bus.subscribe(names.CLOCK, Clock, command)


@contextmanager
def team(name: str) -> Iterator[Stage]:
    """A shipped team in real time, and a view."""
    with processes() as (supervisor, endpoint):
        up = supervisor.start("up", zteam_command("zteam", "up", name, "--connect", endpoint))
        _wait_for(supervisor, up, "All robots GO")
        yield Stage(supervisor, endpoint, start_view(supervisor, endpoint))


@contextmanager
def processes() -> Iterator[tuple[Supervisor, str]]:
    """A set of processes with a router, and its endpoint; all end in the end."""
    with closing(Supervisor(lambda _name, _line: None, lambda _process, _again: None)) as supervisor:
        endpoint = start_router(supervisor)
        try:
            yield supervisor, endpoint
        finally:
            supervisor.stop([name for name in supervisor.processes if name != ROUTER])
            supervisor.stop([ROUTER])


def start_view(supervisor: Supervisor, endpoint: str, *more: str) -> int:
    """Start a view; the port of its page."""
    options = ("--connect", endpoint, "--port", "0", "--token", TOKEN, "--no-browser", "--name", "view")
    supervisor.start("view", zteam_command("zteam-view", *options, *more))
    return view_port(supervisor, r"http://127\.0\.0\.1:(\d+)/")


def view_port(supervisor: Supervisor, pattern: str) -> int:
    """The port that the view prints, the first group of `pattern`."""
    return int(_wait_for(supervisor, supervisor.processes["view"], pattern)[1])


def _wait_for(supervisor: Supervisor, process: Process, pattern: str) -> "re.Match[str]":
    """Wait until a process has written a line that holds `pattern`. Raises ZteamError with its last line."""

    def find() -> "re.Match[str] | None":
        return next(filter(None, (re.search(pattern, line) for line in list(process.lines))), None)

    supervisor.wait(lambda: find() is not None or not process.running, 2.0 * START_LIMIT)
    found = find()
    if found is None:
        raise ZteamError(f"{process.name} did not start: {list(process.lines)[-1:]}")
    return found
