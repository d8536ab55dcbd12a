"""Which values of a behaviour's parameters are tried, and which it cannot do without."""

from typing import Annotated

import msgspec
import pytest
from msgspec import Meta

from zteam.behaviors import Behavior
from zteam.robot.behaviors.follow import Follow
from zteam.robot.trials.situations import bounds, given_params


class Bounded(Behavior):
    """It has parameters of all kinds."""

    class Params(msgspec.Struct):
        """Its parameters."""

        closed: Annotated[float, Meta(ge=-1.0, le=20.0)] = 0.0
        opened: Annotated[float, Meta(gt=0.0, lt=20.0)] = 1.0
        whole: Annotated[int, Meta(gt=0, le=9)] = 1
        switch: bool = False
        free: float = 3.0
        name: Annotated[str, Meta(min_length=1)] = "x"


def test_bounds_of_numbers_and_both_values_of_switches() -> None:
    """A bound that does not belong to the allowed values is tried just inside; what has no bound is left alone."""
    found = [*bounds(Bounded)]
    assert found == [
        ("closed", -1.0),
        ("closed", 20.0),
        ("opened", pytest.approx(0.001)),
        ("opened", pytest.approx(19.98)),
        ("whole", 1),
        ("whole", 9),
        ("switch", False),
        ("switch", True),
    ]
    # Every one is allowed.
    for name, value in found:
        msgspec.convert({name: value}, Bounded.Params)


def test_the_leader_is_given_unless_it_is_named() -> None:
    """A follower is tried behind the other robot of the trials, or behind the one that the author names."""
    assert given_params("follow", Follow, {}) == {"leader": 0}
    assert given_params("follow", Follow, {"leader": 2}) == {"leader": 2}
