"""The user's own code by its name: bodies of nodes, and in which files a process finds modules."""

import os
import sys
from collections.abc import Callable, Container, Iterable
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zteam.errors import UsageError
from zteam.robot.behaviors.registry import load_named

if TYPE_CHECKING:
    from zteam.node.node import Node


def find_body(name: str, spec: str) -> "Callable[[Node], None]":
    """The function `module:function` that is the body of the node `name`. Imports its module. Raises UsageError."""
    what = f"node {name!r}: {spec!r}"
    module, _, function = spec.partition(":")
    if not (function.isidentifier() and all(part.isidentifier() for part in module.split("."))):
        raise UsageError(f"{what} is no function: give package.module:function, such as 'crowd:main'")
    body = load_named(f"node {name!r}", module, function, callable)
    if not callable(body):
        raise UsageError(f"{what} is a {type(body).__name__}, and no function of the node")
    return body  # type: ignore[no-any-return]


def search_folders() -> list[str]:
    """Where this process looks for modules besides what its Python has installed, absolute, in its order."""
    # Only a test pays for these imports.
    import site
    import sysconfig

    installed = {*sysconfig.get_paths().values(), *site.getsitepackages(), site.getusersitepackages()}
    stdlib, version = Path(sysconfig.get_path("stdlib")), "".join(map(str, sys.version_info[:2]))
    # Its compiled modules, and the archive that may stand for it.
    installed |= {str(stdlib / "lib-dynload"), str(stdlib.parent / f"python{version}.zip")}
    entries = [str(Path(entry).absolute()) for entry in sys.path if isinstance(entry, str) and entry not in installed]
    return list(dict.fromkeys(entries))


def files_since(before: Container[str]) -> dict[str, str]:
    """The files of the modules that were imported since `sys.modules` had the names `before`.

    A package's file stands for all modules in it, and those of Python and zteam are left out.
    """
    found = {}
    for name, module in list(sys.modules.items()):
        top, parent = name.partition(".")[0], sys.modules.get(name.rpartition(".")[0])
        if name not in before and top not in sys.stdlib_module_names and top != "zteam":
            file = _file(module)
            if file is not None and _file(parent) is None:
                found[name] = file
    return found


def _file(module: Any) -> str | None:
    file = getattr(module, "__file__", None)
    return file if isinstance(file, str) else None


def file_of(module: str) -> str | None:
    """The file of a module that this process has imported or would import; None if there is none. Imports nothing."""
    return _locate(module)[0]


def _locate(module: str) -> tuple[str | None, Iterable[str]]:
    """The file of a module, and the folders of its parts."""
    loaded = sys.modules.get(module)
    if loaded is not None:
        return _file(loaded), getattr(loaded, "__path__", ())
    package, _, name = module.rpartition(".")
    # `find_spec` of a part would import its package.
    spec = PathFinder.find_spec(name, [*_locate(package)[1]]) if package else find_spec(name)
    if spec is None:
        return None, ()
    return spec.origin if spec.has_location else None, spec.submodule_search_locations or ()


def other_file(module: str, file: str, right: Container[str] = ()) -> str | None:
    """The file that this process has for a module that another one found in `file`; None if it is the same file, or if
    the module lies in one of the folders `right`."""
    mine, place = file_of(module), Path(file).parent
    if file.endswith("__init__.py"):
        place = place.parent
    is_right = str(place.resolve()) in right
    return None if mine is None or is_right or os.path.realpath(mine) == os.path.realpath(file) else mine
