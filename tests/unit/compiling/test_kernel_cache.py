"""Where compiled kernels are kept."""

import os
from pathlib import Path

import pytest

from zteam.compiling import kernel_cache


def test_each_version_of_the_code_has_a_folder_and_old_ones_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels of other code are not even looked at; when a version is complete, the newest versions stay."""
    for age in range(6):
        old = tmp_path / f"version-{age}"
        (old / "sim_0").mkdir(parents=True)
        os.utime(old, (1e9 - age, 1e9 - age))
    own = tmp_path / kernel_cache.DIGEST
    (own / "sim_0").mkdir(parents=True)
    (own / "sim_0" / "kernel.nbi").write_bytes(b"")
    monkeypatch.setattr(kernel_cache, "FOLDER", own)
    monkeypatch.setattr(kernel_cache, "_KEPT", 4)
    assert not kernel_cache.is_complete("sim")
    kernel_cache.mark_complete("sim", own / "sim_0")
    assert kernel_cache.is_complete("sim")
    assert {path.name for path in tmp_path.iterdir()} == {own.name, "version-0", "version-1", "version-2"}
