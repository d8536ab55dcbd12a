"""Worlds that a test writes as text."""

from pathlib import Path

import pytest

from support.world_texts import LoadText, text_loader


@pytest.fixture
def load(tmp_path: Path) -> LoadText:
    """Loads the text of a world, with a robot added at its end."""
    return text_loader(tmp_path)
