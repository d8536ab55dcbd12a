"""Chains of robots on all tours of a world: the rows of the study `robots`."""

import math
import tempfile
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.recorder import NAME, Recorder, Tracks, make_tracks
from studies.chains.tours import LEAD_IN, Tour, tours_of
from studies.chains.tracks import Samples, Walls, take_samples
from studies.launching import children, run_processes
from zteam.cli.tables import format_table
from zteam.config.numbers import counted
from zteam.config.toml_values import toml_text
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline
from zteam.simulator.world.model import footprint
from zteam.team.run.run_team import run_team
from zteam.world import World, add_robot, load_world

GAP = 0.8
"""Metres of arc length between neighbours at the start, and afterwards where a law keeps a gap."""
_SPARE = 1.2
"""A run has so much more time than the tour takes at the speed that was asked for."""
_SETTLE = 15.0
"""Simulated seconds that the last robots have to come to their places."""


class Chain(msgspec.Struct, frozen=True):
    """What drives on a tour."""

    robots: int
    law: str
    """One of LAWS."""
    speed: float
    """m/s, of the leader."""
    delay: float = 0.0
    """Seconds that teammates' poses come late, besides what a tick takes."""
    noise: float = 0.0
    """Metres: standard deviation of x and y of every pose in `map`."""
    must: tuple[float, float] | None = None
    """No wall is hit, no robot is touched, all arrive, and 90 % of the samples of the last robot are so near to the
    leader's path; the root mean square of the error of all gaps. Metres."""


ROWS = {
    "lectures": Chain(8, "lectures", 0.5),
    "direct": Chain(8, "direct", 0.5),
    "trail": Chain(8, "trail", 0.5, must=(0.05, 0.03)),
    "trail16": Chain(16, "trail", 0.5, must=(0.05, 0.03)),
    "disturbed": Chain(8, "trail", 0.5, delay=0.3, noise=0.02, must=(0.08, math.inf)),
}
"""The rows by name."""


class ChainFigures(msgspec.Struct):
    """One row: a chain on all tours of a world. Lengths are metres; lists are by robot behind the leader."""

    world: str
    row: str
    chain: Chain
    tours: int
    wall_hits: int
    """Tours on which a robot hit a wall or was blocked."""
    touches: int
    """Tours on which robots hit each other."""
    arrived: int
    """Tours on which all came to their places."""
    deviation_p50: float
    """Of the last robot from the leader's path; so are the next two."""
    deviation_p90: float
    deviation_max: float
    gap_mean: float
    gap_rms: float
    """Of the error: the gap along the leader's path less GAP."""
    deviation_p90_by_robot: list[float]
    gap_rms_by_robot: list[float]
    seconds: float
    """Simulated seconds, from the leader's start to its arrival, of all tours."""

    @property
    def reached(self) -> bool | None:
        """Whether it is as it must be; None for a chain that is only compared with."""
        if self.chain.must is None:
            return None
        deviation, gap_rms = self.chain.must
        clean = self.wall_hits == 0 and self.touches == 0 and self.arrived == self.tours
        return clean and self.deviation_p90 <= deviation and self.gap_rms <= gap_rms


Progress = Callable[[str, int, int], None]
"""Called with a row, and how many of its runs are done of how many."""


def measure_chains(
    world: Path, rows: Sequence[str], count: int | None, *, in_process: bool, progress: Progress
) -> list[ChainFigures]:
    """Drive the first `count` tours of a world (None: all) once for each of these rows of ROWS.

    With `in_process` each team runs in one process, and as many teams run at once as there are processors; the
    figures are the same. Raises UsageError for a world without tours, ZteamError for a run that fails.
    """
    _, tours = tours_of(world.stem)
    _check_tours(world)
    numbers = range(len(tours[:count]))
    return [
        summarize(
            load_world(world).name,
            name,
            run_all(partial(measure_tour, world, ROWS[name], in_process), numbers, in_process, name, progress),
        )
        for name in rows
    ]


def run_all(
    work: Callable[[int], Any], numbers: Sequence[int], at_once: bool, row: str, progress: Progress
) -> list[Any]:
    """`work(number)` for each of these numbers: one after the other, or one a processor at once."""
    found = []
    with children(None if at_once else 1) as pool:
        for result in pool.map(work, numbers):
            found.append(result)
            progress(row, len(found), len(numbers))
    return found


@cache
def _walls(path: Path) -> tuple[World, Walls]:
    world = load_world(path)
    robot = add_robot(world, "erratic", Pose2(0.0, 0.0, 0.0), "bench")
    return world, Walls(world, footprint(robot))


def _check_tours(path: Path) -> None:
    name, tours = tours_of(path.stem)
    blocked = [i for i, tour in enumerate(tours) if _walls(path)[1].are_walls(np.array(tour.waypoints)).any()]
    if blocked:
        raise UsageError(f"the tours of {name!r} do not fit {path}: tour {blocked[0]} leads through a wall")


def measure_tour(path: Path, chain: Chain, in_process: bool, number: int) -> Samples:
    """Drive one tour."""
    world, walls = _walls(path)
    tour = tours_of(path.stem)[1][number]
    tracks = drive(team_text(path.resolve(), tour, chain), _seconds_of(tour, chain), in_process=in_process)
    lead_in = np.array(tour.split(LEAD_IN)[0])
    return take_samples(tracks, lead_in, np.array(tour.waypoints[-1]), GAP, walls, world.interval / 1e9)


def _seconds_of(tour: Tour, chain: Chain) -> float:
    return round(_SPARE * (tour.length - LEAD_IN) / chain.speed + _SETTLE, 1)


def follower(chain: Chain, leader: int) -> dict[str, Any]:
    """The entries of a follower in a team file."""
    if chain.law == "lectures":
        return {"behavior": "studies.behaviors:LecturesFollow", "leader": leader, "safety": False}
    law = {"law": chain.law, **({"gap": GAP} if chain.law == "trail" else {})}
    if chain.delay or chain.noise:
        spec = "studies.behaviors:DisturbedFollow"
        return {"behavior": spec, "leader": leader, **law, "delay": chain.delay, "noise": chain.noise}
    return {"follow": leader, **law}


def team_text(world: Path, tour: Tour, chain: Chain) -> str:
    """The team file: the robots stand in a line on the first metres of the tour, GAP apart."""
    way = Polyline(tour.waypoints)
    lines = ["[team]", f"world = {toml_text(str(world))}", "world_robots = false"]
    for i in range(chain.robots):
        leader = {"behavior": "path", "waypoints": tour.split(LEAD_IN)[1], "speed": chain.speed}
        lines += ["[[robots]]", f"id = {i}", 'model = "erratic"', f"pose = {toml_text(way.at(LEAD_IN - GAP * i))}"]
        lines += [f"{key} = {toml_text(value)}" for key, value in (follower(chain, i - 1) if i else leader).items()]
    return "\n".join(lines) + "\n"


def drive(text: str, seconds: float, *, in_process: bool) -> Tracks:
    """Run the team of a team file's text. Raises ZteamError for a run that fails."""
    with tempfile.TemporaryDirectory() as folder:
        team = Path(folder) / "team.toml"
        team.write_text(text)
        if in_process:
            recorder = Recorder()
            run_team(team, seconds=seconds, nodes={NAME: recorder.body})
            return make_tracks(recorder.rows())
        return make_tracks(run_processes(team, seconds, ["--lockstep"])[1])


def summarize(world: str, name: str, samples: Sequence[Samples]) -> ChainFigures:
    """The figures of all tours together."""
    chain = ROWS[name]
    followers = range(chain.robots - 1)
    deviations = [_together([sample.deviations[i] for sample in samples]) for i in followers]
    errors = [_together([sample.gaps[i] for sample in samples]) - GAP for i in followers]
    last, all_errors = deviations[-1], np.concatenate(errors)
    return ChainFigures(
        world=world,
        row=name,
        chain=chain,
        tours=len(samples),
        wall_hits=sum(sample.wall_hits > 0 for sample in samples),
        touches=sum(sample.touches > 0 for sample in samples),
        arrived=sum(sample.arrived for sample in samples),
        deviation_p50=_quantile(last, 0.5),
        deviation_p90=_quantile(last, 0.9),
        deviation_max=_quantile(last, 1.0),
        gap_mean=GAP + float(all_errors.mean()),
        gap_rms=_rms(all_errors),
        deviation_p90_by_robot=[_quantile(values, 0.9) for values in deviations],
        gap_rms_by_robot=[_rms(values) for values in errors],
        seconds=sum(sample.seconds for sample in samples),
    )


def _together(lists: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    return np.concatenate([np.array(values, float) for values in lists])


def _quantile(values: NDArray[np.float64], share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else float("nan")


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values * values)))


_LEGEND = [
    "wall, touch: tours on which a robot hit a wall, or robots hit each other. arrived: tours on which all came home.",
    "deviation: of the last robot from the leader's path, 50 % and 90 % of all samples, and the largest.",
    "gap: arc length between neighbours, mean and rms of the error; rms of the first and of the last gap of the chain.",
    "must: no hit, all arrived, deviation (90 %) and gap rms at most so many metres.",
]


def format_chains(rows: Sequence[ChainFigures]) -> str:
    """One table a world."""
    worlds = dict.fromkeys(row.world for row in rows)
    return "\n\n".join(_table(world, [row for row in rows if row.world == world]) for world in worlds)


def _table(world: str, rows: Sequence[ChainFigures]) -> str:
    header = ["robots", "wall", "touch", "arrived", "deviation, m", "gap, m", "rms", "first to last", "must"]
    table = format_table(["chain", *header], [_cells(row) for row in rows], numbers_from=1)
    chain = rows[0].chain
    title = f"{world}: chains on {counted(rows[0].tours, 'tour')} at {chain.speed:g} m/s"
    return "\n".join([title, table, *_LEGEND])


def _cells(row: ChainFigures) -> list[str]:
    deviation = f"{row.deviation_p50:.3f}  {row.deviation_p90:.3f}  {row.deviation_max:.3f}"
    ends = f"{row.gap_rms_by_robot[0]:.3f}  {row.gap_rms_by_robot[-1]:.3f}"
    counts = [f"{row.chain.robots}", *(f"{n}/{row.tours}" for n in (row.wall_hits, row.touches, row.arrived))]
    return [row.row, *counts, deviation, f"{row.gap_mean:.2f}", f"{row.gap_rms:.3f}", ends, _target(row)]


def _target(row: ChainFigures) -> str:
    if row.chain.must is None:
        return "-"
    bounds = "  ".join(f"{each:g}" for each in row.chain.must if each < math.inf)
    return f"{bounds}: {'reached' if row.reached else 'MISSED'}"
