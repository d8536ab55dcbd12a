"""The kernel of counter-based random numbers (hashes.c), as `binding.py` says."""

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import empty, lib, memory


def hash_counters(states: NDArray[np.uint64], count: int) -> NDArray[np.uint64]:
    """SplitMix64 outputs 1 to `count` from every state: (states, count)."""
    hashes, out = empty(np.uint64, len(states), count)
    lib.hash_counters(memory("states", states, len(states)), len(states), count, out)
    return hashes
