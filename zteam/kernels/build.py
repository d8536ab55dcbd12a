"""Hatchling's build hook: it compiles the kernels once, when zteam is installed.

It takes the system's C compiler (`cc`, or what CC names) where that works. Else pip fetches zig's for the build alone.
`CC=aarch64-linux-gnu-gcc python zteam/kernels/build.py OUT [FLAG …]` compiles the library alone, for any system.
"""

from __future__ import annotations  # An older Python can import it: then pip says which one zteam needs.

import hashlib
import os
import shlex
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from cffi import FFI
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

HERE = Path(__file__).parent
SOURCES = sorted(HERE.glob("*.c"))
FLAGS = ("-std=c11", "-O3", "-fPIC", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
"""The same bits from every compiler: no fused products and sums, no liberties with numbers."""
ZIG = [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]


def compile_library(compiler: list[str], out: Path, sources: Sequence[Path], flags: Sequence[str] = FLAGS) -> None:
    """Compile and link. Raises CalledProcessError or OSError."""
    with tempfile.TemporaryDirectory() as folder:
        # Else zig leaves 140 MB in the user's cache.
        run = partial(subprocess.run, check=True, env={**os.environ, "ZIG_GLOBAL_CACHE_DIR": folder})
        wide = run([*compiler, "-dumpmachine"], capture_output=True, text=True).stdout.startswith("x86_64")
        jobs = [(path, ["-msse4.1"] if wide else []) for path in sources]
        jobs += [(path, ["-mavx2"]) for path in sources if wide and path.name == "squares.c"]
        objects = [f"{folder}/{number}.o" for number in range(len(jobs))]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            commands = ([*compiler, *flags, *own, "-c", str(path)] for path, own in jobs)
            list(pool.map(lambda command, made: run([*command, "-o", made]), commands, objects))
        # A process that runs keeps the library that it has loaded.
        out.unlink(missing_ok=True)
        run([*compiler, *flags, "-shared", *objects, "-o", str(out), "-lm"])
        out.stat()


def find_compiler() -> list[str] | None:
    """The system's compiler, if it compiles and links: on macOS `cc` may be there and do nothing."""
    compiler = shlex.split(os.environ.get("CC", "cc"))
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "probe.c")
        source.write_text("#include <math.h>\n#include <stdlib.h>\ndouble probe(double x) { return floor(x); }\n")
        try:
            compile_library(compiler, Path(folder, "probe"), [source])
        except (OSError, subprocess.CalledProcessError):
            return None
    return compiler


def write_declarations(out: Path) -> None:
    """Write what Python reads instead of the header: with it a process needs no parser of C."""
    ffi = FFI()
    ffi.cdef("\n".join(line for line in (HERE / "kernels.h").read_text().splitlines() if not line.startswith("#")))
    ffi.set_source("declarations", None)
    ffi.emit_python_code(str(out))
    with out.open("a") as file:
        file.write(f'SOURCES = "{digest_sources()}"\n')


def digest_sources() -> str:
    """Of the C sources: a library that was made of others has to be compiled again."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(HERE.glob("*.[ch]")))).hexdigest()


class KernelsHook(BuildHookInterface[Any]):
    """What hatchling calls."""

    def dependencies(self) -> list[str]:
        """What the build needs besides what pyproject.toml says."""
        return [] if find_compiler() else ["ziglang"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile into the source tree, where an editable install finds the library; a wheel takes it from there."""
        try:
            compile_library(find_compiler() or ZIG, HERE / "library.so", SOURCES)
        except (OSError, subprocess.CalledProcessError) as error:
            raise SystemExit(
                f"zteam's kernels cannot be compiled ({error}): install a C compiler such as gcc or clang, "
                "or the package ziglang (pip install ziglang)"
            ) from None
        write_declarations(HERE / "declarations.py")
        build_data["artifacts"] += ["/zteam/kernels/library.so", "/zteam/kernels/declarations.py"]
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"


if __name__ == "__main__":
    compile_library(shlex.split(os.environ.get("CC", "cc")), Path(sys.argv[1]), SOURCES, [*FLAGS, *sys.argv[2:]])
