"""The C library's heap of a warm parent, which its children inherit."""

import ctypes
from functools import cache
from typing import Any

_SIZES = (*range(1 << 16, 1 << 12, -(1 << 12)), *range(1 << 12, 0, -16))
"""Bytes: the greatest gaps first."""


class _MallInfo(ctypes.Structure):
    """`struct mallinfo2`: see mallinfo(3)."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    ]


def fill_gaps() -> None:
    """Take all gaps of the heap and keep them, so that a fork allocates side by side, on pages of its own.

    Imports leave some hundred gaps. To write a few bytes into one of them, a child would copy a whole page. Without
    glibc 2.33 nothing is done.
    """
    library = _load_library()
    if library is None:
        return
    # Behind it the heap grows: what comes from there was no gap.
    end = library.sbrk(0) - library.mallinfo2().keepcost
    for size in _SIZES:
        while (place := library.malloc(size)) and place < end:
            pass
        library.free(place)


def free_below_end() -> int | None:
    """Bytes in the gaps; None without glibc 2.33."""
    library = _load_library()
    if library is None:
        return None
    info = library.mallinfo2()
    return int(info.fordblks - info.keepcost)


@cache
def _load_library() -> Any:
    """malloc and what tells where its heap ends; None where it does not."""
    library = ctypes.CDLL(None)
    try:
        library.mallinfo2.restype = _MallInfo
        library.malloc.restype = library.sbrk.restype = ctypes.c_void_p
    except AttributeError:
        return None
    library.malloc.argtypes, library.sbrk.argtypes = [ctypes.c_size_t], [ctypes.c_ssize_t]
    library.free.argtypes = [ctypes.c_void_p]
    return library
