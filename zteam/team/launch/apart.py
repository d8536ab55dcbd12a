"""The processes of a team one by one: one alone in place of this process, or each in a container of its own."""

import json
import os
import shlex
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

from zteam import names
from zteam.errors import UsageError, did_you_mean
from zteam.team.launch.plan import TeamLaunch, plan_team
from zteam.team.launch.process import Job, environment_of

_HEAD = """\
# Made by: {made}
# One container for each process; the image is the one that `docker compose build` makes in a checkout of zteam.
# Options for all processes: ZTEAM_UP_ARGS="--seed 3" docker compose up

x-node: &node
  image: zteam:local
  pull_policy: never
  init: true
  restart: on-failure:5
  user: ${{ZTEAM_USER:-1000:1000}}
  read_only: true
  cap_drop: [ALL]
  security_opt: [no-new-privileges:true]
  environment: &environment
    ZTEAM_CONNECT: tcp/router:7447
{volumes}  depends_on: [router]

services:
  router:
    <<: *node
    command: zteam-router --listen tcp/0.0.0.0:7447
    environment:
      ZTEAM_OWNER: ${{SUDO_USER:-${{USER:-}}}}
    depends_on: []
    ports: ["127.0.0.1:${{ZTEAM_PORT:-7447}}:7447"]
"""
_VOLUMES = """\
  volumes:
    - {{type: bind, source: "{source}", target: /team, read_only: true, bind: {{create_host_path: false}}}}
"""
_VIEW = """\
    environment:
      <<: *environment
      ZTEAM_VIEW_HOST: 0.0.0.0
      ZTEAM_VIEW_TOKEN: ${ZTEAM_VIEW_TOKEN:-}
      ZTEAM_VIEW_URL: http://127.0.0.1:${ZTEAM_VIEW_PORT:-8765}
    ports: ["127.0.0.1:${ZTEAM_VIEW_PORT:-8765}:8765"]
"""


def become(launch: TeamLaunch, name: str, environment: Mapping[str, str]) -> NoReturn:
    """Replace this process by the process `name` of a team. Raises UsageError."""
    jobs = plan_team(launch).jobs
    if name not in jobs:
        hint = did_you_mean(name, jobs, form="; did you mean {}?")
        raise UsageError(f"--only {name}: the team has {', '.join(jobs)}{hint}")
    job: Job = jobs[name]
    # No file: a container has no place for one. No pipe: it holds 64 kB, which many waypoints exceed.
    words = os.memfd_create("words") if hasattr(os, "memfd_create") else os.dup(tempfile.TemporaryFile().fileno())  # noqa: SIM115
    os.write(words, f"{job.words}\n".encode())
    os.lseek(words, 0, os.SEEK_SET)
    os.dup2(words, 0)
    if job.folder is not None:
        os.chdir(job.folder)
    os.execvpe(job.command[0], list(job.command), environment_of({**environment, **job.environment}))


def compose_file(launch: TeamLaunch, words: Sequence[str], *, is_shipped: bool) -> str:
    """A compose file with one container for each process of a team, which lies beside the team file; `words` are those
    that name the team and its arguments."""
    team, *rest = words
    in_container = team if is_shipped else f"/team/{Path(team).name}"
    volumes = "" if is_shipped else _VOLUMES.format(source="${ZTEAM_FOLDER:-.}")
    text = _HEAD.format(made=shlex.join(["zteam", "up", *words, "--compose"]), volumes=volumes)
    for name in plan_team(launch).jobs:
        view = ["--view", "--no-browser"] if launch.view is not None else []
        command = shlex.join(["zteam", "up", in_container, *rest, *view, "--only", name]).replace("$", "$$")
        text += f"  {name}:\n    <<: *node\n    command: {json.dumps(command + ' ${ZTEAM_UP_ARGS:-}')}\n"
        text += _VIEW if name == names.VIEW else ""
    return text
