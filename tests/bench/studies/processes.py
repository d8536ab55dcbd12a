"""A run of a team as users run it: the processes that `zteam up` starts, with a router of their own."""

import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import msgspec

from studies.chains.recorder import NAME, Moment
from studies.router import start_router
from zteam.clock import HOST_FACTOR
from zteam.config.toml_values import toml_text
from zteam.errors import ZteamError
from zteam.team.launch.process import exit_text, zteam_command
from zteam.team.launch.supervisor import Supervisor
from zteam.team.run.report import RunReport

_START = 60.0 * HOST_FACTOR
"""Host seconds for the router to start, and for the last lines of a process that has ended."""


def run_processes(
    team: Path, seconds: float, words: Sequence[str], nodes: Mapping[str, Sequence[str]] = {}
) -> tuple[RunReport, list[Moment]]:
    """Run a team file until `seconds` simulated seconds after GO: the report, and where the robots were.

    `words` are further words for `zteam up`, `nodes` further processes of the team by name, as commands. The router is
    at a port of its own, so no tool or node of the user joins. Raises ZteamError for a run that fails.
    """
    with tempfile.TemporaryDirectory() as folder, closing(Supervisor(_ignore, _ignore)) as supervisor:
        around, tracks, report = (Path(folder) / name for name in ("team.toml", "tracks.json", "report.json"))
        recorder = [sys.executable, "-P", "-m", "studies.chains.recorder", str(tracks)]
        lines = [f"include = {toml_text([str(team.resolve())])}"]
        for name, command in {NAME: recorder, **nodes}.items():
            lines += ["[[nodes]]", f"name = {toml_text(name)}", f"command = {toml_text(command)}", "expect = true"]
        around.write_text("\n".join(lines) + "\n")
        endpoint = start_router(supervisor)
        end = ["--for", str(seconds), "--report", str(report), "--connect", endpoint]
        up = supervisor.start("up", zteam_command("zteam", "up", str(around), *words, *end))
        supervisor.wait(lambda: not up.running, 600 + 60 * seconds)
        if not up.join(_START) or up.exit_code != 0 or not tracks.is_file():
            raise ZteamError(f"the run failed: {' | '.join([exit_text(up.exit_code), *list(up.lines)[-3:]])}")
        moments = msgspec.json.decode(tracks.read_bytes(), type=list[Moment])
        return msgspec.json.decode(report.read_bytes(), type=RunReport), moments


def _ignore(*_: object) -> None:
    pass
