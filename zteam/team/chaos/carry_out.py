"""Carries out a plan of faults on a team, and reports how it recovers, and whether robots move on without commands."""

import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import msgspec

from zteam import names
from zteam.bus.lateness import LATE
from zteam.clock import HOST_FACTOR, monotonic, to_ns, to_seconds, wait_until
from zteam.config.fault import Fault
from zteam.config.numbers import counted
from zteam.errors import ZteamError
from zteam.messages import Odometry
from zteam.monitor.observer import LINK, RobotView, TeamObserver
from zteam.node.kinds import kind_of
from zteam.node.tokens import RETURN_GRACE
from zteam.simulator.faults import is_simulated
from zteam.team.chaos.means import Means, strike

log = logging.getLogger("zteam")

PATIENCE = 20.0 * HOST_FACTOR
"""Host seconds for a process, and the robots that moved before, to recover."""
_LOOK = 1.0
"""Host seconds between two looks at the plan while no message comes."""
ALLOWED = to_ns(0.2)
"""Simulated time after which the base stops without a command; one tick is added, for the command under way."""
ON_ITS_WAY = (0.3 + LATE) * HOST_FACTOR
"""Host seconds for which, in real time, a command that this process has received may not have reached the simulator."""


class Violation(msgspec.Struct, frozen=True):
    """A robot moved on without commands."""

    name: str
    at: float
    """Simulated seconds."""
    silent: float
    """Simulated seconds since its last command."""
    speed: float


class Watchdog:
    """Observes the motion of a team, and finds the violations."""

    def __init__(self, team: TeamObserver, *, lockstep: bool, simulated: bool = True) -> None:
        """Without a simulator (`simulated` False) time is the host's, from now on."""
        self.team, self._lockstep = team, lockstep
        self._linked = monotonic()
        """Host time of the newest change of the link."""
        self._since = None if simulated else monotonic()
        self.violations: list[Violation] = []
        team.on(LINK, self._on_link)
        team.on(names.GROUND_TRUTH, self._on_truth)
        team.observe(names.GROUND_TRUTH, names.CMD_VEL, names.STATUS, names.TEAM_STATUS, names.CLOCK)

    @property
    def elapsed(self) -> float:
        """Simulated seconds since GO that were observed, however often the world began anew."""
        return to_seconds(self.team.elapsed) if self._since is None else monotonic() - self._since

    def reaches(self, at: float) -> bool:
        """Whether it is so many simulated seconds after GO, and all that moves has been observed."""
        return self.elapsed >= at and self.elapsed > 0.0

    def driving(self) -> list[RobotView]:
        """The robots that move."""
        return [robot for _, robot in sorted(self.team.robots.items()) if robot.motion.moves]

    def _on_truth(self, robot: RobotView, _truth: Odometry) -> None:
        motion = robot.motion
        # A simulator that has just found its link publishes no command before it knows of this subscriber.
        is_exact = self._lockstep and monotonic() > self._linked + RETURN_GRACE
        quiet = math.inf if is_exact else monotonic() - motion.commanded_at
        if motion.silent > ALLOWED + motion.tick and quiet > ON_ITS_WAY:
            silent = to_seconds(motion.silent)
            self.violations.append(Violation(robot.name, to_seconds(motion.stamp), silent, motion.speed))

    def _on_link(self, *_: object) -> None:
        # Commands were lost, and after the link is back a truth may come before the first command.
        with self.team.changed:
            self._linked = monotonic()
            for robot in self.team.robots.values():
                robot.motion.commanded = None


class Outcome(msgspec.Struct):
    """What became of one fault. Times are seconds; None where it is not known or did not come to that."""

    at: float
    """Simulated, since GO."""
    fault: str
    name: str
    lasted: float
    stood_after: float | None = None
    """Simulated, from its beginning until the robot stood."""
    recovery: float | None = None
    """Of the host, from its end until the process was back and the robots that had moved before moved."""
    recovery_sim: float | None = None
    """Simulated, from its end until the last of these robots moved."""
    last: str = ""
    """What was back last, and why a robot stood until then in its own words; empty if all was back at once."""
    problem: str = ""
    """Why it was not carried out, or what did not recover."""


class ChaosReport(msgspec.Struct):
    """All faults of a plan, and each robot that moved on without commands."""

    faults: list[Outcome]
    violations: list[Violation]

    @property
    def recoveries(self) -> list[float]:
        """Host seconds of those that recovered, ascending."""
        return sorted(each.recovery for each in self.faults if each.recovery is not None)


class _Watched:
    """A fault that has begun, and what it takes to see its end."""

    def __init__(self, fault: Fault, watchdog: Watchdog, means: Means, *, planned: bool) -> None:
        """`planned`: the simulator knows it already."""
        self.fault, self._means, self._planned = fault, means, planned
        self.in_world = planned or (means.simulate is not None and is_simulated(fault))
        """Whether the simulator carries it out."""
        self._heal: Callable[[], object] = lambda: None
        """What ends it."""
        self.outcome = Outcome(round(watchdog.elapsed, 3), fault.fault, fault.name, fault.lasts)
        self._watchdog = watchdog
        self._before = watchdog.team.instances(fault.name)
        self._is_robot = names.robot_id_of(fault.name) is not None
        # A robot's fault concerns that robot, and others that wait for it stand for good reasons.
        self._drove = [each for each in watchdog.driving() if each.name == fault.name or not self._is_robot]
        # This process hears of it later than the simulator, whose plan counts from GO.
        late = watchdog.elapsed - fault.at if planned else 0.0
        self._began = watchdog.team.now - to_ns(late)
        self._elapsed_end = watchdog.elapsed - late + fault.lasts
        self._host_end = monotonic() + fault.lasts
        self._end_stamp, self._ended_at = 0, 0.0
        self._since: list[tuple[RobotView, int, int]] | None = None
        """World and time after which each of the robots must move; None until the process is back."""
        self.has_ended = False
        if fault.fault == "kill":
            self.end()

    def begin(self, say: Callable[[str], None]) -> bool:
        """Carry it out, unless the simulator knows of it; whether that is possible."""
        fault, at = self.fault, f"{self._watchdog.elapsed:.1f} s"
        told = f"{fault.fault} {fault.name}" + (f" for {fault.seconds:g} s" if fault.lasts else "")
        try:
            if not self._planned:
                self._heal = strike(fault, self._means)
            say(f"{at}: {told}")
        except ZteamError as error:
            self.outcome.problem = str(error)
            say(f"{at}: not carried out: {told}: {error}")
        return not self.outcome.problem

    @property
    def is_due(self) -> bool:
        """Whether its time is over: simulated time, or the host's where that is first, as when the world stands.

        After its end: whether the team has recovered.
        """
        if self.has_ended:
            return self.has_recovered
        return self._watchdog.elapsed >= self._elapsed_end or self.host_left <= 0.0

    @property
    def host_left(self) -> float:
        """Host seconds until it is over at the latest. A fault in the world ends with simulated time alone."""
        return _LOOK if self.has_ended or self.in_world else max(0.0, self._host_end - monotonic())

    def end(self, say: Callable[[str], None] = log.info) -> None:
        """End it, unless that was done: from here on the recovery counts."""
        if self.has_ended:
            return
        try:
            self._heal()
        except ZteamError as error:
            # A process that was killed meanwhile.
            say(f"{self.fault.fault} {self.fault.name} could not be ended: {error}")
        self._end_stamp = self._began + to_ns(self.fault.lasts) if self.in_world else self._watchdog.team.now
        self._ended_at, self.has_ended = monotonic(), True

    @property
    def has_recovered(self) -> bool:
        """Whether the process and the robots are back; that is noted. True also when it takes too long."""
        outcome, since = self.outcome, self._since
        if self._is_robot and self._drove and (halted := self._drove[0].motion.halted) > self._began:
            outcome.stood_after = to_seconds(halted - self._began)
        if since is None and self._is_back:
            # Before it was back, a robot may have moved on for the time of its watchdog.
            now = self._end_stamp if self.in_world else self._watchdog.team.now
            since = self._since = [(robot, robot.motion.world, now) for robot in self._drove]
        still = [robot for robot, world, stamp in since or () if not robot.motion.moved_since(world, stamp)]
        if since is not None and not still:
            outcome.recovery = monotonic() - self._ended_at
            starts = [robot.motion.started for robot, world, _ in since if robot.motion.world == world]
            outcome.recovery_sim = to_seconds(max(0, max(starts) - self._end_stamp)) if starts else None
            return True
        texts = [f"{robot.name} ({robot.reason})" if robot.reason else robot.name for robot in still]
        outcome.last = self.fault.name if since is None else ", ".join(texts)
        if monotonic() - self._ended_at < PATIENCE:
            return False
        outcome.problem = f"not back: {outcome.last}"
        return True

    @property
    def _is_back(self) -> bool:
        kind = kind_of(self.fault.name)
        if kind is None or not kind.on_bus:
            return True
        there = self._watchdog.team.instances(self.fault.name)
        return bool(there - self._before if self.fault.fault == "kill" else there)


def carry_out(
    plan: Sequence[Fault],
    watchdog: Watchdog,
    means: Means,
    *,
    planned: Callable[[Fault], bool] = lambda fault: False,
    stopping: Callable[[], bool] = lambda: False,
    say: Callable[[str], None] = log.info,
) -> ChaosReport:
    """Carry out a plan, which counts simulated seconds from GO on, and wait until the team has recovered.

    `planned(fault)` says which faults the simulator knows already. When `stopping()`, it ends early, with all faults.
    """
    waiting, active, outcomes, changed = deque(plan), list[_Watched](), list[Outcome](), watchdog.team.changed

    def is_due() -> bool:
        return stopping() or (bool(waiting) and watchdog.reaches(waiting[0].at)) or any(each.is_due for each in active)

    try:
        while (waiting or active) and not stopping():
            with changed:
                wait_until(changed, is_due, min([_LOOK, *(each.host_left for each in active)]))
            for each in [each for each in active if each.is_due]:
                if each.has_ended:
                    active.remove(each)
                    say(describe(each.outcome))
                each.end(say)
            while waiting and watchdog.reaches(waiting[0].at) and not stopping():
                fault = waiting.popleft()
                begun = _Watched(fault, watchdog, means, planned=planned(fault))
                outcomes.append(begun.outcome)
                active += [begun] if begun.begin(say) else []
        # What the simulator has begun meanwhile, in a fast run.
        late = [fault for fault in waiting if planned(fault) and watchdog.reaches(fault.at)]
        missed = [_Watched(fault, watchdog, means, planned=True) for fault in late]
        active += missed
        outcomes += [each.outcome for each in missed]
    finally:
        for each in active:
            each.end(say)
            if not each.has_recovered:
                each.outcome.problem = "the run ended first"
    return ChaosReport(outcomes, list(watchdog.violations))


def describe(outcome: Outcome) -> str:
    """One line of progress."""
    if outcome.recovery is None:
        return f"{outcome.fault} {outcome.name}: {outcome.problem}"
    return f"{outcome.fault} {outcome.name}: recovered after {outcome.recovery:.2f} s"


def carry_out_beside(
    plan: Sequence[Fault], watchdog: Watchdog, means: Means, planned: Callable[[Fault], bool]
) -> Callable[[], ChaosReport]:
    """Carry out the plan of a run in a thread. The function that is returned ends what is open, and reports; a second
    call reports the same."""
    stopping, pool = threading.Event(), ThreadPoolExecutor(1, "chaos")
    result = pool.submit(carry_out, plan, watchdog, means, planned=planned, stopping=stopping.is_set)
    # The thread ends with the plan.
    pool.shutdown(wait=False)

    def stop() -> ChaosReport:
        stopping.set()
        with watchdog.team.changed:
            watchdog.team.changed.notify_all()
        return result.result()

    return stop


HEADER = ("at, s", "fault", "name", "lasted, s", "stood after, s", "recovery, s", "simulated, s", "back last", "")


def rows(report: ChaosReport) -> list[tuple[str, ...]]:
    """The report as the cells of a table."""

    def cell(value: float | None) -> str:
        return "-" if value is None else f"{value:.2f}"

    return [
        (
            f"{each.at:.1f}", each.fault, each.name, cell(each.lasted or None), cell(each.stood_after),
            cell(each.recovery), cell(each.recovery_sim), "" if each.problem else each.last, each.problem,
        )
        for each in report.faults
    ]  # fmt: skip


def summary(report: ChaosReport) -> str:
    """The end of the report, in words."""
    times, failed = report.recoveries, sum(bool(each.problem) for each in report.faults)
    lines = [counted(len(report.faults), "fault")]
    if times:
        lines[0] += f", recovery {times[len(times) // 2]:.2f} s (median), {times[-1]:.2f} s (longest)"
    if failed:
        lines[0] += f", {failed} not carried out or not recovered"
    lines += [
        f"{found.name} moved at {found.speed:.2f} at {found.at:.1f} s, {found.silent:.2f} s after its last command"
        for found in report.violations[:10]
    ]
    lines.append(
        "no robot moved longer than the watchdog allows"
        if not report.violations
        else f"{counted(len(report.violations), 'time')} a robot moved longer than the watchdog allows"
    )
    return "\n".join(lines)
