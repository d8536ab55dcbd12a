"""Counter-based randomness: a number depends on its counters alone, never on what was drawn before or by whom."""

_MASK = (1 << 64) - 1
_GOLDEN = 0x9E3779B97F4A7C15
"""2^64 divided by the golden ratio, SplitMix64's increment."""


def mix64(z: int) -> int:
    """SplitMix64's finaliser on 64 bits (Steele, Lea, Flood 2014, with Stafford's constants, variant 13)."""
    z &= _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)


def uniform(*counters: int) -> float:
    """A number in [0, 1) that belongs to these whole numbers, in this order."""
    state = 0
    for counter in counters:
        state = mix64((state ^ (counter & _MASK)) + _GOLDEN)
    # The upper 53 bits fill a double's mantissa exactly.
    return (state >> 11) * 2.0**-53
