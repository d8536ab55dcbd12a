"""Compiled kernels as files that run without numba: the object code, and the types that it was compiled for.

A kernel's object code has a function that takes Python's arguments. It is called directly; only numba's small libraries
of C are loaded, which that function uses.
"""

import ctypes
import hashlib
import logging
import os
import stat
from collections.abc import Callable, Mapping
from functools import cache
from importlib.machinery import ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec
import numpy as np

from zteam.compiling import kernel_cache
from zteam.compiling.object_code import ObjectCode, ObjectCodeError

log = logging.getLogger("zteam.compiling")

SUFFIX = f".{kernel_cache.DIGEST}.nbo"
"""Of files for this code, interpreter, compiler and processor: several may share a folder (NUMBA_CACHE_DIR)."""
_CHECKSUM = 32
"""Bytes at the start of a file: SHA-256 of what follows."""
_METH_VARARGS_KEYWORDS = 3


class KeptKernel(msgspec.Struct, frozen=True):
    """A file."""

    types: str
    """What it was compiled for."""
    function: str
    """Symbol of the function that takes Python's arguments."""
    environment: str
    """Symbol of a pointer that the function expects to be set."""
    code: bytes


class _MethodDef(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


_loaded: list[Any] = []
"""What must live as long as the functions."""


def types_of(argument: Any) -> str:
    """The types of arguments, as far as compiled code depends on them."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "?"
        rest = ("" if flags.aligned else " unaligned") + ("" if flags.writeable else " read-only")
        return f"{argument.dtype.str}{argument.ndim}{order}{rest}"
    if isinstance(argument, tuple):
        return f"({','.join(map(types_of, argument))})"
    for kind, name in (((bool, np.bool_), "bool"), ((int, np.integer), "int"), ((float, np.floating), "float")):
        if isinstance(argument, kind):
            return name
    return type(argument).__name__


def keep(dispatcher: Any, sample: tuple[Any, ...], name: str) -> None:
    """Write the file of a kernel that numba has compiled for the types of `sample` and keeps. Raises OSError."""
    (signature,) = dispatcher.overloads
    numbas = dispatcher._cache
    found = numbas._cache_file.load(numbas._index_key(signature, dispatcher.targetctx.codegen()))
    (_, form, data), description = found[0], found[1]
    if form != "object":
        return
    kernel = KeptKernel(types_of(sample), description.llvm_cpython_wrapper_name, description.env_name, data[0])
    path = Path(dispatcher.stats.cache_path) / f"{name}{SUFFIX}"
    unfinished = path.with_suffix(f".{os.getpid()}")
    unfinished.write_bytes(pack(kernel))
    unfinished.replace(path)


def pack(kernel: KeptKernel) -> bytes:
    """The bytes of a file."""
    body = msgspec.msgpack.encode(kernel)
    return hashlib.sha256(body).digest() + body


def load(path: Path, arguments: tuple[Any, ...]) -> Callable[..., Any] | None:
    """The kernel of this file as a function for arguments of these types; None if it cannot be had so."""
    try:
        kept = _read(path)
        if kept.types != types_of(arguments):
            raise ObjectCodeError(f"it is called with {types_of(arguments)}, and was compiled for {kept.types}")
        return _make_function(kept, path.name.removesuffix(SUFFIX))
    except Exception as error:
        # Whatever it is: numba has its own files, or compiles anew.
        log.debug("%s is loaded by numba: %s", path.name, error)
        return None


def _read(path: Path) -> KeptKernel:
    """The content of a file, which will be run. Raises OSError, ObjectCodeError or msgspec.DecodeError."""
    with path.open("rb") as file:
        status = os.fstat(file.fileno())
        if status.st_uid not in (0, os.getuid()) or status.st_mode & stat.S_IWOTH:
            raise ObjectCodeError("another user can have written it")
        data = file.read()
    body = data[_CHECKSUM:]
    if hashlib.sha256(body).digest() != data[:_CHECKSUM]:
        # Without it the set is not complete, so the next process makes it anew.
        path.unlink()
        raise ObjectCodeError("it is damaged")
    return msgspec.msgpack.decode(body, type=KeptKernel)


def _make_function(kept: KeptKernel, name: str) -> Callable[..., Any]:
    code = ObjectCode(kept.code, _find_symbol)
    environment = _environment()
    ctypes.c_void_p.from_address(code.find(kept.environment)).value = id(environment)
    definition = _MethodDef(name.encode(), code.find(kept.function), _METH_VARARGS_KEYWORDS, None)
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.py_object, ctypes.py_object]
    _loaded.append((code, definition, environment))
    function: Callable[..., Any] = make(ctypes.addressof(definition), environment, name)
    return function


def checked(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Callable[..., Any]:
    """`function` for arguments of these types alone: it raises TypeError for others."""
    expected = types_of(arguments)

    def call(*given: Any) -> Any:
        if types_of(given) != expected:
            raise TypeError(f"a kernel compiled for {expected} is called with {types_of(given)}")
        return function(*given)

    return call


def _find_symbol(name: str) -> int:
    for prefix, addresses in _helpers().items():
        if name.startswith(prefix) and name.removeprefix(prefix) in addresses:
            return addresses[name.removeprefix(prefix)]
    try:
        return ctypes.cast(getattr(_process(), name), ctypes.c_void_p).value or 0
    except AttributeError:
        raise ObjectCodeError(f"there is no {name}") from None


@cache
def _process() -> ctypes.CDLL:
    return ctypes.CDLL(None)


@cache
def _helpers() -> Mapping[str, Mapping[str, int]]:
    """The functions of numba's C libraries, by the prefix that they have in compiled code."""
    return {
        "numba_": _import_library("_helperlib").c_helpers,
        "NRT_": _import_library("core/runtime/_nrt_python").c_helpers,
    }


@cache
def _environment() -> Any:
    return _import_library("_dynfunc").Environment({})


def _import_library(name: str) -> ModuleType:
    """A library of numba's package, without the package itself. Raises ImportError."""
    numba = find_spec("numba")
    if numba is None or numba.origin is None:
        raise ImportError("numba is not installed")
    folder, _, stem = name.rpartition("/")
    path = next((Path(numba.origin).parent / folder).glob(f"{stem}.*.so"), None)
    if path is None:
        raise ImportError(f"numba has no {name}")
    # Not under numba's name: numba, if it is imported later, makes its own module of the library.
    spec = spec_from_file_location(stem, path, loader=ExtensionFileLoader(stem, str(path)))
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
