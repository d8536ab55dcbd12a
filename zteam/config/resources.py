"""Worlds and team files that come with zteam: inside the wheel, or beside the package in a checkout."""

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, NoReturn

from zteam.config.foreign_files import name_foreign, refuse_head
from zteam.errors import UsageError, did_you_mean

_READ: ContextVar[set[Path] | None] = ContextVar("read", default=None)
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


def from_home(text: str) -> str:
    """A text that begins with `~/`, which no shell has expanded, as a path of the user's folder; others as they are."""
    return os.path.expanduser(text) if text.startswith("~/") else text  # noqa: PTH111


def find_world(text: str | Path, folder: Path = Path()) -> Path:
    """The world file that a user names: a path from `folder`, else a shipped world. Raises UsageError."""
    text = from_home(str(text))
    found = existing_file(folder / text) or shipped_world(text)
    if text.endswith(".toml") or (found is None and shipped_team(text)):
        raise UsageError(f"world {text!r}: that is a team; say 'zteam up {text}'")
    return found or _refuse(folder / text, text, "world", worlds_folder(), ".world")


def find_team(text: str | Path, folder: Path = Path()) -> Path:
    """The team file that a user names: a path from `folder`, else a shipped team. Raises UsageError."""
    text = from_home(str(text))
    found = existing_file(folder / text) or shipped_team(text)
    if text.endswith(".world") or (found is None and shipped_world(text)):
        with name_foreign(found or folder / text, "world"):
            raise UsageError(f"team {text!r}: that is a world; say 'zteam up --world {text}' or 'zteam-sim {text}'")
    return found or _refuse(folder / text, text, "team", teams_folder(), ".toml")


def _refuse(path: Path, text: str, what: str, folder: Path, suffix: str) -> NoReturn:
    if text and is_folder(path):
        raise UsageError(f"{what} {text!r}: that is a folder; name the {what} file in it (*{suffix})")
    why = "no such file"
    try:
        path.stat()
    except (OSError, ValueError) as error:
        # Also a circle of symbolic links, a folder that may not be read, and a NUL.
        why = getattr(error, "strerror", None) or str(error)
    known = names(folder, suffix)
    hint = did_you_mean(text.removesuffix(suffix), known, form="; did you mean {}?")
    raise UsageError(f"{what} {text!r}: {why}, nor a shipped {what} ({', '.join(known)}){hint}")


@contextmanager
def files_read() -> Iterator[set[Path]]:
    """The users' files that this thread reads within, as they are named."""
    found = set[Path]()
    token = _READ.set(found)
    try:
        yield found
    finally:
        _READ.reset(token)


def note_read(path: Path) -> None:
    """A user's file is read."""
    if (found := _READ.get()) is not None:
        found.add(path)


def read_file(path: Path, what: str, most: int, error: type[UsageError]) -> bytes:
    """The bytes of a user's file. Raises `error` if it cannot be read, is larger than `most` bytes, or begins as a file
    of another program."""
    note_read(path)
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
    except (OSError, ValueError) as fault:
        # ValueError: a NUL in the name.
        raise error(f"{path}: cannot read this {what}: {getattr(fault, 'strerror', None) or fault}") from None
    refuse_head(path, data, what, error)
    if len(data) > most:
        raise error(f"{path}: a {what} of more than {most / 2**20:g} MB is refused")
    return data


def load_yaml(text: str | bytes, *, aliases: int = 0) -> Any:
    """The value of a YAML document as ROS reads it: `5e-2` is a number, which to PyYAML is a text. Files of parameters
    have no aliases there, maps have; with more of them than these few a short text could stand for a very long one.

    Raises yaml.YAMLError, ValueError and RecursionError.
    """
    import yaml  # slow to import

    left = iter(range(aliases))

    class Loader(yaml.SafeLoader):
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent) and next(left, None) is None:
                mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
                raise yaml.MarkedYAMLError(problem="write out what the alias stands for", problem_mark=mark)
            return super().compose_node(parent, index)

    number = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$")
    Loader.add_implicit_resolver("tag:yaml.org,2002:float", number, list("-+.0123456789"))
    try:
        return yaml.load(text, Loader)
    except (LookupError, AttributeError, TypeError):
        raise ValueError("a value does not fit the tag before it, as in '!!bool 3'") from None


def read_yaml(
    path: Path, what: str, most: int, error: type[UsageError], load: Callable[[bytes], Any] = load_yaml
) -> Any:
    """The contents of a user's YAML file, read as `read_file` does. Raises `error`, with the line if it is known."""
    import yaml

    data = read_file(path, what, most, error)
    try:
        return load(data)
    except (yaml.YAMLError, ValueError, RecursionError) as fault:
        mark, told = getattr(fault, "problem_mark", None), [getattr(fault, key, "") for key in ("context", "problem")]
        text = " ".join(filter(None, told)) or str(fault)
        place = f"{path}:{mark.line + 1}" if mark else f"{path}"
        raise error(f"{place}: not YAML: {' '.join(text.split()):.200}") from None


# Unlike Path's own methods, these take a name that no file can have: too long, or with a NUL.
def is_folder(path: Path) -> bool:
    return os.path.isdir(path)  # noqa: PTH112


def existing_file(path: Path) -> Path | None:
    return path if os.path.isfile(path) else None  # noqa: PTH113


def _find(folder: Path, name: str, suffix: str) -> Path | None:
    if Path(name).name != name:
        return None
    return existing_file(folder / (name if name.endswith(suffix) else name + suffix))


def names(folder: Path, suffix: str) -> list[str]:
    """Names of the files in `folder` with `suffix`, sorted, for error texts."""
    return sorted(p.stem for p in folder.glob("*" + suffix))
