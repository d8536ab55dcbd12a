"""Robots that are started while their team runs, on a request of `up/start`."""

import logging
import threading
from collections.abc import Callable, Mapping

import msgspec

from zteam import names
from zteam.bus import Bus, Deferred
from zteam.bus.presence import find_processes
from zteam.errors import BusError, UsageError
from zteam.robot.client import StartRequest
from zteam.team.file.entries import RobotEntry
from zteam.team.launch.plan import LaunchPlan, plan_team
from zteam.team.launch.supervisor import Job, Supervisor
from zteam.team.launch.team_launch import TeamLaunch

log = logging.getLogger("zteam")


class RobotStarts:
    """Starts robots' processes as the team's own were started: supervised, with their lines in the output, and stopped
    with the team. The team does not need them, so it goes on when one of them ends."""

    def __init__(
        self,
        launch: TeamLaunch,
        plan: LaunchPlan,
        supervisor: Supervisor,
        bus: Bus,
        environment: Callable[[str], Mapping[str, str]],
    ) -> None:
        """Take requests from now on; `environment(name)` lets a process join the team, or raises ZteamError."""
        self._launch, self._plan, self._supervisor, self._bus = launch, plan, supervisor, bus
        self._environment = environment
        self._lock = threading.Lock()
        self._ended = False
        key = names.service_key(names.LAUNCHER, names.START)
        # A fork, and the question which process holds the name, take their time.
        bus.serve(key, StartRequest, lambda request: Deferred(lambda: self._start(request)))

    def _start(self, request: StartRequest) -> str:
        check_behavior(request.behavior)
        name, supervisor = names.robot_name(request.robot), self._supervisor
        with self._lock:
            member = supervisor.members.get(name)
            if self._ended:
                raise BusError("the team is stopping")
            if (member is not None and member.running) or find_processes(self._bus, name):
                raise BusError(f"{name} has a process already: end it first")
            job = job_of(self._launch, request.robot, request.behavior)
            job = msgspec.structs.replace(job, environment=self._environment(name))
            log.info("%s is started on request, with behaviour %s", name, request.behavior)
            if name not in self._plan.jobs:
                self._plan.beside |= {name}
                self._plan.optional |= {name}
            supervisor.start_job(name, job)
        return name

    def end(self) -> None:
        """Refuse all further requests."""
        with self._lock:
            self._ended = True


def check_behavior(name: str) -> None:
    """Raise UsageError unless zteam knows this behaviour: a request must not have a module of its choice imported."""
    from zteam.robot.behaviors.registry import BEHAVIORS, behavior_names, read_params

    known = behavior_names()
    if name not in known:
        raise UsageError(f"no behaviour {name!r}: there are {', '.join(known)}")
    if name in BEHAVIORS:
        read_params(name, BEHAVIORS[name], {})


def job_of(launch: TeamLaunch, robot_id: int, behavior: str) -> Job:
    """The job of a robot's process; one of the team file keeps what else is said of it there."""
    entry = next((each for each in launch.team.robots if each.id == robot_id), RobotEntry(robot_id))
    entry = msgspec.structs.replace(entry, behavior=behavior, follow=None, params={})
    alone = msgspec.structs.replace(launch, team=msgspec.structs.replace(launch.team, robots=[entry], nodes=[]))
    return plan_team(alone).own[names.robot_name(entry.id)]
