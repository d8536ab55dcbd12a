"""The kernels as Python calls them. Each checks what it is given; what is wrong raises ValueError.

Arrays are numpy's, in C order. A kernel that is called in every tick takes its arrays once, as an object that is made
for it and keeps them: their contents may change, the arrays not.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.declarations import ffi

lib: Any = ffi.dlopen(str(Path(__file__).with_name("library.so")))

_POINTERS = {
    np.dtype(kind): ffi.typeof(f"{name}[]")
    for kind, name in (
        (np.bool_, "uint8_t"),
        (np.uint8, "uint8_t"),
        (np.uint16, "uint16_t"),
        (np.uint32, "uint32_t"),
        (np.int32, "int32_t"),
        (np.int64, "int64_t"),
        (np.float64, "double"),
    )
}
_BOOL, _UINT8, _UINT16, _UINT32, _INT32, _INT64, _DOUBLE = _POINTERS
Floats = NDArray[np.float64]


def _given(name: str, array: NDArray[Any], kind: np.dtype[Any], *shape: int, out: bool = False) -> Any:
    """An array's memory, for C to read, or to write to (`out`). Raises ValueError unless it has this type and shape."""
    if array.dtype != kind or array.shape != shape:
        raise ValueError(f"{name}: {array.dtype} {array.shape} is not {kind} {shape}")
    try:
        return ffi.from_buffer(_POINTERS[kind], array, out)
    except (BufferError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from None


def _within(name: str, array: NDArray[Any], low: int, high: int) -> None:
    """Raise ValueError unless all these numbers lie from `low` to below `high`: they are indexes."""
    if array.size and not (low <= array.min() and array.max() < high):
        raise ValueError(f"{name}: {array.min()} to {array.max()} is not within {low} to {high - 1}")


# squares.c, edges.c, bodies.c: the simulator

# costmaps.c: grids of costs

# search.c: ways over grids of weights

# particles.c: localisation

# safety.c: what a base meets
