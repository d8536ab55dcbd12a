"""The files of the page, which lie in this package; nothing else is served."""

import mimetypes
import posixpath
import re
import zlib
from pathlib import Path

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.staticfiles import NotModifiedResponse, StaticFiles
from starlette.types import Scope

FOLDER = Path(__file__).parent / "page"
HEADERS = {
    "content-security-policy": "default-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
    "style-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-cache",
}
"""Of every answer."""
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

        def replace(found: re.Match[str]) -> str:
            source = posixpath.normpath(posixpath.join(posixpath.dirname(path), found[2]))
            if source not in modules:
                add(source)
            named = found[1].replace(" as ", ": ")
            return f'const {{ {named} }} = modules["{source}"];'

        text = _IMPORT.sub(replace, (folder / path).read_text("utf-8"))
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


mimetypes.add_type("text/javascript", ".js")
"""Whatever the system's table says."""


class PageFiles(StaticFiles):
    """Serves the files of a page. A browser asks again for what it has, and receives 304 where it has not changed."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        if path not in SCRIPTS:
            return await super().get_response(path, scope)
        script = read_script(path).encode()
        headers = {"etag": f'"{zlib.crc32(script):08x}"'}
        response = Response(script, media_type="text/javascript", headers=headers)
        is_known = self.is_not_modified(response.headers, Headers(scope=scope))
        return NotModifiedResponse(response.headers) if is_known else response
