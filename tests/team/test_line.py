"""Teams of real processes drive."""

import numpy as np
import pytest

from studies.chains.figures import Chain, measure_tour
from zteam.config.resources import find_world

pytestmark = pytest.mark.team


def test_a_line_drives_where_its_leader_drove() -> None:
    """Five robots on a tour of 37 m through the office, at 0.5 m/s: no contact, no robot cuts a corner, gaps hold.

    The last robot is as good as the first follower. the study `robots` measures all tours.
    """
    samples = measure_tour(find_world("office"), Chain(5, "trail", 0.5), in_process=True, number=2)
    assert (samples.wall_hits, samples.touches, samples.arrived) == (0, 0, True)
    off = [float(np.quantile(each, 0.9)) for each in samples.deviations]
    rms = [float(np.sqrt(np.mean((np.array(each) - 0.8) ** 2))) for each in samples.gaps]
    assert max(off) <= 0.01
    assert max(rms) <= 0.015
    assert rms[-1] <= rms[0]
