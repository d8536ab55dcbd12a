"""numba, where it is installed: a cache place that is chosen on purpose, and whether compiling lies ahead.

Kernels are compiled once per machine. The cache lies in the user's cache folder, never in the package's own folder:
that may be read-only, and an uninstalled package should leave nothing in it.
"""

import logging
import os
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

log = logging.getLogger("zteam.sim")

F = TypeVar("F", bound=Callable[..., Any])


def _writable_folder() -> Path:
    cache_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    wanted = cache_home / "zteam" / "numba"
    try:
        for folder in (wanted, Path(tempfile.gettempdir()) / f"zteam-numba-{os.getuid()}"):
            if _is_writable(folder):
                return folder
        return Path(tempfile.mkdtemp(prefix="zteam-numba-"))
    except OSError:
        # No folder for temporary files either: every disk is full. What cannot be kept is told where it is kept.
        return wanted


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def _find_jit() -> Callable[..., Any] | None:
    os.environ.setdefault("NUMBA_CACHE_DIR", str(_writable_folder()))
    try:
        from numba import config, njit
    except ImportError:
        log.warning("numba is not installed: lasers run on numpy, 10 to 100 times slower (pip install numba)")
        return None
    # Whoever imported numba before has fixed its settings; without this the code would lie in the package's folder.
    settings: Any = config  # it fills its names from the environment, which a type checker does not see
    settings.CACHE_DIR = settings.CACHE_DIR or os.environ["NUMBA_CACHE_DIR"]
    return njit


JIT = _find_jit()
"""numba's njit, or None."""


def _compile(function: F, **options: Any) -> F:
    """The function compiled by numba and, where there is room, kept in the cache; itself where numba is missing."""
    if JIT is None:
        return function
    try:
        dispatcher = JIT(cache=True, error_model="numpy", **options)(function)
    except (RuntimeError, OSError) as error:
        # numba finds no folder that it may write to.
        _tell_uncached(str(error))
        return JIT(error_model="numpy", **options)(function)  # type: ignore[no-any-return]
    # numba has no option for this: a full disk would end the simulator just after it has compiled.
    dispatcher._cache.save_overload = partial(_save, dispatcher._cache.save_overload)
    return dispatcher  # type: ignore[no-any-return]


def _save(save: Callable[..., None], *arguments: Any) -> None:
    try:
        save(*arguments)
    except OSError as error:
        _tell_uncached(f"{os.environ['NUMBA_CACHE_DIR']}: {error.strerror or error}")


@cache
def _tell_uncached(reason: str) -> None:
    """Once for each reason, not for every kernel."""
    log.warning("%s: going on without a cache: the kernels are compiled anew at each start", reason)


def compiled(function: F) -> F:
    """The function compiled by numba and kept in the cache; itself where numba is missing."""
    # Division by zero must give inf as in numpy (the error model), not raise: kernels guard against it by value.
    return _compile(function)


def vectorized(function: F) -> F:
    """As `compiled`, for loops that are to become vector code: the compiler may assume that all numbers are finite."""
    # Not plain fastmath: that would also let it reorder sums and take reciprocals for divisions.
    return _compile(function, fastmath={"contract", "nnan", "ninf", "nsz"})


def is_cached(source: Path) -> bool:
    """Whether kernels of that module have been compiled on this machine since it was last changed."""
    if JIT is None:
        return True
    indexes = Path(os.environ["NUMBA_CACHE_DIR"]).glob(f"*/{source.stem}.*.nbi")
    return any(index.stat().st_mtime >= source.stat().st_mtime for index in indexes)
