"""The same test of driving in lock-step and in real time, as processes, as users run their teams."""

from typing import Any

import pytest
from msgspec import structs

from studies.on_time import run_on_time
from zteam.simulator.client import SimReport
from zteam.team.launch.plan import Pace, TeamLaunch
from zteam.team.run.team_run import RunState
from zteam.team.testing.team import TeamFixture

REAL_TIME = pytest.param("real time", marks=[pytest.mark.real_time, pytest.mark.ci])
BOTH_PACES = pytest.mark.parametrize("team", ["lock-step", REAL_TIME], indirect=True)
"""The test's fixture `team` in lock-step, and again as a RealTimeTeam."""


class RealTimeTeam(TeamFixture):
    """Runs whatever the test starts as processes in real time, `speed` simulated seconds a second of the host."""

    speed = 1.0

    def _launch(self, launch: TeamLaunch, nodes: Any, in_process: bool, chaos: bool) -> None:
        super()._launch(structs.replace(launch, pace=Pace(f"{self.speed:g}")), nodes, False, chaos)

    def run_test(self, item: pytest.Function) -> bool:
        """Call the test, and again at half the speed if its steps came late; then fail if they come late again."""

        def run(speed: float) -> tuple[Exception | None, SimReport]:
            if speed != self.speed:
                self.close()
                super(RealTimeTeam, self).__init__()
                self.speed = speed
            failure = None
            try:
                item.obj(**{name: item.funcargs[name] for name in item._fixtureinfo.argnames})
                self.check_at_end()
            except Exception as error:
                if self._run.state is RunState.NEW:
                    # There is no run to judge.
                    raise
                failure = error
            return failure, self.report

        failure, _ = run_on_time(run, lambda found: found[1], self.speed)
        if failure is not None:
            raise failure
        return True
