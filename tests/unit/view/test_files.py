"""The page's files: those in the folder and no others."""

from pathlib import Path

import pytest

from zteam.view.files import HEADERS, find_version, read_file, read_index


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
     "js//app.js", "no.js"],
)  # fmt: skip
def test_nothing_else_is_read(folder: Path, name: str) -> None:
    """Neither what lies outside, nor hidden files, nor other kinds."""
    assert read_file(name, folder=folder) is None


def test_the_policy_lets_nothing_be_loaded_from_elsewhere() -> None:
    """Scripts have no inline code, and no other site may frame the page."""
    policy = HEADERS["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy


def test_the_page_asks_for_all_its_modules_at_once(folder: Path) -> None:
    """Under addresses that hold the version, before its script."""
    (folder / "index.html").write_text('<link href="/page/a.css"><script type="module" src="/page/js/app.js">')
    (folder / ".hidden.js").unlink()
    (folder / "link.js").unlink()
    assert bytes(read_index("v1", folder=folder).body).decode() == (
        '<link href="/page/v1/a.css"><link rel="modulepreload" href="/page/v1/js/app.js">\n'
        '<script type="module" src="/page/v1/js/app.js">'
    )


def test_a_changed_file_is_another_version(folder: Path) -> None:
    """So a browser that has kept the old one asks for the new one."""
    before = find_version(folder)
    assert find_version(folder) == before
    (folder / "js" / "app.js").write_text("2; // changed")
    assert find_version(folder) != before
