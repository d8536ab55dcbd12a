"""Chains of robots on all tours of a world: the rows of the study `robots`."""

import logging
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from functools import cache, partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.run import GAP, Chain, run_chain
from studies.chains.tours import LEAD_IN, tours_of
from studies.chains.tracks import Samples, Walls, take_samples
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.simulator.world.model import footprint
from zteam.world import World, add_robot, load_world


class Target(msgspec.Struct, frozen=True):
    """What a chain must reach. No wall is hit, no robot is touched, and all arrive."""

    deviation: float
    """Metres: 90 % of the samples of the last robot are so near to the leader's path."""
    gap_rms: float | None = None
    """Metres: root mean square of the error of all gaps."""


class Row(msgspec.Struct, frozen=True):
    """One row of the table."""

    chain: Chain
    target: Target | None = None


ROWS = {
    "lectures": Row(Chain(8, "lectures", 0.5)),
    "direct": Row(Chain(8, "direct", 0.5)),
    "trail": Row(Chain(8, "trail", 0.5), Target(0.05, 0.03)),
    "trail16": Row(Chain(16, "trail", 0.5), Target(0.05, 0.03)),
    "disturbed": Row(Chain(8, "trail", 0.5, delay=0.3, noise=0.02), Target(0.08)),
}
"""The rows by name."""


class ChainFigures(msgspec.Struct):
    """One row: a chain on all tours of a world. Lengths are metres; lists are by robot behind the leader."""

    world: str
    row: str
    chain: Chain
    target: Target | None
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
        """Whether the target was reached; None without one."""
        if self.target is None:
            return None
        clean = self.wall_hits == 0 and self.touches == 0 and self.arrived == self.tours
        even = self.target.gap_rms is None or self.gap_rms <= self.target.gap_rms
        return clean and even and self.deviation_p90 <= self.target.deviation


def measure_chains(
    world: Path,
    rows: Sequence[str],
    count: int | None,
    *,
    in_process: bool,
    progress: Callable[[str, int, int], None] = lambda row, done, total: None,
) -> list[ChainFigures]:
    """Drive the first `count` tours of a world (None: all) once for each of these rows of ROWS.

    With `in_process` each team runs in one process, and as many teams run at once as there are processors; the
    figures are the same. `progress(row, done, total)` is called after each tour. Raises UsageError for a world
    without tours, ZteamError for a run that fails.
    """
    _, tours = tours_of(world.stem)
    _check_tours(world)
    total = len(tours[:count])
    found = []
    with ExitStack() as stack:
        run_all = in_children(stack) if in_process else map
        for name in rows:
            work = partial(measure_tour, world, ROWS[name].chain, in_process)
            samples = []
            for sample in run_all(work, range(total)):
                samples.append(sample)
                progress(name, len(samples), total)
            found.append(summarize(load_world(world).name, name, samples))
    return found


def in_children(stack: ExitStack) -> Callable[[Callable[[int], Any], Sequence[int]], Iterator[Any]]:
    """As `map`, in as many child processes as there are processors, until the stack is closed."""
    # Not forked: this process may have threads.
    spawn = multiprocessing.get_context("spawn")
    return stack.enter_context(ProcessPoolExecutor(os.cpu_count(), spawn, _log_errors_alone)).map


def _log_errors_alone() -> None:
    # The warnings of dozens of teams would hide the table.
    logging.getLogger("zteam").setLevel(logging.ERROR)


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
    tracks = run_chain(path, tour, chain, in_process=in_process)
    lead_in = np.array(tour.split(LEAD_IN)[0])
    return take_samples(tracks, lead_in, np.array(tour.waypoints[-1]), GAP, walls, world.interval / 1e9)


def summarize(world: str, name: str, samples: Sequence[Samples]) -> ChainFigures:
    """The figures of all tours together."""
    row = ROWS[name]
    followers = range(row.chain.robots - 1)
    deviations = [_together([sample.deviations[i] for sample in samples]) for i in followers]
    errors = [_together([sample.gaps[i] for sample in samples]) - GAP for i in followers]
    last, all_errors = deviations[-1], np.concatenate(errors)
    return ChainFigures(
        world=world,
        row=name,
        chain=row.chain,
        target=row.target,
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
