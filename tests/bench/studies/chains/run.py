"""One run of a chain of robots on a tour: in processes, or in this one."""

import tempfile
from pathlib import Path
from typing import Any

import msgspec

from studies.chains.lectures import LecturesFollow
from studies.chains.recorder import NAME, Recorder, Tracks, make_tracks
from studies.chains.tours import LEAD_IN, Tour
from studies.processes import run_processes
from zteam.config.toml_values import toml_text
from zteam.robot.behaviors.polyline import Polyline
from zteam.team.run.run_team import run_team

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


def follower(chain: Chain, leader: int) -> dict[str, Any]:
    """The entries of a follower in a team file."""
    if chain.law == "lectures":
        return {"behavior": f"{LecturesFollow.__module__}:{LecturesFollow.__name__}", "leader": leader, "safety": False}
    law = {"law": chain.law, **({"gap": GAP} if chain.law == "trail" else {})}
    if chain.delay or chain.noise:
        spec = "studies.chains.disturbance:DisturbedFollow"
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


def run_chain(world: Path, tour: Tour, chain: Chain, *, in_process: bool) -> Tracks:
    """Drive the tour; the true poses of all robots in every tick. Raises ZteamError for a run that fails."""
    seconds = round(_SPARE * (tour.length - LEAD_IN) / chain.speed + _SETTLE, 1)
    return drive(team_text(world.resolve(), tour, chain), seconds, in_process=in_process)


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
