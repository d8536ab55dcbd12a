"""The named cases of the study `lines`: robots that wander, and lines behind a head that wanders or is driven."""

from pathlib import Path
from typing import Any

import msgspec

from studies.study.narrow import NARROW, Narrow
from zteam.config.toml_values import toml_text

SPEED = 0.4
"""m/s of each head that wanders."""


class Case(msgspec.Struct, frozen=True):
    """A line of robots, each behind the one before it. `team`, a shipped team file, says all but the first two."""

    about: str
    speed: float | None = SPEED
    """m/s that the head drives where nothing is in its way; None: it has no share."""
    team: str = ""
    robots: int = 4
    world: str | None = "office"
    """The robots stand in a row there; None: where the world has its own, and it must be given."""
    start: tuple[float, float, float] = (23.0, 25.0, 0.0)
    """Of the first robot of a row, in `map` (m, m, rad); each other one stands 1 m behind the one before it."""
    head: dict[str, Any] = msgspec.field(default_factory=lambda: {"behavior": "wander", "speed": SPEED})
    follower: str = ""
    """Class of the followers, if not `follow`."""
    every: dict[str, Any] = {}
    """Further entries of every robot."""
    simulation: dict[str, Any] = {}
    is_driven: bool = False
    """Whether the head gets commands of drawn teleop scripts (`studies.study.driver`)."""

    def write(self, folder: Path, _seed: int) -> Path:
        """Write its team file; its path."""
        path = folder / "team.toml"
        path.write_text(self.team_text())
        return path

    def team_text(self) -> str:
        """Its team file."""
        lines = ["[team]"]
        if self.world is not None:
            lines += [f"world = {toml_text(self.world)}", "world_robots = false"]
        lines += ["[simulation]", *_entries(self.simulation)]
        for i in range(self.robots):
            lines += ["[[robots]]", f"id = {i}", *_entries(self.every)]
            if self.world is not None:
                lines += ['model = "erratic"', f"pose = {toml_text([self.start[0] - i, *self.start[1:]])}"]
            follower = {"behavior": self.follower, "leader": i - 1} if self.follower else {"follow": i - 1}
            lines += _entries(follower if i else self.head)
        return "\n".join(lines) + "\n"


def _entries(table: dict[str, Any]) -> list[str]:
    return [f"{key} = {toml_text(value)}" for key, value in table.items()]


CASES: dict[str, Case | Narrow] = {
    "line": Case("the shipped team line", team="line"),
    "arena": Case("the shipped team arena", team="arena"),
    "wanderer": Case("one robot that wanders in the arena", robots=1, world="arena", start=(-1.5, 0.0, 0.0)),
    "eight": Case("8 robots in the office", robots=8),
    "world": Case("the 4 robots of a world that --world names", world=None),
    "amcl": Case("each robot believes amcl", every={"navigation": {"localizer": "amcl"}}),
    "noise": Case(
        "odometry errs by alphas of 0.2 under amcl; each follower misses 5 % of poses and statuses of others",
        follower="studies.behaviors:LossyFollow",
        # With Nav2's 60 beams and weights the particles of such a robot lie up to 5 m apart.
        every={"navigation": {"localizer": "amcl", "amcl": {"max_beams": 180, "z_hit": 0.95, "z_rand": 0.05}}},
        simulation={"odom_alphas": [0.2, 0.2, 0.2, 0.2]},
    ),
    "driven": Case(
        "the head is driven by drawn teleop scripts", speed=None, head={"behavior": "idle"}, is_driven=True, robots=5
    ),
    **NARROW,
}
