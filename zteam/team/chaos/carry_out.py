"""Carries out a plan of faults on a team, and reports how it recovers, and whether robots move on without commands."""

import math
import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import msgspec

from zteam import names
from zteam.bus.lateness import LATE
from zteam.clock import HOST_FACTOR, monotonic, to_ns, to_seconds, wait_until
from zteam.config.fault import Fault
from zteam.config.numbers import counted
from zteam.errors import ZteamError, log
from zteam.messages import Odometry
from zteam.monitor.observer import LINK, RobotView, TeamObserver
from zteam.node.kinds import kind_of
from zteam.node.tokens import RETURN_GRACE
from zteam.simulator.faults import is_simulated
from zteam.team.chaos.means import Means, strike

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


Wait = tuple[Callable[[], bool], float]
"""What a fault waits for, and until which host time at the latest."""


def _course(
    fault: Fault, outcome: Outcome, watchdog: Watchdog, means: Means, say: Callable[[str], None], *, planned: bool
) -> Generator[Wait, bool, None]:
    """What happens from the beginning of a fault on to the team's recovery, up to each wait. It is sent whether the run
    ends now. `planned`: the simulator knows it already."""
    team, at, told = watchdog.team, f"{watchdog.elapsed:.1f} s", f"{fault.fault} {fault.name}"
    told += f" for {fault.seconds:g} s" if fault.lasts else ""
    in_world = planned or (means.simulate is not None and is_simulated(fault))
    before, is_robot = team.instances(fault.name), names.robot_id_of(fault.name) is not None
    has_token = (kind := kind_of(fault.name)) is not None and kind.on_bus
    # A robot's fault concerns that robot, and others that wait for it stand for good reasons.
    moving = [robot for _, robot in sorted(team.robots.items()) if robot.motion.moves]
    drove = [robot for robot in moving if robot.name == fault.name or not is_robot]
    # This process hears of it later than the simulator, whose plan counts from GO.
    late = watchdog.elapsed - fault.at if planned else 0.0
    began, end, host_end = team.now - to_ns(late), watchdog.elapsed - late + fault.lasts, monotonic() + fault.lasts
    try:
        heal = None if planned else strike(fault, means)
    except ZteamError as error:
        outcome.problem = str(error)
        say(f"{at}: not carried out: {told}: {error}")
        return
    say(f"{at}: {told}")
    is_stopped = False
    if fault.lasts:
        # Simulated time, or the host's where that is first, as when the world stands; in the world there is no other.
        is_stopped = yield lambda: watchdog.elapsed >= end, math.inf if in_world else host_end
    try:
        if heal is not None:
            heal()
    except ZteamError as error:
        # A process that was killed meanwhile.
        say(f"{fault.fault} {fault.name} could not be ended: {error}")
    end_stamp, ended_at = began + to_ns(fault.lasts) if in_world else team.now, monotonic()
    since: list[tuple[RobotView, int, int]] | None = None
    """World and time after which each of the robots must move; None until the process is back."""

    def is_over() -> bool:
        """Whether the process and the robots are back; that is noted. True also when it takes too long."""
        nonlocal since
        if is_robot and drove and (halted := drove[0].motion.halted) > began:
            outcome.stood_after = to_seconds(halted - began)
        there = team.instances(fault.name)
        if since is None and (not has_token or (there - before if fault.fault == "kill" else there)):
            # Before it was back, a robot may have moved on for the time of its watchdog.
            now = end_stamp if in_world else team.now
            since = [(robot, robot.motion.world, now) for robot in drove]
        still = [robot for robot, world, stamp in since or () if not robot.motion.moved_since(world, stamp)]
        if since is not None and not still:
            outcome.recovery = monotonic() - ended_at
            starts = [robot.motion.started for robot, world, _ in since if robot.motion.world == world]
            outcome.recovery_sim = to_seconds(max(0, max(starts) - end_stamp)) if starts else None
            return True
        texts = [f"{robot.name} ({robot.reason})" if robot.reason else robot.name for robot in still]
        outcome.last = fault.name if since is None else ", ".join(texts)
        if monotonic() - ended_at < PATIENCE:
            return False
        outcome.problem = f"not back: {outcome.last}"
        return True

    while not is_over():
        if is_stopped:
            outcome.problem = "the run ended first"
            return
        is_stopped = yield is_over, math.inf
    if not is_stopped:
        became = outcome.problem if outcome.recovery is None else f"recovered after {outcome.recovery:.2f} s"
        say(f"{fault.fault} {fault.name}: {became}")


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
    waiting, outcomes, changed = deque(plan), list[Outcome](), watchdog.team.changed
    active: dict[Generator[Wait, bool, None], Wait] = {}

    def is_due() -> bool:
        begins = bool(waiting) and watchdog.reaches(waiting[0].at)
        return stopping() or begins or any(ready() or monotonic() >= end for ready, end in active.values())

    def begin(fault: Fault, *, planned: bool) -> None:
        outcomes.append(Outcome(round(watchdog.elapsed, 3), fault.fault, fault.name, fault.lasts))
        go_on(_course(fault, outcomes[-1], watchdog, means, say, planned=planned), None)

    def go_on(course: Generator[Wait, bool, None], is_stopped: bool | None) -> None:
        active.pop(course, None)
        with suppress(StopIteration):
            active[course] = next(course) if is_stopped is None else course.send(is_stopped)

    try:
        while (waiting or active) and not stopping():
            with changed:
                ends = [max(0.0, end - monotonic()) for _, end in active.values()]
                wait_until(changed, is_due, min([_LOOK, *ends]))
            for course, (ready, end) in [*active.items()]:
                if ready() or monotonic() >= end:
                    go_on(course, False)
            while waiting and watchdog.reaches(waiting[0].at) and not stopping():
                begin(fault := waiting.popleft(), planned=planned(fault))
        # What the simulator has begun meanwhile, in a fast run.
        for fault in waiting:
            if planned(fault) and watchdog.reaches(fault.at):
                begin(fault, planned=True)
    finally:
        for course in [*active]:
            go_on(course, True)
    return ChaosReport(outcomes, list(watchdog.violations))


def carry_out_beside(
    plan: Sequence[Fault], watchdog: Watchdog, means: Means, planned: Callable[[Fault], bool]
) -> Callable[[], ChaosReport]:
    """Carry out the plan of a run in a thread. What is returned ends what is open, and reports, each time the same."""
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
"""Of the fields of an Outcome."""


def rows(report: ChaosReport) -> list[tuple[str, ...]]:
    def cell(value: str | float | None) -> str:
        return "-" if value is None else value if isinstance(value, str) else f"{value:.2f}"

    return [
        tuple(map(cell, (*msgspec.structs.astuple(each)[:-2], "" if each.problem else each.last, each.problem)))
        for each in report.faults
    ]


def summary(report: ChaosReport) -> str:
    """The end of the report, in words."""
    times, failed, moved = report.recoveries, sum(bool(each.problem) for each in report.faults), report.violations
    text = counted(len(report.faults), "fault")
    if times:
        text += f", recovery {times[len(times) // 2]:.2f} s (median), {times[-1]:.2f} s (longest)"
    if failed:
        text += f", {failed} not carried out or not recovered"
    for one in moved[:10]:
        text += f"\n{one.name} moved at {one.speed:.2f} at {one.at:.1f} s, {one.silent:.2f} s after its last command"
    subject = f"{counted(len(moved), 'time')} a robot" if moved else "no robot"
    return f"{text}\n{subject} moved longer than the watchdog allows"
