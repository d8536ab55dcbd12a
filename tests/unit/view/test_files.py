"""The page's files: those in the folder and no others."""

import asyncio
import re
from pathlib import Path

import pytest
from starlette.exceptions import HTTPException
from starlette.responses import Response

from zteam.view.files import FOLDER, HEADERS, SCRIPTS, PageFiles, read_script


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A page with a script in a folder, beside a secret."""
    page = tmp_path / "page"
    (page / "js").mkdir(parents=True)
    (page / "js" / "app.js").write_text("1;")
    (tmp_path / "secret.js").write_text("x")
    (page / "link.js").symlink_to(tmp_path / "secret.js")
    return page


def answer(folder: Path, name: str, *headers: tuple[bytes, bytes]) -> Response:
    """The answer to a request for a file."""
    scope = {"type": "http", "method": "GET", "headers": headers}
    return asyncio.run(PageFiles(directory=folder).get_response(name, scope))


def test_a_file_has_its_media_type(folder: Path) -> None:
    """Scripts are JavaScript, whatever the system's table says."""
    assert answer(folder, "js/app.js").headers["content-type"] == "text/javascript; charset=utf-8"


@pytest.mark.parametrize("name", ["js/main.js", "style.css"])
def test_what_a_browser_has_is_not_sent_again(name: str) -> None:
    """Neither a file nor a script that is made of many, unless it has changed."""
    tag = answer(FOLDER, name).headers["etag"].encode()
    assert answer(FOLDER, name, (b"if-none-match", tag)).status_code == 304
    assert answer(FOLDER, name, (b"if-none-match", b'"another"')).status_code == 200


@pytest.mark.parametrize(
    "name",
    ["../secret.js", "js/../../secret.js", "/etc/hosts.js", "link.js", "js", "", "a\0.js", "no.js", "x" * 256 + ".js",
     "js/" * 3000 + "app.js", "\ud800.js", "js/app.js/app.js"],
)  # fmt: skip
def test_nothing_else_is_read(folder: Path, name: str) -> None:
    """Not what lies outside; a name that no file can have is none."""
    with pytest.raises(HTTPException, match="404"):
        answer(folder, name)


def test_the_policy_lets_nothing_be_loaded_from_elsewhere() -> None:
    """Scripts have no inline code, and no other site may frame the page."""
    policy = HEADERS["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy


def test_a_script_holds_what_its_module_imports(folder: Path) -> None:
    """Each module once, after those that it imports, with its own names; the panels leave out what the map has."""
    sources = {
        "main.js": 'import { half } from "./app.js";\nimport { twice as by2, ONE } from "./lib/math.js";\nby2(1);\n',
        "app.js": 'import { twice } from "./lib/math.js";\n\nexport async function half(x) {\n  return x / 2;\n}\n',
        "lib/math.js": "const own = 2;\nexport const ONE = 1;\nexport function twice(x) {\n  return own * x;\n}\n",
        "panels/main.js": 'import { ONE } from "../lib/math.js";\nexport class Panels {}\nconsole.log(ONE);\n',
    }
    for name, source in sources.items():
        (folder / "js" / name).parent.mkdir(exist_ok=True)
        (folder / "js" / name).write_text(source)
    assert read_script("js/main.js", folder=folder) == (
        "export const modules = {};\n"
        'modules["js/lib/math.js"] = (() => {\nconst own = 2;\nconst ONE = 1;\n'
        "function twice(x) {\n  return own * x;\n}\nreturn { ONE, twice };\n})();\n"
        'modules["js/app.js"] = (() => {\nconst { twice } = modules["js/lib/math.js"];\n\n'
        "async function half(x) {\n  return x / 2;\n}\nreturn { half };\n})();\n"
        'modules["js/main.js"] = (() => {\nconst { half } = modules["js/app.js"];\n'
        'const { twice: by2, ONE } = modules["js/lib/math.js"];\nby2(1);\nreturn {  };\n})();\n'
        'export const {  } = modules["js/main.js"];\n'
    )
    assert read_script("js/panels/main.js", folder=folder) == (
        'import { modules } from "../main.js";\nmodules["js/panels/main.js"] = (() => {\n'
        'const { ONE } = modules["js/lib/math.js"];\nclass Panels {}\nconsole.log(ONE);\nreturn { Panels };\n})();\n'
        'export const { Panels } = modules["js/panels/main.js"];\n'
    )


def test_the_scripts_hold_the_modules_of_the_page() -> None:
    """All but the one that brings the charts; and each import and export has a form that `read_script` knows."""
    scripts = "".join(read_script(name) for name in SCRIPTS)
    modules = {path.relative_to(FOLDER).as_posix() for path in FOLDER.glob("js/**/*.js")}
    assert set(re.findall(r'^modules\["(.*)"\] = ', scripts, re.MULTILINE)) == modules - {"js/vendor.js"}
    kept = [line for line in scripts.splitlines() if line.startswith(("import ", "export ")) and "modules" not in line]
    assert kept == []
