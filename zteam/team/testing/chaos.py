"""`team.chaos`: faults on purpose, each of which returns when it is over and the team has recovered."""

import threading
from functools import partial

from zteam import names
from zteam.clock import monotonic, to_ns
from zteam.config.fault import Fault
from zteam.errors import UsageError
from zteam.monitor.observer import Motion
from zteam.simulator.faults import is_simulated
from zteam.team.chaos.carry_out import Outcome, Watchdog, carry_out
from zteam.team.chaos.means import Means, strike
from zteam.team.testing.watch import TeamFailure, Watch
from zteam.team.testing.world import World


class TeamChaos:
    """Each call raises TeamFailure if the team does not recover, or if a robot moves on without commands."""

    def __init__(self, watch: Watch, world: World, means: Means) -> None:
        self._watch, self._world, self._means, self._tick = watch, world, means, watch.interval
        self._watchdog = Watchdog(watch.seen, lockstep=self._tick > 0)

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
        if not self._watch.is_go:
            raise UsageError(f"team.chaos.{fault.fault}: call team.wait_for_go first: before GO no robot drives")
        if self._tick and is_simulated(fault):
            outcome = self._in_world(fault, within)
        else:
            self._watch.may_end.add(fault.name)
            ends = fault.fault == "kill" and fault.name not in self._watch.restarts
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
        world, robot_id = self._world, names.robot_id_of(fault.name)
        motion = Motion() if robot_id is None else self._watch.robot(robot_id).motion
        outcome, drove = Outcome(world.now, fault.fault, fault.name, fault.lasts), motion.moves
        strike(fault, self._means)
        ticks = -(-to_ns(fault.seconds) // self._tick)
        for k in range(1, ticks + 1):
            world.run(self._tick / 1e9)
            if drove and outcome.stood_after is None and not motion.moves:
                outcome.stood_after = k * self._tick / 1e9
        end = world.now
        if drove and outcome.stood_after is not None:
            world.until(lambda: motion.moves, within)
        outcome.recovery_sim = world.now - end
        return outcome

    def _in_lockstep(self, fault: Fault) -> Outcome:
        """It happens to the process, and the world waits for it: by the host's clock."""
        outcome = Outcome(self._world.now, fault.fault, fault.name, fault.lasts)
        instances = partial(self._watchdog.team.instances, fault.name)
        before = instances()
        heal = strike(fault, self._means)
        if fault.fault == "kill":
            ended = monotonic()
            self._watch.wait_for(lambda: not before & instances())
            if fault.name not in self._watch.restarts:
                return outcome
            self._watch.wait(lambda: bool(instances()))
            self._world.wait_for_return(fault.name)
        else:
            # Host time: the world stands still while the process does.
            end = threading.Timer(fault.seconds, heal)  # noqa: TID251
            end.start()
            # It takes as long as the fault, and goes on.
            self._world.run(fault.seconds)
            end.join()
            ended = monotonic()
            self._watch.wait_for(lambda: bool(instances()) or not before)
        outcome.recovery = monotonic() - ended
        return outcome
