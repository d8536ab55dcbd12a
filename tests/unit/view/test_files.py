"""The page's files: those in the folder and no others."""

import re
from pathlib import Path

import pytest

from zteam.view.files import FOLDER, HEADERS, SCRIPTS, find_version, read_file, read_index, read_script


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A page with a script in a folder, beside a secret."""
    page = tmp_path / "page"
    (page / "js").mkdir(parents=True)
    (page / "js" / "app.js").write_text("1;")
    (page / "notes.secret").write_text("x")
    (page / ".hidden.js").write_text("x")
    (tmp_path / "secret.js").write_text("x")
    (page / "link.js").symlink_to(tmp_path / "secret.js")
    return page


def test_a_file_has_its_media_type(folder: Path) -> None:
    """Scripts are JavaScript, whatever the system's table says."""
    found = read_file("js/app.js", folder=folder)
    assert found is not None
    assert (found.body, found.media_type) == (b"1;", "text/javascript; charset=utf-8")


@pytest.mark.parametrize(
    "name",
    ["../secret.js", "js/../../secret.js", "/etc/hosts.js", "link.js", ".hidden.js", "notes.secret", "js", "", "a\0.js",
     "js//app.js", "no.js", "x" * 256 + ".js", "js/" * 3000 + "app.js", "\ud800.js", "js/app.js/app.js"],
)  # fmt: skip
def test_nothing_else_is_read(folder: Path, name: str) -> None:
    """Neither what lies outside, nor hidden files, nor other kinds; a name that no file can have is none."""
    assert read_file(name, folder=folder) is None


def test_the_policy_lets_nothing_be_loaded_from_elsewhere() -> None:
    """Scripts have no inline code, and no other site may frame the page."""
    policy = HEADERS["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy


def test_the_page_names_its_files_with_the_version(folder: Path) -> None:
    """So the address of a file changes with it."""
    (folder / "index.html").write_text('<link href="/page/a.css"><script type="module" src="/page/js/app.js">')
    assert bytes(read_index("v1", folder=folder).body).decode() == (
        '<link href="/page/v1/a.css"><script type="module" src="/page/v1/js/app.js">'
    )


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


def test_a_changed_file_is_another_version(folder: Path) -> None:
    """So a browser that has kept the old one asks for the new one."""
    before = find_version(folder)
    assert find_version(folder) == before
    (folder / "js" / "app.js").write_text("2; // changed")
    assert find_version(folder) != before
