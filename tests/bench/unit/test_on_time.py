"""The rule for runs in real time on a machine that may be too slow."""

import pytest

from studies.on_time import TooSlowError, run_on_time
from zteam.simulator.client import Latency, RobotReport, RunFigures


def figures(late_steps: int) -> RunFigures:
    """A run of two robots and 100 ticks, with so many late steps of each."""
    robots = [RobotReport(i, None, (0.0, 0.0, 0.0), 1.0, 0, None, 100, late_steps) for i in range(2)]
    return RunFigures(
        sim_seconds=10.0, seed=1, external_commands=0, robots=robots, latency_ms=Latency(1, 1, 1), ticks=100
    )


@pytest.mark.parametrize(
    ("late", "speeds", "result"),
    [
        ({4.0: 4}, [4.0], 4),
        ({4.0: 5, 2.0: 1}, [4.0, 2.0], 1),
        ({4.0: 50, 2.0: 5}, [4.0, 2.0], None),
    ],
)
def test_a_run_with_late_steps_is_repeated_at_half_the_speed(
    late: dict[float, int], speeds: list[float], result: int | None
) -> None:
    """A run with 5 % late steps does not count: the second one, at half the speed, does or fails."""
    tried = []

    def run(speed: float) -> int:
        tried.append(speed)
        return late[speed]

    if result is None:
        with pytest.raises(TooSlowError, match=r"machine too slow: 5 % of the steps came late at 2 x real time"):
            run_on_time(run, figures, 4.0)
    else:
        assert run_on_time(run, figures, 4.0) == result
    assert tried == speeds
