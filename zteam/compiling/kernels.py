"""Kernels: functions that numba compiles. Until they are compiled, or where numba is missing, they run without it.

A kernel is compiled once per machine; `zteam.compiling.kernel_cache` says where the code is kept. Kernels come in sets,
such as the simulator's. Which way the kernels of a set run is one choice for the whole process: `use_plain`,
`use_compiled`, or `use_kept`, which never compiles. Without a choice the set itself says what its first call does.

Both ways compute the same numbers to the last bit: the same expressions in the same order, and no fused operations.
"""

import logging
import os
from collections.abc import Callable
from functools import cached_property, update_wrapper
from importlib.util import find_spec
from typing import Any, TypeVar, cast

from zteam.compiling import kept_kernels, kernel_cache

F = TypeVar("F", bound=Callable[..., Any])


class _Process:
    """What holds for the kernels of all sets."""

    checks = False
    """Whether the types of all arguments are checked."""
    running = False
    """Whether a kernel runs uncompiled: the kernels that it calls are compiled as parts of it."""


_process = _Process()


class KernelSet:
    """Kernels that run in the same way, and are compiled and kept together."""

    def __init__(self, name: str, *, warmup: str, log: str, title: str, on_numpy: str, unasked: bool = True) -> None:
        """`name`: the folder of the package that declares them. `warmup`: the module that compiles them all when it is
        run. `log`: the logger that is told of them; `title`: what it calls them; `on_numpy`: how it is without them.
        `unasked`: whether a kernel is compiled that is called before a way was chosen; else it runs as it is kept.
        """
        self.name, self.warmup, self.title, self.on_numpy = name, warmup, title, on_numpy
        self.log = logging.getLogger(log)
        self.kernels: list[Kernel] = []
        """All kernels of the modules imported so far."""
        self.caches = True
        """Whether compiled code is read from the cache and kept in it."""
        self.kept = False
        """Whether compiled code is run as it is kept, without numba, where that can be had."""
        self.compiles = unasked
        """Whether a kernel that is not kept is compiled; else it runs plain."""
        self._compiled: bool | None = None

    def compiled(self, function: F) -> F:
        """A kernel."""
        return cast(F, Kernel(self, function, {}))

    def vectorized(self, function: F) -> F:
        """As `compiled`, for loops that are to become vector code: the compiler may assume that numbers are finite."""
        # Not plain fastmath: that would also let it reorder sums, take reciprocals for divisions, and fuse products
        # with sums, which is no faster here and rounds differently from numpy.
        return cast(F, Kernel(self, function, {"fastmath": {"nnan", "ninf", "nsz"}}))

    def unlocked(self, function: F) -> F:
        """As `compiled`, for what runs beside the interpreter: it does not hold the interpreter's lock."""
        return cast(F, Kernel(self, function, {"nogil": True}))

    @property
    def choice(self) -> bool | None:
        """Whether kernels run compiled from their next call on; None while neither way was chosen."""
        return self._compiled

    def use_plain(self) -> None:
        """Run all kernels without numba from now on."""
        self._use(False)

    def use_compiled(self) -> None:
        """Run all kernels compiled from now on; without numba plain, with a warning."""
        self.compiles = True
        if has_numba() and self.caches and kernel_cache.is_complete(self.name) and not kernel_cache.find_obstacle():
            self.kept = True
            self._use(True)
            return
        self.kept = False
        try:
            njit()
        except ImportError as error:
            reason = f"numba cannot be imported ({error})" if has_numba() else "numba is not installed"
            self.log.warning("%s: %s (pip install numba)", reason, self.on_numpy)
            self.use_plain()
            return
        reason = kernel_cache.find_obstacle()
        if reason and self.caches:
            self.give_up_cache(reason)
        self._use(True)

    def use_kept(self) -> None:
        """Run kernels as they are kept from now on, without numba; all of them plain if the set is not complete."""
        self.compiles = False
        self.kept = kernel_cache.is_complete(self.name)
        self._use(self.kept)

    def begin(self) -> None:
        """A kernel is called, and no way was chosen."""
        if self.compiles:
            self.use_compiled()
            return
        self.use_kept()
        # This is no choice: a team in lock-step may still ask for compiled ones.
        self._compiled = None

    def give_up_cache(self, reason: str) -> None:
        """Compile in memory from now on, with a warning the first time."""
        if self.caches:
            self.warn_of_cache(reason, "compiling anew in memory")
        self.caches = self.kept = False
        for kernel in self.kernels:
            kernel.forget()
        if self._compiled:
            self._use(True)

    def warn_of_cache(self, reason: str, what_follows: str) -> None:
        """Say once what it is that keeps kernels from being kept."""
        self.log.warning(
            "going on without a cache for compiled kernels: %s; %s (free some space, or set NUMBA_CACHE_DIR)",
            reason,
            what_follows,
        )

    def _use(self, compiled: bool) -> None:
        self._compiled = compiled
        for kernel in self.kernels:
            kernel.use(compiled)


class Kernel:
    """A function of arrays and numbers that runs compiled or plain; the change takes effect with its next call.

    All its calls must have arguments of the same types, and the same order of arrays in memory.
    """

    def __init__(self, owner: KernelSet, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.owner = owner
        self.name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self.plain = function
        """What runs where nothing is compiled."""
        self.sample: tuple[Any, ...] | None = None
        """Arguments of the last call from outside of kernels that ran plain: their types are what to compile for."""
        self._function = function
        self._kept: Callable[..., Any] | None = None
        self._options = options
        self._run: Callable[..., Any] = self._run_first
        if owner.choice is not None:
            self.use(owner.choice)
        owner.kernels.append(self)

    def __call__(self, *args: Any) -> Any:
        try:
            return self._run(*args)
        except OSError as error:
            # Only numba's cache touches files, and it does so before anything is computed.
            self.owner.give_up_cache(str(error))
            return self._run(*args)

    def use(self, compiled: bool) -> None:
        """Run compiled, or plain, from the next call on."""
        self._run = self._run_plain if not compiled else self._run_kept if self.owner.kept else self.dispatcher

    @cached_property
    def dispatcher(self) -> Any:
        """The function as numba's, which compiles it, or loads it from the cache, at the first call."""
        # Division by zero must give inf as in numpy, not raise: kernels guard against it by value.
        return njit()(cache=self.owner.caches, error_model="numpy", **self._options)(self._function)

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
        path = None
        if self._kept is None:
            path = kernel_cache.find_kept(self.owner.name, self.name + kept_kernels.SUFFIX)
        if path is not None:
            self._kept = kept_kernels.load(path, args)
        return self._kept is not None

    def forget(self) -> None:
        """Drop what was compiled."""
        self.__dict__.pop("dispatcher", None)

    def _run_first(self, *args: Any) -> Any:
        self.owner.begin()
        return self._run(*args)

    def _run_kept(self, *args: Any) -> Any:
        self._run = (self.load(args) and self._kept) or self._not_kept
        if _process.checks and self._run is self._kept:
            self._run = kept_kernels.checked(self._run, args)
        return self._run(*args)

    @property
    def _not_kept(self) -> Callable[..., Any]:
        return self.dispatcher if self.owner.compiles else self._run_plain

    def _run_plain(self, *args: Any) -> Any:
        if _process.running:
            return self.plain(*args)
        self.sample = args
        _process.running = True
        try:
            return self.plain(*args)
        finally:
            _process.running = False


def njit() -> Callable[..., Any]:
    """numba's decorator, which keeps code in our folder. Raises ImportError."""
    if kernel_cache.FOLDER is not None:
        os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_cache.FOLDER))
    from numba import config, njit

    # If numba was imported before, its settings are fixed; without this the code would lie in the package's folder.
    settings: Any = config  # it fills its names from the environment, which a type checker does not see
    settings.CACHE_DIR = settings.CACHE_DIR or str(kernel_cache.FOLDER or "")
    return njit


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


def check_types() -> None:
    """Raise TypeError when a kernel is called with other types than at first. It costs time: use it in tests.

    A compiled kernel that is kept trusts its callers.
    """
    _process.checks = True
