"""The floor of a lock-step tick, measured with real processes."""

import pytest

from studies.floor import measure_floor
from zteam.config.resources import find_world


@pytest.mark.team
def test_a_team_stands_beside_the_floor() -> None:
    """Its ratio to the exchange alone is that of their factors."""
    found = measure_floor(find_world("office"), robots=2, beams=90, seconds=2.0)
    assert 0.0 < found.rtf == pytest.approx(found.ratio * found.floor_rtf)
