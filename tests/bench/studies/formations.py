"""Formations behind a leader, from random starts: how soon they stand, how well they hold, and a narrow passage."""

import math
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import get_args

import msgspec
import numpy as np
from numpy.typing import NDArray

from studies.chains.figures import Progress, drive, run_all
from studies.chains.recorder import Tracks
from studies.chains.tracks import Walls, count_touches
from zteam.cli.tables import format_table
from zteam.config.toml_values import toml_text
from zteam.counter_random import uniform
from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline
from zteam.robot.behaviors.formation import Shape, assign, slots_of
from zteam.simulator.world.model import footprint
from zteam.world import World, add_robot, load_world

ROBOTS, STARTS, SPACING, SPEED = 5, 12, 0.8, 0.4
"""With the leader; how many random starts; metres; m/s of the leader."""
RMS, SETTLE = 0.03, 8.0
"""What each shape must reach: metres, seconds."""
IN_FORMATION = 0.1
"""Metres: a robot that is nearer to its slot is in formation."""
_SECONDS = 60.0
_TICK = 0.1
_SIDE = 2.0
"""Metres: three followers start in a square of this side behind the leader; for more it is larger."""
_APART = 0.8
"""Metres between two robots at the start, at least."""
_CHORD = 0.1
"""Metres on either side between which a direction of the leader's path is measured."""
PASSAGE = 8.0, 11.0
"""Metres ahead of the leader's start: where the passage begins and ends."""
_WORLD = """
name "open"
interval_sim 100
define erratic position
(
  size [0.35 0.35 0.25]
  origin [-0.05 0 0 0]
  drive "diff"
  ranger ( pose [0.05 0 -0.1 0] size [0.05 0.05 0.1] sensor ( range [0 30] fov 270.25 samples 271 ) )
)
define block model ( color "gray30" size [3 4 0.5] )
"""
_OPEN = 'model ( name "far" size [0.1 0.1 0.5] pose [-50 0 0 0] )\n'
_BLOCKS = 'block ( name "left" pose [9.5 2.5 0 0] )\nblock ( name "right" pose [9.5 -2.5 0 0] )\n'
"""They leave a passage of 1 m."""


class FormationFigures(msgspec.Struct):
    """One shape, over all starts."""

    shape: str
    robots: int
    """With the leader."""
    starts: int
    settle_s: float
    """Seconds from GO until all followers are in formation, from the slowest start; inf if they never were."""
    rms_m: float
    """Distance of the followers from their slots on a slalom, from the time on when all are in formation."""
    max_m: float
    nearest_m: float
    """Least distance between the centres of two robots at any time."""
    contacts: int
    """Runs in which robots hit each other or were blocked."""
    passage_contacts: int
    """The same, or hits of a wall, through a passage of 1 m, where the formation has to become a column."""
    passage_aside_m: float
    """How far beside the passage's middle a robot was in it."""
    passage_back_s: float
    """Seconds after the last robot has left the passage until all are in formation again; inf if they never were."""

    @property
    def reached(self) -> bool:
        """Whether it holds its shape as it must."""
        contacts = self.contacts + self.passage_contacts
        return contacts == 0 and self.rms_m <= RMS and self.settle_s <= SETTLE and math.isfinite(self.passage_back_s)


class Run(msgspec.Struct):
    """What one run gave."""

    errors: list[list[float]]
    """Metres of each follower from its slot, tick by tick from the time on when all are in formation."""
    settle: float
    nearest: float
    contact: bool
    aside: float = 0.0
    back: float = 0.0


def measure_formations(starts: int | None, *, in_process: bool, progress: Progress) -> list[FormationFigures]:
    """Run every shape from this many starts (None: STARTS), on a slalom and through a passage.

    For `in_process` see `measure_chains`. Raises ZteamError for a run that fails.
    """
    seeds = range(1, 1 + (STARTS if starts is None else min(starts, STARTS)))
    return [_measure(shape, seeds, in_process, progress) for shape in get_args(Shape)]


def _measure(shape: Shape, seeds: Sequence[int], in_process: bool, progress: Progress) -> FormationFigures:
    slalom, passage = (
        run_all(partial(work, shape, in_process), seeds, in_process, f"{shape}, {what}", progress)
        for work, what in ((run_slalom, "slalom"), (run_passage, "passage"))
    )
    held = [error for run in slalom for row in run.errors for error in row]
    return FormationFigures(
        shape=shape,
        robots=ROBOTS,
        starts=len(seeds),
        settle_s=max(run.settle for run in slalom),
        rms_m=math.sqrt(sum(error * error for error in held) / len(held)) if held else math.inf,
        max_m=max(held, default=math.inf),
        nearest_m=min(run.nearest for run in slalom),
        contacts=sum(run.contact for run in slalom),
        passage_contacts=sum(run.contact for run in passage),
        passage_aside_m=max(run.aside for run in passage),
        passage_back_s=max(run.back for run in passage),
    )


def run_slalom(shape: Shape, in_process: bool, seed: int, seconds: float = _SECONDS) -> Run:
    """One run on a slalom without walls."""
    tracks, world = _run(
        {"behavior": "studies.behaviors:Slalom", "speed": SPEED}, _OPEN, shape, seed, in_process, seconds
    )
    return look(tracks, world, shape)


def run_passage(shape: Shape, in_process: bool, seed: int, seconds: float = _SECONDS) -> Run:
    """One run through the passage, straight on."""
    leader = {"behavior": "path", "waypoints": [[0.0, 0.0], [40.0, 0.0]], "speed": SPEED}
    tracks, world = _run(leader, _BLOCKS, shape, seed, in_process, seconds)
    run, poses = look(tracks, world, shape), tracks.poses[:, 1:]
    begin, end = PASSAGE
    inside = (poses[..., 0] > begin) & (poses[..., 0] < end)
    out = np.flatnonzero((poses[..., 0] > end).all(axis=1))
    run.aside = float(np.abs(poses[..., 1])[inside].max(initial=0.0))
    run.back = math.inf
    if len(out):
        errors = errors_of(tracks.poses, shape)[out[0] :]
        run.back = _TICK * next((i for i, row in enumerate(errors) if row.max() < IN_FORMATION), math.inf)
    return run


def look(tracks: Tracks, world: World, shape: Shape) -> Run:
    """What the true poses say, from GO on."""
    moved = np.flatnonzero((tracks.poses[:, 0] != tracks.poses[0, 0]).any(axis=1))
    poses = tracks.poses[max(0, int(moved[0]) - 1) if len(moved) else 0 :]
    errors = errors_of(poses, shape)
    begin = next((i for i, row in enumerate(errors) if row.max() < IN_FORMATION), len(errors))
    walls = Walls(world, footprint(add_robot(world, "erratic", Pose2(0.0, 0.0, 0.0), "bench")))
    between = poses[:, :, None, :2] - poses[:, None, :, :2]
    apart = np.hypot(between[..., 0], between[..., 1])[:, *np.triu_indices(poses.shape[1], 1)]
    return Run(
        errors=errors[begin:].tolist(),
        settle=begin * _TICK if begin < len(errors) else math.inf,
        nearest=float(apart.min()),
        contact=bool(tracks.stalled.any() or walls.touched(poses).any() or count_touches(poses, walls.outline)),
    )


def errors_of(poses: NDArray[np.float64], shape: Shape) -> NDArray[np.float64]:
    """(ticks, followers): metres between the followers and their slots. `poses` are (ticks, robots, 3) with the leader.

    Each follower is measured from one slot in the whole run: those with the least errors in the second half.
    """
    slots = slots_of(shape, poses.shape[1] - 1, SPACING)
    path, ends, first = Polyline(), [], Pose2(*poses[0, 0].tolist())
    for x, y, _yaw in poses[:, 0].tolist():
        path.append(x, y)
        ends.append(path.end)
    places = [
        [_on_path(path, end - s.back, first).compose(Pose2(0.0, s.lateral, 0.0))[:2] for s in slots] for end in ends
    ]
    off = poses[:, 1:, None, :2] - np.array(places)[:, None]
    tables = np.hypot(off[..., 0], off[..., 1])
    chosen = assign((tables[len(tables) // 2 :] ** 2).sum(axis=0).tolist())
    errors: NDArray[np.float64] = tables[:, range(len(chosen)), chosen]
    return errors


def _on_path(path: Polyline, place: float, first: Pose2) -> Pose2:
    """The leader's pose at a place on its path; straight behind its `first` pose before the beginning."""
    if place <= 0.0:
        return first.compose(Pose2(place, 0.0, 0.0))
    (x, y, _), behind, ahead = path.at(place), path.at(place - _CHORD), path.at(place + _CHORD)
    return Pose2(x, y, math.atan2(ahead[1] - behind[1], ahead[0] - behind[0]))


def _run(
    leader: dict[str, object], things: str, shape: Shape, seed: int, in_process: bool, seconds: float
) -> tuple[Tracks, World]:
    with tempfile.TemporaryDirectory() as folder:
        world = Path(folder) / "formations.world"
        world.write_text(_WORLD + things)
        text = team_text(world, leader, shape, seed)
        return drive(text, seconds, in_process=in_process), load_world(world)


def team_text(world: Path, leader: dict[str, object], shape: Shape, seed: int) -> str:
    """The team file of one run."""
    follower = {"behavior": "formation", "leader": 0, "shape": shape, "spacing": SPACING}
    lines = ["[team]", f"world = {toml_text(str(world))}", f"seed = {seed}"]
    for robot, pose in enumerate(starts_of(seed)):
        lines += ["[[robots]]", f"id = {robot}", 'model = "erratic"', f"pose = {toml_text(pose)}"]
        lines += [f"{key} = {toml_text(value)}" for key, value in (follower if robot else leader).items()]
    return "\n".join(lines) + "\n"


def starts_of(seed: int) -> list[Pose2]:
    """The leader at the origin, and the others at random poses behind it."""
    side = _SIDE * max(1.0, math.sqrt(ROBOTS / 4))
    found, draw = [Pose2(0.0, 0.0, 0.0)], 0
    while len(found) < ROBOTS:
        x = -side * uniform(seed, draw, 0, 1)
        y = side * (uniform(seed, draw, 0, 2) - 0.5)
        pose = Pose2(x, y, math.tau * (uniform(seed, draw, 0, 3) - 0.5))
        draw += 1
        if all(math.hypot(pose.x - other.x, pose.y - other.y) >= _APART for other in found):
            found.append(pose)
    return found


_LEGEND = [
    "On a slalom: seconds until all are in formation from the slowest start; distance from the slots from then on;",
    "least distance between two robots' centres; runs in which robots touched.",
    "Through a passage of 1 m: contacts likewise; how far from its middle; seconds until formed again after it.",
    "must: no contact, in formation within so many seconds, rms at most so many metres.",
]


def format_formations(rows: Sequence[FormationFigures]) -> str:
    """One row a shape."""
    header = (
        "shape", "formed, s", "off, m: rms", "max", "nearest, m", "contacts", "passage: contacts", "aside, m",
        "again, s", "must",
    )  # fmt: skip
    cells = [
        [
            row.shape,
            f"{row.settle_s:.1f}",
            f"{row.rms_m:.3f}",
            f"{row.max_m:.3f}",
            f"{row.nearest_m:.2f}",
            f"{row.contacts}",
            f"{row.passage_contacts}",
            f"{row.passage_aside_m:.2f}",
            f"{row.passage_back_s:.1f}",
            f"{SETTLE:g} {RMS:g}: {'reached' if row.reached else 'MISSED'}",
        ]
        for row in rows
    ]
    title = (
        f"{rows[0].robots} robots {SPACING:g} m apart behind a leader at {SPEED:g} m/s, from {rows[0].starts} starts"
    )
    return "\n".join([title, format_table(header, cells, numbers_from=1), *_LEGEND])
