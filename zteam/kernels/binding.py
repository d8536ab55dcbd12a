"""The kernels as Python calls them. Each checks what it is given; what is wrong raises ValueError or TypeError.

Arrays are numpy's, in C order. A kernel that is called in every tick takes its arrays once, as an object that is made
for it and keeps them: their contents may change, the arrays not.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    from zteam.kernels import declarations
except ImportError:
    raise ImportError("zteam's kernels are not compiled here: run pip install -e . in the checkout") from None

ffi: Any = declarations.ffi
lib: Any = ffi.dlopen(str(Path(__file__).with_name("library.so")))
# Types and functions are made now: of two threads that use one for the first time at once each would make its own, and
# cffi takes them for different ones.
for _name in ffi.list_types()[0]:
    ffi.typeof(f"{_name} *")
for _name in dir(lib):
    getattr(lib, _name)

_NAMES = {"bool": "uint8_t", "float32": "float", "float64": "double"}
_NAMES |= {name: f"{name}_t" for name in ("uint8", "uint16", "uint32", "uint64", "int32", "int64")}
_POINTERS = {np.dtype(kind): ffi.typeof(f"{name}[]") for kind, name in _NAMES.items()}
Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Cells = NDArray[np.int64]
Counts = NDArray[np.uint32]


def memory(name: str, array: NDArray[Any], *shape: int, out: bool = False) -> Any:
    """An array's memory, for C to read, or to write to (`out`). Raises ValueError unless it has this shape and numbers.

    cffi compares the array's type with that of the parameter, and raises TypeError.
    """
    if array.shape != shape:
        raise ValueError(f"{name}: {array.shape} is not {shape}")
    try:
        return ffi.from_buffer(_POINTERS[array.dtype], array, out)
    except (BufferError, KeyError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from None


def empty(kind: type[np.generic], *shape: int) -> tuple[NDArray[Any], Any]:
    """A new array for C to write to, and its memory."""
    array = np.empty(shape, kind)
    return array, ffi.from_buffer(_POINTERS[array.dtype], array, True)


def check_within(name: str, array: NDArray[Any], low: int, high: int) -> None:
    """Raise ValueError unless all these numbers lie from `low` to below `high`: they are indexes."""
    if array.size and not (low <= array.min() and array.max() < high):
        raise ValueError(f"{name}: {array.min()} to {array.max()} is not within {low} to {high - 1}")
