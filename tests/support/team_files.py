"""Team files that a test writes, and the error of a mistake in them."""

from pathlib import Path

import pytest

from zteam.errors import ConfigError
from zteam.team_file import Team, load_team


def load(folder: Path, text: str) -> Team:
    """The team in a file of this text."""
    path = folder / "team.toml"
    path.write_text(text, encoding="utf-8")
    return load_team(path)


def error_of(folder: Path, text: str) -> str:
    """The one-line error of a file of this text, without the file's name."""
    with pytest.raises(ConfigError) as caught:
        load(folder, text)
    told = str(caught.value)
    assert "\n" not in told
    assert told.startswith(str(folder / "team.toml") + ":")
    return told.removeprefix(str(folder / "team.toml") + ":").strip()


def robots(*tables: str) -> str:
    """A file of these [[robots]] tables."""
    return "\n".join(f"[[robots]]\n{table}" for table in tables)
