"""What is said about the clocks of hosts."""

import pytest

from support.team_facts import team_facts
from zteam.monitor.doctor.checks import check_clocks, check_team
from zteam.monitor.doctor.facts import HostClock


@pytest.mark.parametrize(
    ("ahead", "error", "level", "told"),
    [
        (1.0, 0.002, "note", "1.00 s ahead of this host's (within 2.0 ms): only their logs do not fit together"),
        (-1.0, 0.002, "note", "1.00 s behind this host's (within 2.0 ms): only their logs do not fit together"),
        (-3.0, 0.002, "problem", "3.00 s behind this host's (within 2.0 ms): commands may count as late"),
    ],
)
def test_a_clock_that_differs_is_told(ahead: float, error: float, level: str, told: str) -> None:
    """A second does no harm; more may."""
    (finding,) = check_clocks(team_facts(clocks={"lab": HostClock(ahead, error)}))
    assert (finding.what, finding.level) == ("clocks", level)
    assert finding.text == f"the clock of lab is {told}"


@pytest.mark.parametrize(("ahead", "error"), [(0.2, 0.0), (-0.2, 0.0), (1.0, 0.9)])
def test_a_clock_that_may_agree_is_not_told(ahead: float, error: float) -> None:
    """A slow answer leaves it open how far the clocks are apart."""
    found = check_team(team_facts(clocks={"lab": HostClock(ahead, error)}))
    assert "clocks" not in [finding.what for finding in found]
