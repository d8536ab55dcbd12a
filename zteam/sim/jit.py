"""Kernels: functions that numba compiles. Until they are compiled, or where numba is missing, they run without it.

A kernel is compiled once per machine; `zteam.sim.kernel_cache` says where the code is kept. Which way kernels run is
one choice for the whole process: `use_plain` or `use_compiled`. Without a choice the first call of a kernel compiles.

Both ways compute the same numbers to the last bit: the same expressions in the same order, and no fused operations.
"""

import logging
import os
from collections.abc import Callable
from functools import cached_property, update_wrapper
from importlib.util import find_spec
from typing import Any, TypeVar, cast

from zteam.sim import kept_kernels, kernel_cache

log = logging.getLogger("zteam.sim")

F = TypeVar("F", bound=Callable[..., Any])

KERNELS: list["Kernel"] = []
"""All kernels of the modules imported so far."""


class _Choice:
    """How the kernels of this process run."""

    compiled: bool | None = None
    """None until it is chosen."""
    caches = True
    """Whether compiled code is read from the cache and kept in it."""
    kept = False
    """Whether compiled code is run as it is kept, without numba, where that can be had."""
    checks = False
    """Whether the types of all arguments are checked."""
    running = False
    """Whether a kernel runs uncompiled: the kernels that it calls are compiled as parts of it."""


_choice = _Choice()


class Kernel:
    """A function of arrays and numbers that runs compiled or plain; the change takes effect with its next call.

    All its calls must have arguments of the same types, and the same order of arrays in memory.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self.plain = function
        """What runs where nothing is compiled."""
        self.sample: tuple[Any, ...] | None = None
        """Arguments of the last call from outside of kernels that ran plain: their types are what to compile for."""
        self._function = function
        self._kept: Callable[..., Any] | None = None
        self._options = options
        self._run: Callable[..., Any] = self._run_first
        if _choice.compiled is not None:
            self.use(_choice.compiled)
        KERNELS.append(self)

    def __call__(self, *args: Any) -> Any:
        try:
            return self._run(*args)
        except OSError as error:
            # Only numba's cache touches files, and it does so before anything is computed.
            give_up_cache(str(error))
            return self._run(*args)

    def use(self, compiled: bool) -> None:
        """Run compiled, or plain, from the next call on."""
        self._run = self._run_plain if not compiled else self._run_kept if _choice.kept else self.dispatcher

    @cached_property
    def dispatcher(self) -> Any:
        """The function as numba's, which compiles it, or loads it from the cache, at the first call."""
        # Division by zero must give inf as in numpy, not raise: kernels guard against it by value.
        return _njit()(cache=_choice.caches, error_model="numpy", **self._options)(self._function)

    @property
    def _numba_type_(self) -> Any:
        """For numba, which meets this object where one kernel calls another."""
        return self.dispatcher._numba_type_

    def compile(self) -> None:
        """Compile for the types of `sample`, or load that from the cache. Raises OSError if it cannot be kept."""
        from numba import typeof

        assert self.sample is not None
        self.dispatcher.compile(tuple(typeof(arg) for arg in self.sample))  # type: ignore[no-untyped-call]

    def keep(self) -> None:
        """Write what was compiled so that it runs without numba. Raises OSError."""
        assert self.sample is not None
        kept_kernels.keep(self.dispatcher, self.sample, self.name)

    def load(self, args: tuple[Any, ...]) -> bool:
        """Load what is kept; return whether there is something for arguments of these types."""
        path = kernel_cache.find_kept(self.name + kept_kernels.SUFFIX) if self._kept is None else None
        if path is not None:
            self._kept = kept_kernels.load(path, args)
        return self._kept is not None

    def forget(self) -> None:
        """Drop what was compiled."""
        self.__dict__.pop("dispatcher", None)

    def _run_first(self, *args: Any) -> Any:
        use_compiled()
        return self._run(*args)

    def _run_kept(self, *args: Any) -> Any:
        self._run = (self.load(args) and self._kept) or self.dispatcher
        if _choice.checks and self._run is self._kept:
            self._run = kept_kernels.checked(self._run, args)
        return self._run(*args)

    def _run_plain(self, *args: Any) -> Any:
        if _choice.running:
            return self.plain(*args)
        self.sample = args
        _choice.running = True
        try:
            return self.plain(*args)
        finally:
            _choice.running = False


def _njit() -> Callable[..., Any]:
    if kernel_cache.FOLDER is not None:
        os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_cache.FOLDER))
    from numba import config, njit

    # If numba was imported before, its settings are fixed; without this the code would lie in the package's folder.
    settings: Any = config  # it fills its names from the environment, which a type checker does not see
    settings.CACHE_DIR = settings.CACHE_DIR or str(kernel_cache.FOLDER or "")
    return njit


def compiled(function: F) -> F:
    """A kernel."""
    return cast(F, Kernel(function, {}))


def vectorized(function: F) -> F:
    """As `compiled`, for loops that are to become vector code: the compiler may assume that all numbers are finite."""
    # Not plain fastmath: that would also let it reorder sums, take reciprocals for divisions, and fuse products with
    # sums, which is no faster here and rounds differently from numpy.
    return cast(F, Kernel(function, {"fastmath": {"nnan", "ninf", "nsz"}}))


def unlocked(function: F) -> F:
    """As `compiled`, for what runs beside the interpreter: it does not hold the interpreter's lock."""
    return cast(F, Kernel(function, {"nogil": True}))


class External:
    """A function of the C library for compiled kernels: it takes an address and returns an int."""

    def __init__(self, symbol: str) -> None:
        self._symbol = symbol

    def __call__(self, address: Any) -> int:
        """Only compiled code calls it."""
        raise NotImplementedError(self._symbol)

    @property
    def _numba_type_(self) -> Any:
        from numba import types

        return types.ExternalFunction(self._symbol, types.int32(types.uintp))


def plainly(substitute: F) -> Callable[[F], F]:
    """Decorates a kernel: `substitute` (on numpy) runs where nothing is compiled, instead of the kernel's own loops."""

    def decorate(kernel: F) -> F:
        cast(Kernel, kernel).plain = substitute
        return kernel

    return decorate


def has_numba() -> bool:
    """Whether there is a compiler."""
    return find_spec("numba") is not None


def is_chosen() -> bool:
    """Whether `use_plain` or `use_compiled` was called, if only by a kernel's first call."""
    return _choice.compiled is not None


def is_compiled() -> bool:
    """Whether kernels run compiled from their next call on."""
    return bool(_choice.compiled)


def use_plain() -> None:
    """Run all kernels without numba from now on."""
    _use(False)


def use_compiled() -> None:
    """Run all kernels compiled from now on; without numba plain, with a warning."""
    if has_numba() and _choice.caches and kernel_cache.is_complete() and not kernel_cache.find_obstacle():
        _choice.kept = True
        _use(True)
        return
    _choice.kept = False
    try:
        _njit()
    except ImportError as error:
        reason = f"numba cannot be imported ({error})" if has_numba() else "numba is not installed"
        log.warning("%s: lasers run on numpy, 10 to 100 times slower (pip install numba)", reason)
        use_plain()
        return
    reason = kernel_cache.find_obstacle()
    if reason and _choice.caches:
        give_up_cache(reason)
    _use(True)


def check_types() -> None:
    """Raise TypeError when a kernel is called with other types than at first. It costs time: use it in tests.

    A compiled kernel that is kept trusts its callers.
    """
    _choice.checks = True


def give_up_cache(reason: str) -> None:
    """Compile in memory from now on, with a warning the first time."""
    if _choice.caches:
        warn_of_cache(reason, "compiling anew in memory")
    _choice.caches = _choice.kept = False
    for kernel in KERNELS:
        kernel.forget()
    if _choice.compiled:
        _use(True)


def warn_of_cache(reason: str, what_follows: str) -> None:
    """Say once what it is that keeps kernels from being kept."""
    log.warning(
        "going on without a cache for compiled kernels: %s; %s (free some space, or set NUMBA_CACHE_DIR)",
        reason,
        what_follows,
    )


def _use(compiled: bool) -> None:
    _choice.compiled = compiled
    for kernel in KERNELS:
        kernel.use(compiled)
