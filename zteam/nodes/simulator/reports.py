"""The answers to `sim/status` and `sim/report`, put together from the parts of the simulator."""

from typing import NamedTuple

from zteam.clock import NS_PER_S
from zteam.nodes.simulator.commands import Commands
from zteam.nodes.simulator.lockstep import LockStep
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.run_statistics import RunStatistics
from zteam.nodes.simulator.tick_profile import TickProfile
from zteam.services.simulator import MapInfo, SimReport, SimStatus
from zteam.sim import Engine
from zteam.world import World


class Reporter(NamedTuple):
    """The parts of a simulator that its status and its report tell of."""

    world: World
    map: MapInfo
    seed: int
    instance: str
    """The simulator's session id."""
    engine: Engine
    commands: Commands
    pacer: Pacer
    lockstep: LockStep | None
    statistics: RunStatistics
    profile: TickProfile

    def status(self, finished: bool) -> SimStatus:
        """The answer to `sim/status`; `finished` says whether the time of `--for` is over."""
        lockstep = self.lockstep
        return SimStatus(
            world=self.world.name,
            robots=sorted(self.engine.robots),
            interval=self.world.interval,
            seed=self.seed,
            now=self.engine.now,
            tick=self.engine.tick,
            real_time_factor=self.pacer.factor,
            speed=self.pacer.speed,
            paused=self.pacer.paused,
            lockstep=lockstep is not None,
            participants=lockstep.participants if lockstep else [],
            joining=lockstep.joining if lockstep else [],
            waiting_for=lockstep.waiting_for() if lockstep else "",
            hung=list(lockstep.hung) if lockstep else [],
            finished=finished,
            instance=self.instance,
            writers=self.commands.writers(),
            map=self.map,
        )

    def report(self, finished: bool) -> SimReport:
        """The answer to `sim/report`; `finished` says whether the time of `--for` is over."""
        lockstep, run = self.lockstep, self.statistics
        go_stamp, ticks, wall = run.go_stamp, run.ticks, run.wall_seconds
        elapsed = (ticks - 1) * self.world.interval / NS_PER_S
        return SimReport(
            sim_seconds=0.0 if go_stamp is None else max(0, self.engine.now - go_stamp) / NS_PER_S,
            seed=self.seed,
            external_commands=run.external_commands,
            finished=finished,
            robots=run.robots(),
            latency_ms=run.latency(),
            ticks=ticks,
            wall_seconds=wall,
            real_time_factor=elapsed / wall if wall > 0.0 else None,
            trajectory_sha256=run.trajectory_sha256,
            lockstep=lockstep is not None,
            resends=lockstep.resends if lockstep else 0,
            hung=list(lockstep.hung) if lockstep else [],
            timing_ms=self.profile.timing(),
            lateness_p99_ms=self.pacer.lateness_p99_ms,
        )
