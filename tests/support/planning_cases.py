"""Maps at random, and kernels run compiled and plain, for the properties of planning."""

from collections.abc import Callable

import numpy as np
from hypothesis import strategies as st

from zteam.planning.jit import PLANNING

RESOLUTION = 0.1
seeds = st.integers(0, 2**32 - 1)
shares = st.floats(0.0, 0.5)


def random_cells(seed: int, share: float, size: int = 24) -> np.ndarray:
    """Occupied cells, at random."""
    rng = np.random.default_rng(seed)
    return rng.random((rng.integers(1, size), rng.integers(1, size))) < share


def both_ways(call: Callable[..., object], *outputs: np.ndarray) -> list[tuple[np.ndarray, ...]]:
    """What `call` writes to `outputs`, compiled and plain."""
    found = []
    for use in (PLANNING.use_compiled, PLANNING.use_plain):
        use()
        made = tuple(array.copy() for array in outputs)
        call(*made)
        found.append(made)
    PLANNING.use_compiled()
    return found
