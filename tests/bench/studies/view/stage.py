"""What a view is measured with: a router, a simulator of many robots or a team, and the view, as real processes."""

import math
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from studies.launching import LIMIT, Launch, launch
from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.messages import Clock, Twist, Vector3
from zteam.team.launch.process import ProcessReport

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

    processes: Launch
    port: int
    """Of the view's page."""

    def view_usage(self) -> ProcessReport:
        """Memory of the view's process at its peak."""
        process = self.processes.supervisor.processes["view"]
        process.usage.measure()
        return process.usage

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://127.0.0.1:{self.port}/#token={TOKEN}"


@contextmanager
def crowd(robots: int, beams: int, *options: str) -> Iterator[Stage]:
    """A simulator of many robots that drive in real time, without any other process of a team, and a view with these
    options."""
    with TemporaryDirectory() as folder, launch() as processes:
        world = Path(folder) / "crowd.world"
        world.write_text(crowd_world(robots, beams))
        endpoint = processes.start_router()
        processes.start("sim", "zteam-sim", str(world), "--connect", endpoint)
        processes.wait_for("sim", rf"{robots} robots?, a tick every")
        with closing(connect(BusOptions(connect=endpoint, namespace=""), patience=LIMIT)) as bus:
            drive(bus, robots)
            yield Stage(processes, start_view(processes, endpoint, *options))


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
    with launch() as processes:
        endpoint = processes.start_router()
        processes.start("up", "zteam", "up", name, "--connect", endpoint)
        processes.wait_for("up", "All robots GO")
        yield Stage(processes, start_view(processes, endpoint))


def start_view(processes: Launch, endpoint: str, *more: str) -> int:
    """Start a view; the port of its page."""
    options = ("--connect", endpoint, "--port", "0", "--token", TOKEN, "--no-browser", "--name", "view")
    processes.start("view", "zteam-view", *options, *more)
    return int(processes.wait_for("view", r"http://127\.0\.0\.1:(\d+)/")[1])
