"""The files of the page, which lie in this package; nothing else is served."""

import zlib
from collections.abc import Mapping
from pathlib import Path

from starlette.responses import Response

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
    """The file of this name, relative to the page's folder; None where there is none."""
    kind = KINDS.get(Path(name).suffix)
    if kind is None or "\0" in name:
        return None
    path = folder / name
    if any(part in ("..", "") or part.startswith(".") for part in name.split("/")) or not path.is_file():
        return None
    if not path.resolve().is_relative_to(folder.resolve()):
        return None
    return Response(path.read_bytes(), media_type=kind, headers=headers)


def find_version(folder: Path = FOLDER) -> str:
    """Another text after each change of a file."""
    found = sorted((path.as_posix(), path.stat().st_size, path.stat().st_mtime_ns) for path in folder.rglob("*.*"))
    return f"v{zlib.crc32(repr(found).encode()):08x}"


LATER = ("js/panels/", "js/layout.js", "js/plots.js", "js/vendor.js")
"""Modules that the map does not need. The library for charts is asked for last, by the module that needs it."""


def read_index(version: str, *, folder: Path = FOLDER) -> Response:
    """The page itself. It asks for all its modules at once, as each of them names others, those of the map first, and
    under addresses that hold the version, so that a browser need not ask again for what it has."""
    modules = [path.relative_to(folder).as_posix() for path in (folder / "js").rglob("*.js")]
    links = ""
    for is_later, name in sorted((name.startswith(LATER), name) for name in modules):
        links += f'<link rel="modulepreload" href="/page/{name}"{" fetchpriority=low" if is_later else ""}>\n'
    before, script, after = (folder / "index.html").read_text("utf-8").partition('<script type="module"')
    page = f"{before}{links}{script}{after}".replace('"/page/', f'"/page/{version}/')
    return Response(page.encode(), media_type=KINDS[".html"])
