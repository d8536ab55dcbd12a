"""The user's own code by its name: bodies of nodes, and the folders in which this process finds modules."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

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
    body = load_named(f"node {name!r}", module, function)
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
