"""Where compiled kernels are kept, and whether all of them are there.

The folder is the user's cache folder, never the package's own: that may be read-only, and an uninstalled package should
leave nothing in it. Nothing here imports numba, which takes a third of a second: a process that finds an empty cache
starts without it.
"""

import fcntl
import hashlib
import os
import platform
import shutil
import sys
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path

_FORMAT = "numba's files and .nbo 2"
"""What is kept of a kernel."""
_PACKAGES = ("behaviors", "planning", "sim")
"""The packages that hold kernels, below zteam: a set of kernels each. They share a folder."""
_MARKS = [f"from zteam.{name}.jit import".encode() for name in _PACKAGES]
"""What stands in a module that declares kernels."""
_VERSIONS = {"numba": "_version.py", "llvmlite": "_version.py", "numpy": "version.py"}
"""The packages that compiled code depends on, and the file in which each notes its version."""


def _processor() -> str:
    """What numba compiles for: the processor at hand."""
    try:
        lines = Path("/proc/cpuinfo").read_text().partition("\n\n")[0].splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return "\n".join(line for line in lines if line.startswith(("model name", "flags", "Features", "CPU ")))


def _read_beside(package: str, file: str) -> bytes:
    """A file of an installed package, which is not imported; empty if there is none."""
    # importlib.metadata would take a hundredth of a second to tell the version.
    found = find_spec(package)
    try:
        return b"" if found is None or not found.origin else (Path(found.origin).parent / file).read_bytes()
    except OSError:
        return b""


def _make_digest() -> str:
    """Of everything that compiled kernels depend on: the code of all of them, interpreter, compiler, processor."""
    digest = hashlib.sha256()
    for source in sorted(path for name in _PACKAGES for path in (Path(__file__).parents[1] / name).glob("*.py")):
        text = source.read_bytes()
        # The modules that hold kernels, whether they have been imported yet or not.
        if any(mark in text for mark in _MARKS):
            digest.update(f"{source}\n".encode() + text)
    for package, file in _VERSIONS.items():
        digest.update(f"{package}\n".encode() + _read_beside(package, file))
    chosen = "".join(f"{name}={value}\n" for name, value in sorted(os.environ.items()) if name.startswith("NUMBA_CPU"))
    digest.update(f"{_FORMAT}\n{sys.version}\n{chosen}{_processor()}".encode())
    return digest.hexdigest()[:16]


DIGEST = _make_digest()
_KEPT = 16
"""Versions of the code whose kernels stay in the user's cache folder."""


def _choose_folder() -> Path | None:
    """NUMBA_CACHE_DIR whatever it is; else the first of the user's own folders that can be written, if any."""
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(given)
    cache_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    # A folder for each version of the code: numba looks at the module of a kernel alone, not at what that kernel calls.
    kept = cache_home / "zteam" / "numba" / DIGEST
    if not _obstacle(kept):
        return kept
    try:
        temporary = Path(tempfile.gettempdir()) / f"zteam-numba-{os.getuid()}"
    except OSError:
        # Python finds no folder that takes a few bytes: every disk is full.
        return None
    # What lies in the cache is run: in a folder for all users it must be this user's.
    return temporary if not _obstacle(temporary) and temporary.stat().st_uid == os.getuid() else None


def _obstacle(folder: Path) -> str:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return f"{folder}: {error.strerror}"
    return ""


FOLDER = _choose_folder()
"""None if there is no folder to write to."""


def find_obstacle() -> str:
    """Why files cannot be made in the folder; empty if they can."""
    return _obstacle(FOLDER) if FOLDER is not None else "neither the cache folder nor the temporary one can be written"


def _marker(kernels: str) -> Path | None:
    """The file that says that this set of kernels, for this interpreter, compiler and processor, is kept as a whole."""
    return None if FOLDER is None else FOLDER / f"complete-{kernels}-{DIGEST}"


def is_complete(kernels: str) -> bool:
    """Whether all kernels of this set are kept: none will have to be compiled."""
    marker = _marker(kernels)
    try:
        return marker is not None and all((marker.parent / name).exists() for name in marker.read_text().splitlines())
    except OSError:
        return False


def find_kept(kernels: str, name: str) -> Path | None:
    """The file of this kernel that runs without numba, if all kernels of its set have been kept."""
    marker = _marker(kernels)
    try:
        return None if marker is None else _kept_files(marker, marker.stat().st_mtime_ns).get(name)
    except OSError:
        return None


@cache
def _kept_files(marker: Path, _changed: int) -> dict[str, Path]:
    """The files that the marker names, by their own names. Read once: a process begins with twenty questions."""
    return {Path(line).name: marker.parent / line for line in marker.read_text().splitlines()}


def try_lock(kernels: str) -> int | None:
    """Take the lock of processes that compile this set: its descriptor, None if it is held. Raises OSError.

    The lock is held as long as a process has the descriptor, or inherited it.
    """
    assert FOLDER is not None
    lock = os.open(FOLDER / f"compiling-{kernels}-{DIGEST}", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        return None
    return lock


def mark_complete(kernels: str, folder: Path) -> None:
    """Note that all kernels of this set are kept, in this subfolder. Raises OSError."""
    marker = _marker(kernels)
    assert marker is not None
    names = [f"{path.relative_to(marker.parent)}\n" for path in sorted(folder.glob("*.nb[cio]"))]
    # Others may start at this moment: they must not see half of it.
    unfinished = marker.with_suffix(f".{os.getpid()}")
    unfinished.write_text("".join(names))
    unfinished.replace(marker)
    if marker.parent.name == DIGEST:
        _forget_old_versions(marker.parent.parent)


def _forget_old_versions(cache: Path) -> None:
    """Keep the folders of the newest _KEPT versions of the code."""
    versions = sorted((path for path in cache.iterdir() if path.is_dir()), key=lambda path: path.stat().st_mtime)
    for old in versions[:-_KEPT]:
        shutil.rmtree(old, ignore_errors=True)
