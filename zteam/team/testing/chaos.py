"""`team.chaos`: faults on purpose, each of which returns when it is over and the team has recovered."""

import threading
from collections.abc import Callable, Container
from functools import partial
from typing import Protocol

from zteam import names
from zteam.clock import monotonic, to_ns
from zteam.config.fault import Fault
from zteam.errors import UsageError
from zteam.monitor.motion import Motion
from zteam.monitor.observer import RobotView, TeamObserver
from zteam.simulator.faults import is_simulated
from zteam.team.chaos.means import Means, Stroke
from zteam.team.chaos.run import Outcome, carry_out
from zteam.team.chaos.watchdog import Watchdog
from zteam.team.testing.errors import TeamFailure


class Team(Protocol):
    """What is needed of the fixture."""

    @property
    def is_go(self) -> bool: ...
    @property
    def now(self) -> float: ...
    def alive(self, name: str) -> bool: ...
    def robot(self, robot_id: int) -> RobotView: ...
    def expect_end(self, *processes: str) -> None: ...
    def run(self, seconds: float) -> None: ...
    def until(self, condition: Callable[[], bool], within: float) -> None: ...
    def wait_for(self, condition: Callable[[], bool]) -> None: ...
    def wait_for_return(self, name: str) -> None: ...


class TeamChaos:
    """Each call raises TeamFailure if the team does not recover, or if a robot moves on without commands."""

    def __init__(self, team: Team, observer: TeamObserver, means: Means, restarting: Container[str], tick: int) -> None:
        """`restarting` are those that are started again; `tick` is simulated ns in lock-step, 0 in real time."""
        self._team, self._means, self._restarting, self._tick = team, means, restarting, tick
        self._watchdog = Watchdog(observer, lockstep=tick > 0)

    def kill(self, name: str, *, within: float = 10.0) -> Outcome:
        """End a process at once (SIGKILL). If its team file starts it again, wait until it is back."""
        return self._carry_out(Fault(at=0.0, fault="kill", name=name), within)

    def pause(self, name: str, seconds: float = 3.0, *, within: float = 10.0) -> Outcome:
        """Freeze a process; in lock-step leave a robot out of the ticks."""
        return self._carry_out(Fault(at=0.0, fault="pause", name=name, seconds=seconds), within)

    def cut(self, name: str, seconds: float = 3.0, *, within: float = 10.0) -> Outcome:
        """Let nothing pass on the link of a process; in lock-step leave a robot out of the ticks."""
        return self._carry_out(Fault(at=0.0, fault="cut", name=name, seconds=seconds), within)

    def slow(
        self, name: str, seconds: float = 3.0, *, delay: float = 0.5, rate: float | None = None, within: float = 10.0
    ) -> Outcome:
        """Let each message on the link of a process take `delay` seconds longer, in each direction, and let `rate`
        bytes a second pass; in lock-step a robot's commands come later."""
        fault = Fault(at=0.0, fault="slow", name=name, seconds=seconds, delay=delay, rate=rate)
        return self._carry_out(fault, within)

    def _carry_out(self, fault: Fault, within: float) -> Outcome:
        team = self._team
        if not team.is_go:
            raise UsageError(f"team.chaos.{fault.fault}: call team.wait_for_go first: before GO no robot drives")
        if self._tick and is_simulated(fault):
            outcome = self._in_world(fault, within)
        else:
            team.expect_end(fault.name)
            ends = fault.fault == "kill" and fault.name not in self._restarting
            outcome = self._in_lockstep(fault) if self._tick or ends else self._in_real_time(fault)
        for found in self._watchdog.violations:
            raise TeamFailure(f"{found.name} moved on for {found.silent:.2f} s without a command, at {found.at:.1f} s")
        return outcome

    def _in_real_time(self, fault: Fault) -> Outcome:
        outcome = carry_out([fault], self._watchdog, self._means).faults[0]
        if outcome.problem:
            raise TeamFailure(f"{fault.fault} {fault.name}: {outcome.problem}")
        return outcome

    def _in_world(self, fault: Fault, within: float) -> Outcome:
        """The simulator carries it out, tick by tick: what the test sees depends on the seed alone."""
        team = self._team
        robot_id = names.robot_id_of(fault.name)
        motion = Motion() if robot_id is None else team.robot(robot_id).motion
        outcome, drove = Outcome(team.now, fault.fault, fault.name, fault.lasts), motion.moves
        Stroke(fault, self._means)
        ticks = -(-to_ns(fault.seconds) // self._tick)
        for k in range(1, ticks + 1):
            team.run(self._tick / 1e9)
            if drove and outcome.stood_after is None and not motion.moves:
                outcome.stood_after = k * self._tick / 1e9
        end = team.now
        if drove and outcome.stood_after is not None:
            team.until(lambda: motion.moves, within)
        outcome.recovery_sim = team.now - end
        return outcome

    def _in_lockstep(self, fault: Fault) -> Outcome:
        """It happens to the process, and the world waits for it: by the host's clock."""
        team = self._team
        outcome = Outcome(team.now, fault.fault, fault.name, fault.lasts)
        instances = partial(self._watchdog.team.instances, fault.name)
        before = instances()
        stroke = Stroke(fault, self._means)
        if fault.fault == "kill":
            ended = monotonic()
            team.wait_for(lambda: not before & instances())
            if fault.name not in self._restarting:
                return outcome
            team.wait_for_return(fault.name)
        else:
            # Host time: the world stands still while the process does.
            end = threading.Timer(fault.seconds, stroke.end)  # noqa: TID251
            end.start()
            # It takes as long as the fault, and goes on.
            team.run(fault.seconds)
            end.join()
            ended = monotonic()
            team.wait_for(lambda: bool(instances()) or not before)
        outcome.recovery = monotonic() - ended
        return outcome
