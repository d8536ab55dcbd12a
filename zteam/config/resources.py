"""Worlds and team files that come with zteam: inside the wheel, or beside the package in a checkout."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from zteam.errors import UsageError, did_you_mean

_PACKAGE = Path(__file__).resolve().parents[1]


def _folder(inside_wheel: str, in_checkout: str) -> Path:
    installed = _PACKAGE / inside_wheel
    # An editable install has no copies inside the package: it uses the files of the checkout.
    return installed if installed.is_dir() else _PACKAGE.parent / in_checkout


def worlds_folder() -> Path:
    return _folder("_worlds", "worlds")


def teams_folder() -> Path:
    return _folder("_deploy", "deploy")


def shipped_world(name: str) -> Path | None:
    """Path of a shipped world (`office` or `office.world`), or None."""
    return _find(worlds_folder(), name, ".world")


def shipped_team(name: str) -> Path | None:
    """Path of a shipped team file (`line` or `line.toml`), or None."""
    return _find(teams_folder(), name, ".toml")


class _FileKind(NamedTuple):
    """Files that a user names."""

    what: str
    suffix: str
    folder: Callable[[], Path]
    use: str
    """How a user uses such a file, {}."""


_WORLD = _FileKind("world", ".world", worlds_folder, "say 'zteam up --world {}' or 'zteam-sim {}'")
_TEAM = _FileKind("team", ".toml", teams_folder, "say 'zteam up {}'")


def find_world(text: str | Path) -> Path:
    """The world file that a user names: a path, else a shipped world. Raises UsageError with the shipped names."""
    return _find_named(str(text), _WORLD, _TEAM)


def find_team(text: str | Path) -> Path:
    """The team file that a user names: a path, else a shipped team. Raises UsageError with the shipped names."""
    return _find_named(str(text), _TEAM, _WORLD)


def _find_named(text: str, kind: _FileKind, other: _FileKind) -> Path:
    found = existing_file(Path(text)) or _find(kind.folder(), text, kind.suffix)
    if found is None or text.endswith(other.suffix):
        raise UsageError(f"{kind.what} {text!r}: {_why_not(text, kind, other)}")
    return found


def _why_not(text: str, kind: _FileKind, other: _FileKind) -> str:
    if text.endswith(other.suffix) or _find(other.folder(), text, other.suffix):
        return f"that is a {other.what}; {other.use.replace('{}', text)}"
    if text and is_folder(Path(text)):
        return f"that is a folder; name the {kind.what} file in it (*{kind.suffix})"
    why = "no such file"
    try:
        Path(text).stat()
    except (OSError, ValueError) as error:
        # Also a circle of symbolic links, a folder that may not be read, and a NUL.
        why = getattr(error, "strerror", None) or str(error)
    known = names(kind.folder(), kind.suffix)
    hint = did_you_mean(text.removesuffix(kind.suffix), known, form="; did you mean {}?")
    return f"{why}, nor a shipped {kind.what} ({', '.join(known)}){hint}"


def read_file(path: Path, what: str, most: int, error: type[UsageError]) -> bytes:
    """The bytes of a user's file. Raises `error` if it cannot be read, or is larger than `most` bytes."""
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
    except (OSError, ValueError) as fault:
        # ValueError: a NUL in the name.
        raise error(f"{path}: cannot read this {what}: {getattr(fault, 'strerror', None) or fault}") from None
    if len(data) > most:
        raise error(f"{path}: a {what} of more than {most / 2**20:g} MB is refused")
    return data


# Unlike Path's own methods, these take a name that no file can have: too long, or with a NUL.
def is_folder(path: Path) -> bool:
    """Whether `path` is a folder."""
    return os.path.isdir(path)  # noqa: PTH112


def existing_file(path: Path) -> Path | None:
    """`path` if it is a file, else None."""
    return path if os.path.isfile(path) else None  # noqa: PTH113


def _find(folder: Path, name: str, suffix: str) -> Path | None:
    if Path(name).name != name:
        return None
    return existing_file(folder / (name if name.endswith(suffix) else name + suffix))


def names(folder: Path, suffix: str) -> list[str]:
    """Names of the files in `folder` with `suffix`, sorted, for error texts."""
    return sorted(p.stem for p in folder.glob("*" + suffix))
