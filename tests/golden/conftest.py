"""Recorded outputs of Stage and tf2, where they are at hand."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with recorded outputs and worlds; tests skip without it."""
    if not SHARED.is_dir():
        pytest.skip("the recorded data (../shared) is not here")
    return SHARED


@pytest.fixture(scope="session")
def golden(shared: Path) -> Any:
    """Loads one recorded file by name."""

    def load(name: str) -> Any:
        with gzip.open(shared / "golden" / name) as file:
            return json.load(file)

    return load
