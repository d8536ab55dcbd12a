"""A team of real processes for a test: own router, own namespace, everything in view, no process left behind.

The team works in lock-step, and its world stands still except where the test lets it go on: what a test sees depends
on the seed alone.
"""

import signal
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from zteam import names
from zteam.bus.options import LEASE
from zteam.errors import UsageError
from zteam.launch.arguments import LOCKSTEP_TIMEOUT, Pace
from zteam.launch.check import check_team
from zteam.launch.kinds import kind_of
from zteam.launch.plan import Plan, plan_team
from zteam.launch.run import lease_for
from zteam.resources import find_team, find_world
from zteam.robot_ids import format_robot_ids, parse_robot_ids
from zteam.team_file import RobotEntry, Team, read_team_file
from zteam.testing.processes import START_LIMIT, TeamTimeout
from zteam.testing.stepping import SteppedTeam
from zteam.testing.view import RobotView

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
    ) -> None:
        """Start a team file (or shipped team), and wait until all its processes are there; `lockstep` as in `start`."""
        path = find_team(team)
        file = read_team_file(path)
        chosen = check_team(file, find_world(world).resolve() if world is not None else None)
        pace = Pace(lockstep=lockstep and chosen is not None, timeout=lockstep_timeout, paused=lockstep)
        self._launch(plan_team(file.team, chosen, (), team_file=path.resolve(), pace=pace), pace)

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
    ) -> None:
        """Start a team in `world` and wait until all its processes are there.

        `robots` is a number, a list of ids, or ids as text such as "0,2-4". A robot in `follow` follows the robot named
        there, the others run `behavior`; `params` gives behaviour parameters by robot. With `lockstep` the world stands
        still until `run`, `until` or `at` let it go on, as fast as the processes can; own nodes in `expect` take part
        from the first tick on; a living process that does not answer is left behind after `lockstep_timeout` host
        seconds. Without `lockstep` the team runs in real time.
        """
        ids = parse_robot_ids([robots], "robots") if isinstance(robots, str) else robots
        leaders, given = follow or {}, params or {}
        entries = [
            RobotEntry(
                id=i,
                follow=leaders.get(i),
                behavior=None if i in leaders else behavior,
                params=dict(given.get(i, {})),
            )
            for i in (range(ids) if isinstance(ids, int) else ids)
        ]
        pace = Pace(lockstep=lockstep, timeout=lockstep_timeout, expect=tuple(expect), paused=lockstep)
        chosen = find_world(world).resolve()
        self._launch(plan_team(Team(robots=entries), chosen, (), seed=seed, pace=pace), pace)

    def _launch(self, plan: Plan, pace: Pace) -> None:
        self._plan = Plan({**self._plan.commands, **plan.commands})
        self._lease = lease_for(pace, LEASE) if pace.lockstep else None
        for name, command in plan.commands.items():
            self._supervisor.start(name, command, self.environment)
        self.wait_for_processes(*plan.commands)
        if names.SIMULATOR in plan.commands:
            known = self.sim_status.robots
            lacking = {names.robot_id_of(name) for name in plan.commands} - {None, *known}
            if lacking:
                ids = format_robot_ids(i for i in lacking if i is not None)
                raise UsageError(f"the world has no robot {ids} (it has {format_robot_ids(known) or 'none'})")
            # From here on a test may read any robot's pose.
            if not self._wait(lambda: all(self.robot(i).truth is not None for i in known), START_LIMIT):
                raise TeamTimeout(f"the simulator shows no pose of some robot of {known}")

    def robot(self, robot_id: int) -> RobotView:
        """What the bus tells about a robot. Raises UsageError for one that neither the world nor a process has."""
        if not self._view.knows(robot_id) and self.alive(names.SIMULATOR):
            there = self.sim_status.robots
            if robot_id not in there and not self.alive(names.robot_name(robot_id)):
                raise UsageError(f"there is no robot {robot_id}; the world has {format_robot_ids(there) or 'no robot'}")
        return super().robot(robot_id)

    def kill(self, name: str) -> None:
        """End a process at once (SIGKILL) and wait until it is gone."""
        process = self._supervisor.processes[name]
        process.stopping = True
        process.kill()
        process.join(START_LIMIT)

    def stop(self, name: str) -> int:
        """Ask a process to stop (SIGTERM); its exit code."""
        self._supervisor.processes[name].terminate()
        return self.wait_for_exit(name)

    def pause_process(self, name: str) -> None:
        """Freeze a process (SIGSTOP)."""
        self._supervisor.processes[name].signal(signal.SIGSTOP)

    def resume_process(self, name: str) -> None:
        """Let a frozen process go on (SIGCONT)."""
        self._supervisor.processes[name].signal(signal.SIGCONT)

    def restart(self, name: str) -> None:
        """Start a process again with the same command and wait until it is there; end it first if it still runs."""
        if self._supervisor.processes[name].running:
            self.kill(name)
        self._wait(lambda: not self.alive(name), START_LIMIT)
        self._supervisor.start(name, self._plan.commands[name], self.environment)
        self.wait_for_processes(name)
        kind = kind_of(name)
        if self._interval and kind is not None and kind.in_lockstep:
            self._wait_for_participant(name)
