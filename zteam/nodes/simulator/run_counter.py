"""From GO to the end of `--for` or `--until`: from which tick on a run is counted, and when its time is over."""

from zteam.clock import NS_PER_S
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.run_statistics import RunStatistics
from zteam.nodes.simulator.team_outputs import TeamOutputs
from zteam.nodes.simulator.tick_profile import TickProfile
from zteam.sim import Engine


class RunCounter:
    """Feeds the statistics with each tick since GO. The main loop calls `count`; a bus thread may call `take_go`."""

    def __init__(
        self,
        engine: Engine,
        outputs: TeamOutputs,
        statistics: RunStatistics,
        profile: TickProfile,
        pacer: Pacer,
        run_for: float | None,
        until: int | None = None,
    ) -> None:
        """The run is over `run_for` simulated seconds after GO, or before tick `until`; None = it has no such end."""
        self._engine, self._outputs, self._statistics = engine, outputs, statistics
        self._profile, self._pacer = profile, pacer
        self._run_for, self._until = run_for, until
        self._go: int | None = None
        """Simulated time (ns) from which GO holds; None before GO."""

    @property
    def is_counting(self) -> bool:
        """Whether a tick was counted since the start or the last reset."""
        return self._statistics.go_stamp is not None

    def take_go(self, stamp: int) -> None:
        """GO holds from simulated time `stamp` (ns) on, but not from later than now. Only the first GO counts."""
        if self._go is None:
            # A stamp beyond this simulator's time belongs to an earlier simulator: GO then holds from now on.
            self._go = min(stamp, self._engine.now)

    def count(self) -> bool:
        """Count the engine's tick if GO was given; whether the time of the run is over with it."""
        engine = self._engine
        is_last = self._until is not None and engine.tick + 1 >= self._until
        if self._go is None:
            return is_last
        ids, poses, stalled = engine.standing()
        if not self.is_counting:
            self._statistics.start(self._go, engine.tick, ids, poses)
            self._profile.start()
            self._pacer.start_anew()
        self._statistics.add_tick(ids, poses, stalled, self._outputs.scan_counts)
        return is_last or (self._run_for is not None and engine.now - self._go >= self._run_for * NS_PER_S)

    def start_anew(self) -> None:
        """The world is as at its start, where GO, if it was given, holds from the first tick on."""
        self._statistics.start_anew()
        if self._go is not None:
            self._go = self._engine.world.interval
