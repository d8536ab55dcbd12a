"""Real time beside lock-step: what may differ, and by how much."""

from typing import Any

import pytest

from studies.study.agreement import disagreements
from studies.study.one_run import Outcome


def run(**other: Any) -> Outcome:
    """A run of a line of two robots."""
    return Outcome(**{"driven": [20.0, 21.0], "gaps": {1: 0.8}, "stands": [1.0, 2.0], **other})


@pytest.mark.parametrize(
    ("real", "missed"),
    [
        (run(driven=[18.1, 22.9], gaps={1: 0.87}, safety_stops=2, stands=[5.0, 1.0]), []),
        (run(driven=[17.9, 21.0]), ["robot 0: driven 17.90 m, in lock-step 20.00 m: more than 10 % apart"]),
        (run(gaps={1: 1.41}), ["robot 1: gap 1.41 m, in lock-step 0.80 m: more than 10 % apart"]),
        (run(safety_stops=3), ["safety stops 3, in lock-step 0: more than 2 more"]),
        (run(stands=[5.1, 0.0]), ["a robot stood 5.1 s, in lock-step 2 s: more than 3 s longer"]),
        (run(contacts=1), ["contacts 1 in one run, at most 0"]),
    ],
)
def test_each_figure_has_its_bound(real: Outcome, missed: list[str]) -> None:
    """A run that is within all bounds misses none; otherwise a line names the robot and both figures."""
    assert disagreements("line", [real], [run()]) == missed


def test_the_median_is_judged_and_every_contact() -> None:
    """One run of three that differs in its way is within the bounds; one contact in one run is not."""
    assert disagreements("line", [run(), run(driven=[5.0, 5.0]), run()], [run()]) == []
    assert disagreements("line", [run(), run(), run(contacts=2)], [run()]) == ["contacts 2 in one run, at most 0"]
