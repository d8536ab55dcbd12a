"""A team as jobs: which processes, told what of the team (`options_of`), stopped in which order; and one of them alone,
in place of this process, or each in a container of its own."""

import json
import os
import shlex
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, NoReturn

import msgspec

from zteam import names
from zteam.config.fault import Fault
from zteam.errors import UsageError, did_you_mean
from zteam.node import kinds, process_options
from zteam.node.launcher import Report
from zteam.simulator.faults import is_simulated
from zteam.team.chaos.means import choose_plan
from zteam.team.file.entries import RobotEntry, Team, behavior_of, navigation_of, static_transform
from zteam.team.launch.process import Job, environment_of, zteam_command

MEMBER = (sys.executable, "-P", "-m", "zteam.team.member")
"""The command of a process of zteam, which reads what it is from its standard input."""
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


class Pace(msgspec.Struct, frozen=True):
    """How the time of a simulated team passes."""

    speed: str | None = None
    """As on the command line: a number or `max`; None = the simulator's default."""
    lockstep: bool = False
    timeout: float = process_options.LOCKSTEP_TIMEOUT
    """Host seconds until lock-step leaves a silent participant behind."""
    expect: tuple[str, ...] = ()
    """Participants besides the team's own that the first tick of lock-step waits for."""
    paused: bool = False
    pause_at: int | None = None
    """The world pauses after this tick."""
    recorded: Path | None = None
    """The ticks of the run that is run again (LockStepOptions)."""


class TeamLaunch(msgspec.Struct, frozen=True):
    """Everything that the processes of a team depend on."""

    team: Team
    world: Path | None
    """None: real robots, no simulator."""
    given_seed: int | None = None
    """None: that of the team file."""
    team_file: Path | None = None
    run_for: float | None = None
    """Simulated seconds after GO."""
    until: int | None = None
    """The run ends before this tick."""
    pace: Pace = Pace()
    view: process_options.ViewOptions | None = None
    """None: the team is started without one."""
    faults: tuple[Fault, ...] = ()
    """On purpose; of those, the simulator carries out in lock-step what it can."""
    own: dict[str, process_options.NodeOptions] = {}
    """Own nodes by name that are functions of a module."""
    record: process_options.RecorderOptions | None = None
    """None: the run is not recorded."""

    @property
    def seed(self) -> int:
        """Of the whole run."""
        return self.team.team.seed if self.given_seed is None else self.given_seed

    @property
    def participants(self) -> tuple[str, ...]:
        """Names of the processes that the first tick of lock-step waits for."""
        told = _told_beside_simulator(self)
        own = [name for name in told if (kind := kinds.kind_of(name)) is not None and kind.in_lockstep]
        expected = (node.name for node in self.team.nodes if node.expect)
        return tuple(dict.fromkeys((*own, *expected, *self.pace.expect)))

    def is_simulated(self, fault: Fault) -> bool:
        """Whether the simulator carries out this fault: in lock-step, what happens to a robot."""
        return self.pace.lockstep and is_simulated(fault)

    @property
    def restarts(self) -> bool:
        """Whether processes that are neither robots nor nodes are started again when they have failed."""
        return self.team.team.restart == "on-failure"

    @property
    def has_end(self) -> bool:
        """Whether the run ends by itself."""
        return self.run_for is not None or self.until is not None


def to_builtins(launch: TeamLaunch) -> dict[str, Any]:
    """What a recording holds of a launch, for `from_builtins`: all but how it was looked at."""
    alone = msgspec.structs.replace(launch, view=None, record=None)
    made: dict[str, Any] = msgspec.to_builtins(alone, str_keys=True, enc_hook=str)
    return made


def from_builtins(made: Any) -> TeamLaunch:
    """Raises msgspec.ValidationError."""
    return msgspec.convert(made, TeamLaunch, str_keys=True, dec_hook=lambda kind, text: kind(text))


def aggregator_options(team: Team, folder: Path) -> process_options.AggregatorOptions:
    """What the aggregator publishes of a team file in this folder."""
    configured = tuple(static_transform(entry) for entry in team.static_transforms)
    return process_options.AggregatorOptions(
        configured, {r.id: folder / r.description for r in team.robots if r.description}
    )


def options_of(launch: TeamLaunch) -> dict[str, process_options.ProcessOptions]:
    """What each process is told, by name, in the order of starting; without the router, which has chosen the port."""
    told, team, pace = _told_beside_simulator(launch), launch.team, launch.pace
    if launch.world is None:
        # The robots are real.
        return told
    speed = pace.speed or ("max" if pace.lockstep else "1")
    simulator = process_options.SimOptions(
        world=launch.world,
        seed=launch.seed,
        has_map=team.team.map is None,
        world_robots=team.team.world_robots,
        added=tuple((robot.id, robot.model or "erratic", robot.pose) for robot in team.robots if robot.pose),
        follows={robot.id: robot.follow for robot in team.robots if robot.follow is not None},
        engine=team.simulation,
        run_for=launch.run_for,
        until=launch.until,
        speed=None if speed == "max" else float(speed),
        paused=pace.paused,
        pause_at=pace.pause_at,
        lockstep=process_options.LockStepOptions(launch.participants, pace.timeout, recorded=pace.recorded)
        if pace.lockstep
        else None,
        faults=tuple(filter(launch.is_simulated, launch.faults)),
    )
    return {names.SIMULATOR: simulator, **told}


def _told_beside_simulator(launch: TeamLaunch) -> dict[str, process_options.ProcessOptions]:
    team, told = launch.team, dict[str, process_options.ProcessOptions]()
    # Paths of the team file are relative to it.
    folder = launch.team_file.parent if launch.team_file else Path()
    if team.team.map:
        # In the place of the simulator's own map.
        told[names.MAP_SERVER] = process_options.MapOptions(folder / team.team.map)
    told[names.AGGREGATOR] = aggregator_options(team, folder)
    told[names.MONITOR] = process_options.MonitorOptions(len(team.driven), tuple(robot.id for robot in team.driven))
    navigated = {
        robot.id: process_options.NavigatedRobot(table, folder, f"robot {robot.id}, navigation", robot.base)
        for robot in sorted(team.robots, key=lambda robot: robot.id)
        if (table := navigation_of(robot)) is not None
    }
    if navigated:
        # One process for all of them: they share the map.
        told[names.navigation_name(min(navigated))] = process_options.NavigationOptions(navigated, launch.seed)
    for robot in team.driven:
        spec, params = behavior_of(robot)
        told[names.robot_name(robot.id)] = process_options.RobotOptions(
            robot.id, spec, params, seed=launch.seed, base=robot.base, safety=robot.safety, folders=(*team.folders, "")
        )
    if launch.view is not None:
        told[names.VIEW] = launch.view
    for name, own in launch.own.items():
        if name in told or name == names.SIMULATOR:
            raise UsageError(f"node {name!r}: the team has a process of this name already")
        told[name] = own
    if launch.record is not None:
        told[names.RECORDER] = msgspec.structs.replace(launch.record, seed=launch.seed, launch=to_builtins(launch))
    return told


class LaunchPlan(msgspec.Struct):
    """Jobs by process name, in the order of starting, without the router."""

    jobs: dict[str, Job]
    unawaited: frozenset[str] = frozenset()
    """Names of the members without which the run begins."""
    optional: frozenset[str] = frozenset()
    """Names of the members that come with zteam and that the team does not need: they may end at any time."""


def stop_order(processes: Iterable[str]) -> list[list[str]]:
    """These processes in groups; each group is stopped after the one before it has ended."""

    def rank(name: str) -> int:
        kind = kinds.kind_of(name)
        # A user's own process may drive a robot, so it stops with the robots.
        return 0 if kind is None else kind.stop_rank

    return [[*group] for _, group in groupby(sorted(processes, key=rank), rank)]


def plan_team(launch: TeamLaunch) -> LaunchPlan:
    team = launch.team
    restarts = {names.robot_name(robot.id): team.restarts(robot) for robot in team.robots}
    # Another simulator begins another run.
    restarts[names.SIMULATOR] = launch.restarts and not launch.has_end
    jobs, optional = dict[str, Job](), set[str]()
    for name, options in options_of(launch).items():
        jobs[name] = Job(
            MEMBER, words=process_options.to_line(name, options), restarts=restarts.get(name, launch.restarts)
        )
        if isinstance(options, process_options.RecorderOptions):
            # Without it the team drives on.
            jobs[name] = msgspec.structs.replace(jobs[name], restarts=False)
            optional.add(name)
        if isinstance(options, process_options.ViewOptions):
            # A view takes no part in the run: it may end, and a new one changes nothing.
            learn = partial(_keep_page, name, options)
            jobs[name] = msgspec.structs.replace(jobs[name], restarts=True, may_end=True, learn=learn)
            optional.add(name)
    nodes = {
        node.name: Job(command_line(node.command), folder=Path(node.folder), restarts=team.restarts(node), may_end=True)
        for node in team.nodes
    }
    awaited = launch.participants if launch.pace.lockstep else ()
    return LaunchPlan({**jobs, **nodes}, frozenset({*optional, *nodes}).difference(awaited), frozenset(optional))


def with_recording(launch: TeamLaunch, file: Path, command: str, *, force: bool) -> TeamLaunch:
    """The launch with a recorder. Raises UsageError where the file exists, unless `force`, or has no folder."""
    process_options.check_new_file(file, force=force)
    record = process_options.RecorderOptions(file.absolute(), force=force, command=command)
    return msgspec.structs.replace(launch, record=record)


def robot_job(launch: TeamLaunch, robot_id: int, behavior: str) -> Job:
    """The job of a robot that is started on request; one of the team file keeps what else is said of it there. Raises
    UsageError unless zteam knows the behaviour: a request must not have a module of its choice imported."""
    from zteam.robot.behaviors.registry import BEHAVIORS, behavior_names, read_params

    known = behavior_names()
    if behavior not in known:
        raise UsageError(f"no behaviour {behavior!r}: there are {', '.join(known)}")
    if behavior in BEHAVIORS:
        read_params(behavior, BEHAVIORS[behavior], {})
    entry = next((each for each in launch.team.robots if each.id == robot_id), RobotEntry(robot_id))
    entry = msgspec.structs.replace(entry, behavior=behavior, follow=None, params={})
    alone = msgspec.structs.replace(launch, team=msgspec.structs.replace(launch.team, robots=[entry], nodes=[]))
    return plan_team(alone).jobs[names.robot_name(robot_id)]


def with_faults(launch: TeamLaunch, plan: str, *, here: bool) -> TeamLaunch:
    """The launch with a plan of faults: a file, or the seed of a random one. Raises UsageError. With `here` the team is
    one process: the simulator of lock-step has to carry out all of them."""
    processes = [*plan_team(launch).jobs, *([] if here else [kinds.ROUTER])]
    faults = choose_plan(plan, launch.run_for, processes, lockstep=launch.pace.lockstep)
    for fault in faults:
        if here and not launch.is_simulated(fault):
            hint = "leave --in-process out" if launch.pace.lockstep else "say --lockstep"
            raise UsageError(f"{plan}: {fault.fault} {fault.name} does not work in one process: {hint}")
    return msgspec.structs.replace(launch, faults=faults)


def _keep_page(name: str, options: process_options.ViewOptions, job: Job, report: Report) -> Job | None:
    """A view that is started again has the port and the token of its first page, so open pages find it."""
    if report.page is None:
        return None
    port = options.port if options.public_url else report.page.port
    again = msgspec.structs.replace(options, port=port, token=report.page.token, browser=False)
    return msgspec.structs.replace(job, words=process_options.to_line(name, again))


PYTHON = ("python", "python3")
"""Words of a user's command that stand for this interpreter."""


def command_line(words: Sequence[str]) -> list[str]:
    """The command line of a user's program; in it `python` is this interpreter, and `zteam` this zteam."""
    program, *rest = words
    if is_own(program):
        return zteam_command(program, *rest)
    return [sys.executable if program in PYTHON else program, *rest]


def is_own(program: str) -> bool:
    """Whether the word is a command of zteam."""
    return program == "zteam" or program in {kind.command for kind in kinds.KINDS}


def become(launch: TeamLaunch, name: str, environment: Mapping[str, str]) -> NoReturn:
    """Replace this process by the process `name` of a team. Raises UsageError."""
    jobs = plan_team(launch).jobs
    if name not in jobs:
        hint = did_you_mean(name, jobs, form="; did you mean {}?")
        raise UsageError(f"--only {name}: the team has {', '.join(jobs)}{hint}")
    job = jobs[name]
    # No file: a container has no place for one. No pipe: it holds 64 kB, which many waypoints exceed.
    words = os.memfd_create("words") if hasattr(os, "memfd_create") else os.dup(tempfile.TemporaryFile().fileno())  # noqa: SIM115
    os.write(words, f"{job.words}\n".encode())
    os.lseek(words, 0, os.SEEK_SET)
    os.dup2(words, 0)
    if job.folder is not None:
        os.chdir(job.folder)
    os.execvpe(job.command[0], list(job.command), environment_of({**environment, **job.environment}))


def compose_file(launch: TeamLaunch, words: Sequence[str], *, is_shipped: bool) -> str:
    """A compose file beside the team file, with a container a process; `words` name the team and its arguments."""
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
