"""Compiled kernels that run without numba."""

import hashlib
import logging
import os
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from support.limits import LIMIT
from zteam.compiling import kept_kernels, kernel_cache, takeover
from zteam.compiling.kept_kernels import KeptKernel, load, pack, types_of
from zteam.compiling.kernels import has_numba
from zteam.compiling.object_code import ObjectCode, ObjectCodeError
from zteam.sim.jit import SIMULATOR

pytestmark = [pytest.mark.ci, pytest.mark.skipif(not has_numba(), reason="numba is not installed")]


@pytest.fixture
def kept() -> Path:
    """The file of the kernel `motion.measure_velocity`."""
    takeover.fill_cache(SIMULATOR)
    path = kernel_cache.find_kept("sim", "motion.measure_velocity" + kept_kernels.SUFFIX)
    assert path is not None
    return path


def arguments() -> tuple[object, ...]:
    """What the kernel is called with."""
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    steps = np.array([[0.1, 0.0, 0.2], [-0.3, 0.4, 0.0]])
    return poses, poses + steps, 0.1, np.zeros((2, 3))


def test_a_kept_kernel_computes_what_the_compiled_one_does(kept: Path) -> None:
    """It is a function of its own, and its result has the same bits."""
    from zteam.sim.motion import measure_velocity

    function = load(kept, arguments())
    assert function is not None
    given, expected = arguments(), arguments()
    assert function(*given) is None
    measure_velocity.dispatcher(*expected)  # type: ignore[attr-defined]
    assert np.asarray(given[3]).any()
    assert np.asarray(given[3]).tobytes() == np.asarray(expected[3]).tobytes()


def test_other_types_are_left_to_numba(kept: Path) -> None:
    """Code for float64 in C's order would misread anything else."""
    before, after, interval, out = arguments()
    assert load(kept, (np.asarray(before, np.float32), after, interval, out)) is None
    assert load(kept, (np.asarray(before).T, after, interval, out)) is None
    assert load(kept, (before, after, 1, out)) is None
    assert load(kept, (before, after, interval)) is None
    read_only = np.array(out)
    read_only.flags.writeable = False
    assert load(kept, (before, after, interval, read_only)) is None
    bytes_ = bytearray(np.asarray(before).nbytes + 1)
    unaligned = np.frombuffer(bytes_, np.float64, 6, offset=1).reshape(2, 3)
    assert load(kept, (unaligned, after, interval, out)) is None
    assert load(kept, (np.asarray(before).astype(">f8"), after, interval, out)) is None


@pytest.mark.parametrize(
    ("argument", "text"),
    [
        (np.zeros((2, 3)), "<f82C"),
        (np.zeros((4, 6))[::2, ::2], "<f82?"),
        (np.zeros((4, 6)).T, "<f82F"),
        (np.zeros(3, bool), "|b11C"),
        (np.frombuffer(bytes(8)), "<f81C read-only"),
        (np.frombuffer(bytes(9), np.float64, 1, offset=1), "<f81C unaligned read-only"),
        ((np.zeros(1, np.int32), 2), "(<i41C,int)"),
        (np.float64(1.0), "float"),
        (np.int64(1), "int"),
        (True, "bool"),
        (None, "NoneType"),
    ],
)
def test_types_have_names(argument: object, text: str) -> None:
    """All that compiled code depends on: kind, size, dimensions, order."""
    assert types_of(argument) == text


def content(path: Path) -> KeptKernel:
    """What the file of a kernel says."""
    return msgspec.msgpack.decode(path.read_bytes()[32:], type=KeptKernel)


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "cut": lambda data: data[:-1],
    "cut in the checksum": lambda data: data[:20],
    "one bit": lambda data: data[:5000] + bytes([data[5000] ^ 1]) + data[5001:],
    "zeros": lambda data: bytes(len(data)),
    "text": lambda _: b"<html>",
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_left_to_numba_and_made_anew(
    kept: Path, tmp_path: Path, damage: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Whatever is damaged, one debug line says so. The file goes, so the next simulator keeps the kernel again."""
    path = tmp_path / kept.name
    path.write_bytes(DAMAGES[damage](kept.read_bytes()))
    with caplog.at_level(logging.DEBUG, logger="zteam.compiling"):
        assert load(path, arguments()) is None
    assert [record.levelname for record in caplog.records] == ["DEBUG"]
    assert "damaged" in caplog.text
    assert not path.exists()


def without_table(code: bytes) -> bytes:
    """No sections at all."""
    return code[:60] + bytes(2) + code[62:]


def with_relocations_of(code: bytes, kind: int | None = None, offset: int | None = None) -> bytes:
    """The first relocation of the code becomes another one."""
    changed = bytearray(code)
    begin, entry, count = (struct.unpack_from(form, code, at)[0] for form, at in (("<Q", 40), ("<H", 58), ("<H", 60)))
    sections = [struct.unpack_from("<IIQQQQIIQQ", code, begin + i * entry) for i in range(count)]
    place = next(s[4] for s in sections if s[1] == 4 and sections[s[7]][2] & 4)
    where, info, _ = struct.unpack_from("<QQq", code, place)
    info = info if kind is None else info & ~0xFFFFFFFF | kind
    struct.pack_into("<QQ", changed, place, where if offset is None else offset, info)
    return bytes(changed)


def with_section_type(code: bytes, old: int, new: int) -> bytes:
    """The first section of a type, that becomes memory, gets another type."""
    changed = bytearray(code)
    begin, entry, count = (struct.unpack_from(form, code, at)[0] for form, at in (("<Q", 40), ("<H", 58), ("<H", 60)))
    for at in range(begin, begin + entry * count, entry):
        _, kind, flags = struct.unpack_from("<IIQ", code, at)
        if kind == old and flags & 2:
            struct.pack_into("<I", changed, at + 4, new)
            return bytes(changed)
    raise AssertionError


CODES: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda code: code[:100],
    "cut at the end": lambda code: code[: len(code) // 2],
    "other machine": lambda code: code[:18] + struct.pack("<H", 183) + code[20:],
    "32 bits": lambda code: code[:4] + b"\x01" + code[5:],
    "big-endian": lambda code: code[:5] + b"\x02" + code[6:],
    "no such symbol": lambda code: code.replace(b"\0PyErr_SetString\0", b"\0PyErr_SetNobody\0"),
    "no sections": without_table,
    "relocation of another kind": lambda code: with_relocations_of(code, kind=4),
    "relocation out of bounds": lambda code: with_relocations_of(code, offset=1 << 40),
    "constructors": lambda code: with_section_type(code, 1, 14),
    "no code": lambda _: b"",
}


@pytest.mark.parametrize("damage", CODES)
def test_code_of_an_unknown_kind_is_left_to_numba(
    kept: Path, tmp_path: Path, damage: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Code for another machine, code that is not whole, and what the loader does not know are refused in one line."""
    good = content(kept)
    path = tmp_path / kept.name
    path.write_bytes(pack(msgspec.structs.replace(good, code=CODES[damage](good.code))))
    with caplog.at_level(logging.DEBUG, logger="zteam.compiling"):
        assert load(path, arguments()) is None
    assert [record.levelname for record in caplog.records] == ["DEBUG"]


def test_a_file_without_its_function_is_left_to_numba(kept: Path, tmp_path: Path) -> None:
    """A numba with other names, or no file at all."""
    path = tmp_path / kept.name
    assert load(path, arguments()) is None
    path.write_bytes(pack(msgspec.structs.replace(content(kept), function="missing")))
    assert load(path, arguments()) is None
    path.write_bytes(pack(msgspec.structs.replace(content(kept), environment="missing")))
    assert load(path, arguments()) is None
    body = b"\xc0"
    path.write_bytes(hashlib.sha256(body).digest() + body)
    assert load(path, arguments()) is None


def test_a_file_that_others_can_write_is_not_run(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What lies in a folder that users share may be anybody's. Only one's own files and those of root are run."""
    path = tmp_path / kept.name
    path.write_bytes(kept.read_bytes())
    assert load(path, arguments()) is not None
    path.chmod(0o646)
    assert load(path, arguments()) is None
    path.chmod(0o644)
    owner = path.stat().st_uid
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    assert (load(path, arguments()) is None) == (owner != 0)


def test_a_file_of_another_user_is_not_run(kept: Path, tmp_path: Path) -> None:
    """Not even by root."""
    path = tmp_path / kept.name
    path.write_bytes(kept.read_bytes())
    try:
        os.chown(path, 54321, -1)
    except PermissionError:
        pytest.skip("only root can give files away")
    assert load(path, arguments()) is None
    assert path.exists()


def test_another_system_is_left_to_numba(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some use the same form of file, and other conventions for calls."""
    monkeypatch.setattr(sys, "platform", "win32")
    assert load(kept, arguments()) is None


def test_files_for_other_surroundings_have_other_names(kept: Path) -> None:
    """Several interpreters, compilers and versions of the code may share one folder (NUMBA_CACHE_DIR)."""
    assert kernel_cache.DIGEST in kept.name


@pytest.mark.ci
def test_two_processes_that_keep_the_same_kernel_do_not_disturb_each_other(kept: Path) -> None:
    """While two write again and again, a third reads whole files only."""
    writing = (
        "import sys\n"
        "from pathlib import Path\n"
        "from zteam.sim import jit_warmup\n"
        "kernel = next(k for k in jit_warmup.find_kernels() if k.name == 'motion.measure_velocity')\n"
        "kernel.compile()\n"
        "for _ in range(200): kernel.keep()\n"
        "print(kernel.dispatcher.stats.cache_path)\n"
    )
    command = [sys.executable, "-P", "-c", writing]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(kernel_cache.FOLDER)}
    writers = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    reads = 0
    while any(writer.poll() is None for writer in writers) or not reads:
        assert load(kept, arguments()) is not None
        reads += 1
    for writer in writers:
        assert writer.stdout is not None
        with writer.stdout:
            assert Path(writer.stdout.read().strip()) == kept.parent
        assert writer.returncode == 0


def test_code_can_be_run_or_written_and_not_both(kept: Path) -> None:
    """Some pages of a kernel can be run, some can be written to, and none is open to both."""
    code = ObjectCode(content(kept).code, kept_kernels._find_symbol)
    end = code._base + len(code._memory)
    rights = set()
    for line in Path("/proc/self/maps").read_text().splitlines():
        place, right, *_ = line.split()
        first, last = (int(address, 16) for address in place.split("-"))
        if first < end and last > code._base:
            rights.add(right[:3])
    assert rights == {"r-x", "rw-"}


def test_code_that_needs_more_than_is_known_is_refused(kept: Path) -> None:
    """What it uses must be found."""

    def find(name: str) -> int:
        raise ObjectCodeError(name)

    with pytest.raises(ObjectCodeError):
        ObjectCode(content(kept).code, find)


ALL_KERNELS = """
import sys
from zteam.compiling import kept_kernels, kernels, takeover
from zteam.sim.jit import SIMULATOR
from zteam.sim.engine import Engine
from zteam.messages import Twist, Vector3
from zteam.resources import find_world
from zteam.simulation_options import PHYSICS, Options
from zteam.world import load_world

takeover.prepare(SIMULATOR)
types = {}
type_of_kernel = kernels.Kernel
original = type_of_kernel.__call__
def checked(self, *args):
    types.setdefault(self.name, set()).add(kept_kernels.types_of(args))
    return original(self, *args)
type_of_kernel.__call__ = checked
for name in ("arena", "office"):
    world = load_world(find_world(name))
    for physics in PHYSICS:
        for options in (Options(physics=physics), Options(physics=physics, odom_alphas=(0.1, 0.1, 0.1, 0.1),
                        gaussian_noise=0.01, dazzle="drop")):
            engine = Engine(world, options=options)
            for _ in range(200):
                engine.step({i: Twist(Vector3(0.5), Vector3(z=0.1)) for i in engine.robots})
print(sorted(name for name, found in types.items() if len(found) > 1), len(types) > 8, "numba" in sys.modules)
"""


@pytest.mark.ci
def test_a_simulator_needs_no_numba() -> None:
    """In all shipped worlds, with all physics, every kernel is called with the same types from first to last, and none
    of them needs numba."""
    takeover.fill_cache(SIMULATOR)
    done = subprocess.run(
        [sys.executable, "-P", "-c", ALL_KERNELS], capture_output=True, text=True, timeout=3 * LIMIT, check=False
    )
    assert done.stdout == "[] True False\n", done.stderr
