"""Runs in real time judge the team only if the machine kept up: the same rule for studies and tests."""

from collections.abc import Callable
from typing import TypeVar

from zteam.errors import ZteamError
from zteam.simulator.client import RunFigures

T = TypeVar("T")

LATE = 0.05
"""Share of a run's steps from which on it does not count."""


class TooSlowError(ZteamError):
    """Too many steps came late, also at half the speed."""


def late_share(report: RunFigures) -> float:
    """The share of its robots' steps that came late."""
    steps = report.ticks * len(report.robots)
    return sum(robot.late_steps for robot in report.robots) / max(1, steps)


def run_on_time(run: Callable[[float], T], report_of: Callable[[T], RunFigures], speed: float = 1.0) -> T:
    """The result of `run(speed)`, simulated seconds a second of the host, or else of a second run at half that speed.

    Raises TooSlowError if LATE or more of the steps of the second run came late, too.
    """
    for each in (speed, speed / 2):
        found = run(each)
        late = late_share(report_of(found))
        if late < LATE:
            return found
    raise TooSlowError(f"machine too slow: {100 * late:.0f} % of the steps came late at {each:g} x real time")
