"""A team of real processes for a test: own router, own namespace, everything in view, no process left behind; or the
same team in the test's own process.

The team works in lock-step, and its world stands still except where the test lets it go on: what a test sees depends
on the seed alone.
"""

import signal
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import structs

from zteam import names
from zteam.behaviors.registry import look_in
from zteam.bus.options import LEASE
from zteam.errors import UsageError
from zteam.launch.check import check_team, refuse_nodes
from zteam.launch.kinds import Pace, TeamLaunch
from zteam.launch.plan import Plan, launch_of, plan_team
from zteam.launch.run import lease_for
from zteam.process_options import LOCKSTEP_TIMEOUT
from zteam.resources import find_team, find_world
from zteam.robot_ids import format_robot_ids, parse_robot_ids
from zteam.team_file import argument_texts, read_team_file, read_team_tables
from zteam.testing.processes import START_LIMIT, TeamTimeout
from zteam.testing.stepping import SteppedTeam, wait_until_joined, wait_until_left
from zteam.testing.view import RobotView

if TYPE_CHECKING:
    from zteam.in_process.run import Body

__all__ = ["START_LIMIT", "TeamFixture", "TeamTimeout"]


class TeamFixture(SteppedTeam):
    """The `team` fixture: starts whole teams, and makes trouble on purpose.

    SteppedTeam controls simulated time; TeamProcesses has the single processes, their output and their presence.
    """

    def launch(
        self,
        team: str | Path,
        *,
        world: str | Path | None = None,
        lockstep: bool = True,
        lockstep_timeout: float = LOCKSTEP_TIMEOUT,
        in_process: bool = False,
        arguments: Mapping[str, Any] | None = None,
    ) -> None:
        """Start a team file (or shipped team), and wait until all its processes are there; the rest as in `start`.

        `arguments` are those of the team file, by name. Its nodes are waited for if they have `expect = true`.
        """
        path = find_team(team)
        file = read_team_file(path, argument_texts(arguments or {}))
        chosen = check_team(file, find_world(world).resolve() if world is not None else None)
        if in_process:
            refuse_nodes(file, "leave in_process out")
        pace = Pace(lockstep=lockstep and chosen is not None, timeout=lockstep_timeout, paused=lockstep)
        self._launch(launch_of(file.team, chosen, team_file=path.resolve(), pace=pace), in_process)

    def start(
        self,
        world: str | Path = "arena",
        robots: int | str | Sequence[int] = 1,
        *,
        behavior: str = "wander",
        follow: Mapping[int, int] | None = None,
        params: Mapping[int, Mapping[str, Any]] | None = None,
        seed: int = 1,
        lockstep: bool = True,
        lockstep_timeout: float = LOCKSTEP_TIMEOUT,
        expect: Sequence[str] = (),
        nodes: "Mapping[str, Body] | None" = None,
        in_process: bool = False,
    ) -> None:
        """Start a team in `world` and wait until all its processes are there.

        `robots` is a number, a list of ids, or ids as text such as "0,2-4". A robot in `follow` follows the robot named
        there, the others run `behavior`; `params` gives behaviour parameters by robot. With `lockstep` the world stands
        still until `run`, `until` or `at` let it go on, as fast as the processes can; own nodes in `expect` take part
        from the first tick on; a living process that does not answer is left behind after `lockstep_timeout` host
        seconds. Without `lockstep` the team runs in real time.

        With `in_process` the whole team runs in the test's process, which starts it in a fifth of a second and steps it
        many times faster, with the same result. `nodes` are own nodes for it, by name, as for `zteam.run_team`. Calls
        that need processes are refused.
        """
        if nodes and not in_process:
            raise UsageError("team.start: nodes needs in_process=True; start the process of an own node yourself")
        file = read_team_tables("team.start", {"robots": _tables(robots, behavior, follow or {}, params or {})})
        if in_process:
            look_in([""])
        chosen = check_team(file, find_world(world).resolve(), here=in_process)
        pace = Pace(lockstep=lockstep, timeout=lockstep_timeout, expect=(*expect, *(nodes or ())), paused=lockstep)
        self._launch(launch_of(file.team, chosen, seed=seed, pace=pace), in_process, nodes)

    def _launch(self, launch: TeamLaunch, in_process: bool, nodes: "Mapping[str, Body] | None" = None) -> None:
        self._expect(launch)
        started = self._start_in_process(launch, nodes) if in_process else self._start_processes(launch)
        self.wait_for_processes(*started)
        if names.SIMULATOR in started:
            known = self.sim_status.robots
            lacking = {names.robot_id_of(name) for name in started} - {None, *known}
            if lacking:
                ids = format_robot_ids(i for i in lacking if i is not None)
                raise UsageError(f"the world has no robot {ids} (it has {format_robot_ids(known) or 'none'})")
            # From here on a test may read any robot's pose.
            if not self._wait(lambda: all(self.robot(i).truth is not None for i in known), START_LIMIT):
                raise TeamTimeout(f"the simulator shows no pose of some robot of {known}")

    def _start_processes(self, launch: TeamLaunch) -> list[str]:
        self._need_processes("start")
        self._lease = lease_for(launch.pace, LEASE)
        self._open()
        plan = plan_team(launch)
        self._plan = Plan({**self._plan.own, **plan.own}, {**self._plan.nodes, **plan.nodes})
        for name, job in plan.jobs.items():
            self._supervisor.start_job(name, structs.replace(job, environment=self.environment))
        return [name for name in plan.jobs if name not in plan.optional]

    def _start_in_process(self, launch: TeamLaunch, nodes: "Mapping[str, Body] | None") -> list[str]:
        from zteam.testing.team_in_process import open_team

        if self._bus is not None or self._in_process is not None:
            raise UsageError("team.start: in_process=True comes first, and once: this team has processes already")
        run = self._in_process_ends.enter_context(open_team(launch, nodes, self._take_line, self._take_hang))
        self._in_process = run
        self._supervisor.close()
        self._supervisor = run.supervisor
        self._look(run.hub.bus("test"))
        for name in run.parts:
            run.start_node(name)
        return [*run.parts]

    def robot(self, robot_id: int) -> RobotView:
        """What the bus tells about a robot. Raises UsageError for one that neither the world nor a process has."""
        if not self._view.knows(robot_id) and self.alive(names.SIMULATOR):
            there = self.sim_status.robots
            if robot_id not in there and not self.alive(names.robot_name(robot_id)):
                raise UsageError(f"there is no robot {robot_id}; the world has {format_robot_ids(there) or 'no robot'}")
        return super().robot(robot_id)

    def kill(self, name: str) -> None:
        """End a process at once (SIGKILL) and wait until it is gone."""
        self._need_processes("kill")
        self._check()
        process = self._process(name)
        process.stopping = True
        process.kill()
        process.join(START_LIMIT)
        wait_until_left(self, name)

    def stop(self, name: str) -> int:
        """Ask a process to stop (SIGTERM), or a node in this process; its exit code."""
        self._process(name).terminate()
        code = self.wait_for_exit(name)
        wait_until_left(self, name)
        return code

    def pause_process(self, name: str) -> None:
        """Freeze a process (SIGSTOP). From here on it may hang."""
        self._need_processes("pause_process")
        self.expect_end(name)
        self._process(name).signal(signal.SIGSTOP)

    def resume_process(self, name: str) -> None:
        """Let a frozen process go on (SIGCONT)."""
        self._need_processes("resume_process")
        self._process(name).signal(signal.SIGCONT)

    def restart(self, name: str) -> None:
        """Start a process again with the same command and wait until it is there; end it first if it still runs."""
        if self._process(name).running:
            # A node in this process cannot be killed.
            (self.kill if self._in_process is None else self.stop)(name)
        self._wait(lambda: not self.alive(name), START_LIMIT)
        self._supervisor.restart(name)
        self.wait_for_processes(name)
        wait_until_joined(self, name)


def _tables(
    robots: int | str | Sequence[int],
    behavior: str,
    follow: Mapping[int, int],
    params: Mapping[int, Mapping[str, Any]],
) -> list[dict[str, Any]]:
    """The robots of `start` as tables of a team file. Raises UsageError."""
    ids = parse_robot_ids([robots], "robots") if isinstance(robots, str) else robots
    ids = list(range(ids) if isinstance(ids, int) else ids)
    if not ids:
        raise UsageError(f"team.start: robots is {robots!r}: give at least one robot")
    for name, given in (("follow", follow), ("params", params)):
        for i in given:
            if i not in ids:
                raise UsageError(f"team.start: {name} has robot {i}, but robots has {format_robot_ids(ids)}")
    return [
        {"id": i, **({"follow": follow[i]} if i in follow else {"behavior": behavior}), **params.get(i, {})}
        for i in ids
    ]
