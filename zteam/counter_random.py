"""Counter-based random numbers: each depends only on its counters, not on earlier draws or the process."""

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.hashes import hash_counters

_MASK = (1 << 64) - 1
_GOLDEN = 0x9E3779B97F4A7C15
"""2^64 divided by the golden ratio, SplitMix64's increment."""
_MIX = 0xBF58476D1CE4E5B9, 0x94D049BB133111EB


def mix64(z: int) -> int:
    """SplitMix64's finaliser on 64 bits (Steele, Lea, Flood 2014, with Stafford's constants, variant 13)."""
    z &= _MASK
    z = ((z ^ (z >> 30)) * _MIX[0]) & _MASK
    z = ((z ^ (z >> 27)) * _MIX[1]) & _MASK
    return z ^ (z >> 31)


def stream(*counters: int) -> int:
    """The 64-bit number of these whole numbers, in this order."""
    state = 0
    for counter in counters:
        state = mix64((state ^ (counter & _MASK)) + _GOLDEN)
    return state


def uniform(*counters: int) -> float:
    """A number in [0, 1) from these whole numbers, in this order."""
    # The upper 53 bits fill a double's mantissa exactly.
    return (stream(*counters) >> 11) * 2.0**-53


def uniforms(states: NDArray[np.uint64], count: int) -> NDArray[np.float64]:
    """`count` numbers in [0, 1) from every state (a `stream`): (states, count)."""
    shares: NDArray[np.float64] = np.multiply(hash_counters(states, count) >> np.uint64(11), 2.0**-53, dtype=np.float64)
    return shares


def gaussians(states: NDArray[np.uint64], count: int) -> NDArray[np.float64]:
    """`count` standard normal numbers from every state: (states, count). One hash each, transformed by Box and Muller.

    The radius comes from 32 bits, so the tails end at 6.7 standard deviations.
    """
    hashes = hash_counters(states, count)
    radius = np.sqrt(-2.0 * np.log(((hashes >> np.uint64(32)) + 0.5) * 2.0**-32))
    turn = np.multiply(hashes & np.uint64(0xFFFFFFFF), 2.0 * np.pi * 2.0**-32, dtype=np.float64)
    normal: NDArray[np.float64] = np.multiply(radius, np.cos(turn), dtype=np.float64)
    return normal


def gaussian_pairs(states: NDArray[np.uint64], count: int) -> NDArray[np.float32]:
    """Both numbers of Box and Muller's pairs, (states, 2 `count`): a quarter of the time of `gaussians` for each.

    They are computed with single precision: seven digits, and tails to 6.7 standard deviations.
    """
    hashes = hash_counters(states, count)
    radius = np.sqrt(
        -2.0 * np.log(((hashes >> np.uint64(32)).astype(np.float32) + np.float32(0.5)) * np.float32(2.0**-32))
    )
    turn = (hashes & np.uint64(0xFFFFFFFF)).astype(np.float32) * np.float32(2.0 * np.pi * 2.0**-32)
    return np.concatenate((radius * np.cos(turn), radius * np.sin(turn)), axis=1)


def streams(states: NDArray[np.uint64], counter: int) -> NDArray[np.uint64]:
    """`stream(*counters, counter)` of many streams, given their states `stream(*counters)`: (states)."""
    return _mix((states ^ np.uint64(counter)) + np.uint64(_GOLDEN))


def _mix(z: NDArray[np.uint64]) -> NDArray[np.uint64]:
    z = (z ^ (z >> np.uint64(30))) * np.uint64(_MIX[0])
    z = (z ^ (z >> np.uint64(27))) * np.uint64(_MIX[1])
    return z ^ (z >> np.uint64(31))
