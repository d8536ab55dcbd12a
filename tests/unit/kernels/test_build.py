"""The build hook: which compiler it takes, and what it says where none works."""

import sysconfig
from pathlib import Path
from typing import Any

import pytest

from zteam.kernels import build, declarations


def hook() -> build.KernelsHook:
    """The hook as hatchling makes it."""
    return build.KernelsHook("", {}, None, None, "", "")  # type: ignore[arg-type]


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder into which the hook writes; the package's own library stays."""
    for source in build.HERE.glob("*.[ch]"):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    monkeypatch.setattr(build, "HERE", tmp_path)
    monkeypatch.setattr(build, "SOURCES", sorted(tmp_path.glob("*.c")))
    return tmp_path


def test_an_older_python_can_import_the_hook() -> None:
    """So pip says which Python zteam needs: annotations in the words of a newer one are not evaluated."""
    assert build.find_compiler.__annotations__["return"] == "list[str] | None"


def test_the_library_was_made_of_these_sources() -> None:
    """A C file that was changed and not compiled again is noticed."""
    assert build.digest_sources() == declarations.SOURCES, "the C sources have changed: run pip install -e . again"


@pytest.mark.ci
def test_a_wheel_is_for_this_platform_and_any_python(elsewhere: Path) -> None:
    """The hook compiles, and says that the wheel holds a library for this platform."""
    if build.find_compiler() is None:
        pytest.skip("there is no C compiler")
    data: dict[str, Any] = {"artifacts": []}
    hook().initialize("standard", data)
    assert data["tag"].startswith("py3-none-") and sysconfig.get_platform().split("-")[0] in data["tag"]
    assert data["pure_python"] is False
    assert all((elsewhere / Path(name).name).stat().st_size for name in data["artifacts"])


@pytest.mark.parametrize("compiler", ["/nonexistent", "true", "false"])
def test_without_a_compiler_zigs_is_asked_for(compiler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is missing, does nothing or fails is refused by the probe; then the build needs the package ziglang."""
    monkeypatch.setenv("CC", compiler)
    assert build.find_compiler() is None
    assert hook().dependencies() == ["ziglang"]


def test_where_no_compiler_works_the_message_names_both_ways_out(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither the system's nor zig's: one line says what to install."""
    monkeypatch.setenv("CC", "/nonexistent")
    monkeypatch.setattr(build, "ZIG", ["/nonexistent"])
    with pytest.raises(SystemExit, match=r"install a C compiler such as gcc or clang, or the package ziglang"):
        hook().initialize("standard", {})
