"""Maps at random, for the properties of planning."""

import numpy as np
from hypothesis import strategies as st

RESOLUTION = 0.1
seeds = st.integers(0, 2**32 - 1)
shares = st.floats(0.0, 0.5)


def random_cells(seed: int, share: float, size: int = 24) -> np.ndarray:
    """Occupied cells, at random."""
    rng = np.random.default_rng(seed)
    return rng.random((rng.integers(1, size), rng.integers(1, size))) < share
