"""A team as jobs: which processes, told what, stopped in which order."""

import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import msgspec

from zteam import names
from zteam.errors import UsageError
from zteam.node import kinds
from zteam.node.launcher import Report
from zteam.node.process_options import ViewOptions, to_line
from zteam.team.chaos.plan import choose_plan
from zteam.team.file.entries import RobotEntry
from zteam.team.launch.process import zteam_command
from zteam.team.launch.supervisor import Job
from zteam.team.launch.team_launch import TeamLaunch, options_of

MEMBER = (sys.executable, "-P", "-m", "zteam.team.member")
"""The command of a process of zteam, which reads what it is from its standard input."""


class LaunchPlan(msgspec.Struct):
    """Jobs by process name, in the order of starting, without the router."""

    own: dict[str, Job]
    """The processes of zteam: they start at once, import, and read the router's endpoint."""
    nodes: dict[str, Job] = {}
    """The user's own processes, which start when the router listens."""
    unawaited: frozenset[str] = frozenset()
    """Names of the members without which the run begins."""
    optional: frozenset[str] = frozenset()
    """Names of the members that come with zteam and that the team does not need: they may end at any time."""

    @property
    def jobs(self) -> dict[str, Job]:
        """All of them."""
        return {**self.own, **self.nodes}


def stop_order(processes: Iterable[str]) -> list[list[str]]:
    """These processes in groups; each group is stopped after the one before it has ended."""
    ranks = sorted({kind.stop_rank for kind in kinds.KINDS})
    groups: dict[int, list[str]] = {rank: [] for rank in ranks}
    for name in processes:
        kind = kinds.kind_of(name)
        # A user's own process may drive a robot, so it stops with the robots.
        groups[kind.stop_rank if kind else ranks[0]].append(name)
    return list(groups.values())


def plan_team(launch: TeamLaunch) -> LaunchPlan:
    """The processes of a team."""
    team = launch.team
    restarts = {names.robot_name(robot.id): team.restarts(robot) for robot in team.robots}
    # Another simulator begins another run.
    restarts[names.SIMULATOR] = launch.restarts and not launch.has_end
    own: dict[str, Job] = {}
    optional: set[str] = set()
    for kind in kinds.KINDS:
        for name, options in options_of(kind, launch).items():
            words = to_line(name, options)
            own[name] = Job(
                MEMBER,
                words=words,
                # A view takes no part in the run, so a new one changes nothing of it.
                restarts=restarts.get(name, launch.restarts) or kind.optional,
                may_end=kind.optional,
                learn=partial(_keep_page, name, options) if isinstance(options, ViewOptions) else None,
            )
            if kind.optional:
                optional.add(name)
    nodes = {
        node.name: Job(command_line(node.command), folder=Path(node.folder), restarts=team.restarts(node), may_end=True)
        for node in team.nodes
    }
    awaited = launch.participants if launch.pace.lockstep else ()
    return LaunchPlan(own, nodes, frozenset({*optional, *nodes}).difference(awaited), frozenset(optional))


def robot_job(launch: TeamLaunch, robot_id: int, behavior: str) -> tuple[str, Job]:
    """The name and the job of a robot that is started on request; one of the team file keeps what else is said of it
    there. Raises UsageError unless zteam knows the behaviour: a request must not have a module of its choice imported.
    """
    from zteam.robot.behaviors.registry import BEHAVIORS, behavior_names, read_params

    known = behavior_names()
    if behavior not in known:
        raise UsageError(f"no behaviour {behavior!r}: there are {', '.join(known)}")
    if behavior in BEHAVIORS:
        read_params(behavior, BEHAVIORS[behavior], {})
    entry = next((each for each in launch.team.robots if each.id == robot_id), RobotEntry(robot_id))
    entry = msgspec.structs.replace(entry, behavior=behavior, follow=None, params={})
    alone = msgspec.structs.replace(launch, team=msgspec.structs.replace(launch.team, robots=[entry], nodes=[]))
    name = names.robot_name(robot_id)
    return name, plan_team(alone).own[name]


def with_faults(launch: TeamLaunch, plan: str, *, here: bool) -> TeamLaunch:
    """The launch with a plan of faults: a file, or the seed of a random one. Raises UsageError.

    With `here` the team is one process: the simulator of lock-step has to carry out all of them.
    """
    processes = [*plan_team(launch).jobs, *([] if here else [kinds.ROUTER])]
    faults = choose_plan(plan, launch.run_for, processes, lockstep=launch.pace.lockstep)
    for fault in faults:
        if here and not launch.is_simulated(fault):
            hint = "leave --in-process out" if launch.pace.lockstep else "say --lockstep"
            raise UsageError(f"{plan}: {fault.fault} {fault.name} does not work in one process: {hint}")
    return msgspec.structs.replace(launch, faults=faults)


def _keep_page(name: str, options: ViewOptions, job: Job, report: Report) -> Job | None:
    """A view that is started again has the port and the token of its first page, so open pages find it."""
    if report.page is None:
        return None
    port = options.port if options.public_url else report.page.port
    again = msgspec.structs.replace(options, port=port, token=report.page.token, browser=False)
    return msgspec.structs.replace(job, words=to_line(name, again))


def command_line(words: Sequence[str]) -> list[str]:
    """The command line of a user's program. `python` is this interpreter, wherever the user's own is, and zteam this
    zteam."""
    program, *rest = words
    if is_own(program):
        return zteam_command(program, *rest)
    return [sys.executable if is_python(program) else program, *rest]


def is_own(program: str) -> bool:
    """Whether the word is a command of zteam."""
    return program == "zteam" or program in {kind.command for kind in kinds.KINDS}


def is_python(program: str) -> bool:
    """Whether the word stands for this interpreter."""
    return program in ("python", "python3")
