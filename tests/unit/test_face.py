"""The public face: what users import, and the page that lists it."""

import importlib
import pydoc
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import zteam
from support.limits import LIMIT

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.md"
PACKAGES = ("behaviors", "messages", "sim", "world", "tf", "testing", "errors")


def listed() -> dict[str, set[str]]:
    """The names in the first columns of the page's tables, by module."""
    sections = re.split(r"^## `([\w.]+)`$", PAGE.read_text(), flags=re.MULTILINE)[1:]
    names: dict[str, set[str]] = {}
    for module, text in zip(sections[::2], sections[1::2], strict=True):
        cells = re.findall(r"^\| (`[^|]*`) \|", text, re.MULTILINE)
        names[module] = set(re.findall(r"`(\w+)`", " ".join(cells)))
    return names


def exported(module: Any) -> set[str]:
    """The names that a module exports: its `__all__`, or the classes that it defines."""
    return set(getattr(module, "__all__", None) or [n for n, v in vars(module).items() if isinstance(v, type)])


@pytest.mark.parametrize("name", ["zteam", *(f"zteam.{package}" for package in PACKAGES)])
def test_the_page_lists_what_the_module_exports(name: str) -> None:
    """Nothing public is missing from the page, and everything on the page can be imported."""
    module = importlib.import_module(name)
    assert listed()[name] == exported(module)
    for public in exported(module):
        assert getattr(module, public) is not None


def test_the_page_lists_the_public_modules() -> None:
    """A module is public if and only if it has a section."""
    assert set(listed()) == {"zteam", *(f"zteam.{package}" for package in PACKAGES)}


def test_help_reads_like_a_page() -> None:
    """`help(zteam)` begins with what zteam is, shows each way to use it, and describes every exported class."""
    text = pydoc.plain(pydoc.render_doc(zteam))
    order = [
        "A team of robots",
        "class Circle(Behavior)",
        'zteam.run("watchdog"',
        "SimulatorClient(bus)",
        "zteam.messages   ",
    ]
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    for name in ("Node", "Behavior", "View", "Bus", "SimulatorClient"):
        assert f"    class {name}(" in text


def test_names_are_those_that_users_import() -> None:
    """Classes and functions call themselves by their public name."""
    for name in zteam.__all__:
        found = getattr(zteam, name)
        if name not in ("__version__", "ZteamError"):
            assert f"{found.__module__}.{found.__qualname__}" == f"zteam.{name}"
    assert zteam.ZteamError.__module__ == "zteam.errors"
    assert dir(zteam) == zteam.__all__ == sorted(zteam.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    """As of any module, so that `hasattr` works."""
    assert not hasattr(zteam, "Robot")
    with pytest.raises(ImportError):
        importlib.import_module("zteam.robots")


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("import zteam", {"numpy", "zenoh", "msgspec", "typing", "importlib.metadata"}),
        ("import zteam.testing", {"numpy", "zenoh", "msgspec", "typing"}),
        ("import zteam; zteam.Behavior", {"zenoh"}),
    ],
)
def test_importing_is_cheap(code: str, absent: set[str]) -> None:
    """A name pays for what it needs and no more."""
    program = f"import sys; before = {{*sys.modules}}; {code}; print(*({{*sys.modules}} - before))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=LIMIT, check=True)
    assert not absent & set(done.stdout.split())
