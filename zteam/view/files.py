"""The files of the page, which lie in this package; nothing else is served."""

import posixpath
import re
import zlib
from collections.abc import Mapping
from pathlib import Path

from starlette.responses import Response

from zteam.config.resources import existing_file

FOLDER = Path(__file__).parent / "page"
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".txt": "text/plain; charset=utf-8",
    ".woff2": "font/woff2",
}
"""Media type by ending."""
HEADERS = {
    "content-security-policy": "default-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
    "style-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-cache",
}
"""Of every answer, unless it says otherwise."""
KEPT = {"cache-control": "private, max-age=31536000, immutable"}
"""Of a file whose address holds its version."""


def read_file(name: str, headers: Mapping[str, str] | None = None, *, folder: Path = FOLDER) -> Response | None:
    kind = KINDS.get(Path(name).suffix)
    if kind is None or any(part in ("..", "") or part.startswith(".") for part in name.split("/")):
        return None
    path = existing_file(folder / name)
    if path is None or not path.resolve().is_relative_to(folder.resolve()):
        return None
    return Response(path.read_bytes(), media_type=kind, headers=headers)


def find_version(folder: Path = FOLDER) -> str:
    """Another text after each change of a file."""
    found = sorted((path.as_posix(), path.stat().st_size, path.stat().st_mtime_ns) for path in folder.rglob("*.*"))
    return f"v{zlib.crc32(repr(found).encode()):08x}"


def read_index(version: str, *, folder: Path = FOLDER) -> Response:
    """The page itself. Its files have addresses that hold the version: a browser need not ask again for what it has."""
    page = (folder / "index.html").read_text("utf-8").replace('"/page/', f'"/page/{version}/')
    return Response(page.encode(), media_type=KINDS[".html"])


SCRIPTS = {
    "js/main.js": "export const modules = {};\n",
    "js/panels/main.js": 'import { modules } from "../main.js";\n',
}
"""Modules that are served with all that they import, and how each of these scripts begins. What is in one is not in the
next. With a request for each of eighty modules, while a team starts beside it, a browser took 0.4 to 0.6 s longer."""
_IMPORT = re.compile(r'^import \{ (.*) \} from "(.*)";$', re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:async )?(?:function|class|const) (\w+))", re.MULTILINE)


def read_script(name: str, *, folder: Path = FOLDER) -> str:
    """One of SCRIPTS. Each module in it is a function of its own, which returns what the module exports."""
    modules: dict[str, str] = {}

    def add(path: str) -> str:
        """Add a module after those that it imports; what it exports."""

        def take(found: re.Match[str]) -> str:
            source = posixpath.normpath(posixpath.join(posixpath.dirname(path), found[2]))
            if source not in modules:
                add(source)
            named = found[1].replace(" as ", ": ")
            return f'const {{ {named} }} = modules["{source}"];'

        text = _IMPORT.sub(take, (folder / path).read_text("utf-8"))
        exported = ", ".join(each[2] for each in _EXPORT.finditer(text))
        body = _EXPORT.sub(r"\1", text)
        modules[path] = f'modules["{path}"] = (() => {{\n{body}return {{ {exported} }};\n}})();\n'
        return exported

    for entry in SCRIPTS:
        served = len(modules)
        exported = add(entry)
        if entry == name:
            break
    parts = list(modules.values())[served:]
    return f'{SCRIPTS[name]}{"".join(parts)}export const {{ {exported} }} = modules["{name}"];\n'
