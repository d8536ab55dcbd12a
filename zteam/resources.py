"""Worlds and team files that come with zteam: inside the wheel, or beside the package in a checkout."""

from pathlib import Path

from zteam.errors import UsageError

_PACKAGE = Path(__file__).resolve().parent


def _folder(inside_wheel: str, in_checkout: str) -> Path:
    installed = _PACKAGE / inside_wheel
    # An editable install has no copies inside the package: it uses the files of the checkout.
    return installed if installed.is_dir() else _PACKAGE.parent / in_checkout


def worlds_folder() -> Path:
    """Folder of the shipped worlds."""
    return _folder("_worlds", "worlds")


def teams_folder() -> Path:
    """Folder of the shipped team files."""
    return _folder("_deploy", "deploy")


def shipped_world(name: str) -> Path | None:
    """Path of a shipped world (`office` or `office.world`), or None."""
    return _find(worlds_folder(), name, ".world")


def shipped_team(name: str) -> Path | None:
    """Path of a shipped team file (`line` or `line.toml`), or None."""
    return _find(teams_folder(), name, ".toml")


def find_world(text: str) -> Path:
    """The world file that a user named: a path, else a shipped world. Raises UsageError that lists the shipped ones."""
    return _find_named("world", text, worlds_folder(), ".world")


def find_team(text: str) -> Path:
    """The team file that a user named: a path, else a shipped team. Raises UsageError that lists the shipped ones."""
    return _find_named("team", text, teams_folder(), ".toml")


def _find_named(kind: str, text: str, folder: Path, suffix: str) -> Path:
    path = Path(text) if Path(text).is_file() else _find(folder, text, suffix)
    if path is None:
        known = ", ".join(names(folder, suffix))
        raise UsageError(f"{kind} {text!r}: no such file, nor a shipped {kind} ({known})")
    return path


def _find(folder: Path, name: str, suffix: str) -> Path | None:
    if Path(name).name != name:
        return None
    path = folder / (name if name.endswith(suffix) else name + suffix)
    try:
        return path if path.is_file() else None
    except (OSError, ValueError):
        # Not a file name at all: too long, or with a NUL in it.
        return None


def names(folder: Path, suffix: str) -> list[str]:
    """Names of the files in `folder` with `suffix`, sorted, for error texts."""
    return sorted(p.stem for p in folder.glob("*" + suffix))
