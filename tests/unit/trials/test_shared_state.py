"""What the objects of a class share."""

from functools import lru_cache

import numpy as np

from zteam.behaviors import Behavior
from zteam.trials import shared_state

GRID = np.zeros(3)
RANDOM = np.random.default_rng(1)


class Base(Behavior):
    """A class between."""

    seen: list[int] = []  # noqa: RUF012 - the mistake that is looked for


class Mine(Base):
    """Its attributes, those of the class between, and the globals of this module are shared."""

    count = 0

    def __init__(self) -> None:
        super().__init__(None)
        self.own = 0


@lru_cache
def _double(x: int) -> int:
    return 2 * x


def test_what_changed_is_named() -> None:
    """Attributes by class and name, also new ones, and globals; what an object keeps, caches and chance are not."""
    before = shared_state.look(Mine)
    assert not shared_state.changed(before, shared_state.look(Mine))
    mine = Mine()
    mine.own += _double(1)
    RANDOM.random()
    assert not shared_state.changed(before, shared_state.look(Mine))
    Mine.count += 1
    Mine.seen.append(3)
    GRID[0] = 1.0
    Mine.late = True  # type: ignore[attr-defined]
    try:
        assert {*shared_state.changed(before, shared_state.look(Mine))} == {
            "Mine.count",
            "Base.seen",
            "GRID",
            "Mine.late",
        }
    finally:
        Mine.count, Mine.seen[:], GRID[0] = 0, [], 0.0
        del Mine.late  # type: ignore[attr-defined]
