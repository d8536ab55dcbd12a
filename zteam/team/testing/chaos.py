"""`team.chaos`: faults on purpose, each of which returns when it is over and the team has recovered."""

import threading
from functools import partial
from typing import Any

from zteam import names
from zteam.clock import monotonic, to_ns, to_seconds
from zteam.config.fault import Fault
from zteam.errors import UsageError
from zteam.monitor.observer import Motion
from zteam.simulator.faults import is_simulated
from zteam.team.arguments import checks_arguments
from zteam.team.chaos.carry_out import Outcome, Watchdog, carry_out
from zteam.team.chaos.means import Means, strike
from zteam.team.testing.watch import TeamFailure, Watch


@checks_arguments("team.chaos.")
class TeamChaos:
    """Each call raises TeamFailure if the team does not recover, or if a robot moves on without commands."""

    def __init__(self, watch: Watch, means: Means) -> None:
        self._watch, self._means, self._tick = watch, means, watch.interval
        self._watchdog = Watchdog(watch.seen, lockstep=self._tick > 0)

    def kill(self, name: str, *, within: float = 10.0) -> Outcome:
        """End a process at once (SIGKILL). If its team file starts it again, wait until it is back."""
        return self._carry_out(within, fault="kill", name=name)

    def pause(self, name: str, seconds: float = 3.0, *, within: float = 10.0) -> Outcome:
        """Freeze a process; in lock-step leave a robot out of the ticks."""
        return self._carry_out(within, fault="pause", name=name, seconds=seconds)

    def cut(self, name: str, seconds: float = 3.0, *, within: float = 10.0) -> Outcome:
        """Let nothing pass on the link of a process; in lock-step leave a robot out of the ticks."""
        return self._carry_out(within, fault="cut", name=name, seconds=seconds)

    def slow(
        self, name: str, seconds: float = 3.0, *, delay: float = 0.5, rate: float | None = None, within: float = 10.0
    ) -> Outcome:
        """Let each message on the link of a process take `delay` seconds longer, in each direction, and let `rate`
        bytes a second pass; in lock-step a robot's commands come later."""
        return self._carry_out(within, fault="slow", name=name, seconds=seconds, delay=delay, rate=rate)

    def _carry_out(self, within: float, **fields: Any) -> Outcome:
        try:
            fault = Fault(at=0.0, **fields)
        except ValueError as error:
            raise UsageError(f"team.chaos.{fields['fault']}: {error}") from None
        if not self._watch.is_go:
            raise UsageError(f"team.chaos.{fault.fault}: call team.wait_for_go first: before GO no robot drives")
        if self._tick and is_simulated(fault):
            outcome = self._in_world(fault, within)
        elif self._tick or (fault.fault == "kill" and fault.name not in self._watch.restarts):
            outcome = self._at_host_time(fault)
        else:
            self._watch.may_end.add(fault.name)
            outcome = carry_out([fault], self._watchdog, self._means).faults[0]
            if outcome.problem:
                raise TeamFailure(f"{fault.fault} {fault.name}: {outcome.problem}")
        for found in self._watchdog.violations:
            raise TeamFailure(f"{found.name} moved on for {found.silent:.2f} s without a command, at {found.at:.1f} s")
        return outcome

    def _in_world(self, fault: Fault, within: float) -> Outcome:
        """The simulator carries it out, tick by tick: what the test sees depends on the seed alone."""
        watch, robot_id = self._watch, names.robot_id_of(fault.name)
        motion, began = Motion() if robot_id is None else watch.robot(robot_id).motion, watch.view.now
        outcome, drove = Outcome(watch.now, fault.fault, fault.name, fault.lasts), motion.moves
        strike(fault, self._means)
        watch.run(-(-to_ns(fault.seconds) // self._tick) * self._tick / 1e9)
        end = watch.now
        if drove and motion.halted > began:
            outcome.stood_after = to_seconds(motion.halted - began)
            watch.until(lambda: motion.moves, within)
        outcome.recovery_sim = watch.now - end
        return outcome

    def _at_host_time(self, fault: Fault) -> Outcome:
        """It happens to the process, and in lock-step the world waits for it: by the host's clock."""
        watch, instances = self._watch, partial(self._watchdog.team.instances, fault.name)
        watch.may_end.add(fault.name)
        outcome, before = Outcome(watch.now, fault.fault, fault.name, fault.lasts), instances()
        heal = strike(fault, self._means)
        if fault.fault == "kill":
            ended = monotonic()
            watch.wait_for(lambda: not before & instances())
            if fault.name not in watch.restarts:
                return outcome
            watch.wait(lambda: bool(instances()))
            watch.wait_for_return(fault.name)
        else:
            # Host time: the world stands still while the process does.
            end = threading.Timer(fault.seconds, heal)  # noqa: TID251
            end.start()
            # It takes as long as the fault, and goes on.
            watch.run(fault.seconds)
            end.join()
            ended = monotonic()
            watch.wait_for(lambda: bool(instances()) or not before)
        outcome.recovery = monotonic() - ended
        return outcome
