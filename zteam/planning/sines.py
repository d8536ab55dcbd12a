"""Sine and cosine with the same bits in compiled kernels and in numpy; a compiler makes vector code of them."""

import math
from typing import Any

import numpy as np

from zteam.planning.jit import compiled

_S3, _S5, _S7, _S9, _S11, _S13, _S15, _S17, _S19, _S21 = (
    (-1.0) ** (n // 2) / math.factorial(n) for n in range(3, 22, 2)
)
_C2, _C4, _C6, _C8, _C10, _C12, _C14, _C16, _C18, _C20 = (
    (-1.0) ** (n // 2) / math.factorial(n) for n in range(2, 21, 2)
)


@compiled
def cosine_sine(angle: Any) -> tuple[Any, Any]:
    """(cosine, sine) of an angle, or of an array of angles outside of compiled code.

    Taylor's series about the nearest multiple of pi: the error is below 1e-15 + 2e-16 · |angle|.
    """
    half_turns = np.rint(angle * (1.0 / math.pi))
    rest = angle - half_turns * math.pi
    sign = 1.0 - 2.0 * abs(half_turns - 2.0 * np.rint(0.5 * half_turns))
    x = rest * rest
    upper = _S11 + x * (_S13 + x * (_S15 + x * (_S17 + x * (_S19 + x * _S21))))
    sine = 1.0 + x * (_S3 + x * (_S5 + x * (_S7 + x * (_S9 + x * upper))))
    upper = _C10 + x * (_C12 + x * (_C14 + x * (_C16 + x * (_C18 + x * _C20))))
    cosine = 1.0 + x * (_C2 + x * (_C4 + x * (_C6 + x * (_C8 + x * upper))))
    return sign * cosine, sign * (rest * sine)
