"""The user's own code by its name, and the files in which a process finds modules."""

import os
import subprocess
import sys
import sysconfig
import types
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.errors import UsageError
from zteam.team.own_code import file_of, files_since, find_body, other_file, search_folders
from zteam.team.testing.team import _SITE


@pytest.fixture
def lab(empty_folder: Path) -> Path:
    """A folder of the search path with a package, a package without a file, and a module."""
    for name in ("pack/__init__.py", "pack/part.py", "spaces/part.py", "single.py"):
        path = empty_folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("def main(node):\n    pass\n\n\nTEXT = 'no function'\n")
    return empty_folder


def test_files_are_found_without_imports(lab: Path) -> None:
    """Of modules, packages and their parts, those with a file; nothing of them is run."""
    for name, text in {
        "ends/__init__.py": "raise SystemExit", "ends/part.py": "",
        "broken/__init__.py": "def", "broken/part.py": "", "spaces/deep/part.py": "",
    }.items():  # fmt: skip
        (lab / name).parent.mkdir(exist_ok=True)
        (lab / name).write_text(text)
    files = ["single", "pack/__init__", "pack/part", "spaces/part", "spaces/deep/part", "ends/part", "broken/part"]
    expected = {file.removesuffix("/__init__").replace("/", "."): str(lab / f"{file}.py") for file in files}
    assert {name: file_of(name) for name in expected} == expected
    assert [file_of(name) for name in ("spaces", "single.part", "pack.no", "no", "no.part")] == [None] * 5
    assert not sys.modules.keys() & {*expected, "spaces", "ends", "broken"}


def test_what_was_imported_has_its_file(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the search would find a module of its name; a module without a file is no file."""
    loaded = types.ModuleType("single")
    loaded.__file__ = "/elsewhere/single.py"
    monkeypatch.setitem(sys.modules, "single", loaded)
    monkeypatch.setitem(sys.modules, "pack", types.ModuleType("pack"))
    assert file_of("single") == "/elsewhere/single.py"
    assert file_of("pack") is None
    assert other_file("single", str(lab / "single.py")) == "/elsewhere/single.py"
    assert other_file("single", str(lab / "single.py"), [str(lab)]) is None


def test_links_to_one_file_are_one(lab: Path) -> None:
    """A project folder that is a link is no other project."""
    (lab / "link").symlink_to(lab)
    assert other_file("pack.part", str(lab / "link" / "pack" / "part.py")) is None


def test_the_imports_of_a_module_are_found(lab: Path) -> None:
    """A package stands for its parts; one without a file is known by its parts; Python's own modules are left out."""
    before = {*sys.modules} - {"json"}
    __import__("pack.part")
    __import__("spaces.part")
    expected = {"pack": "pack/__init__.py", "spaces.part": "spaces/part.py"}
    assert files_since(before) == {name: str(lab / file) for name, file in expected.items()}


def test_only_folders_of_the_project_are_handed_on(lab: Path) -> None:
    """What Python has installed is left out: another Python would be spoilt by it."""
    folders = search_folders()
    assert folders[0] == str(lab)
    assert not {*sysconfig.get_paths().values()} & {*folders}


@pytest.mark.parametrize(
    ("spec", "told"),
    [
        ("single", r"'single' is no function: give package.module:function, such as 'crowd:main'"),
        ("single.py:main", "cannot import single.py: ModuleNotFoundError"),
        ("single:mian", r"module single \(.*single.py\) has no mian \(did you mean main\?\)"),
        ("single:TEXT", "'single:TEXT' is a str, and no function of the node"),
        ("nowhere:main", "cannot import nowhere: ModuleNotFoundError"),
    ],
)
def test_a_body_that_is_not_there_is_told(lab: Path, spec: str, told: str) -> None:
    """In one line, with the node's name."""
    with pytest.raises(UsageError, match=r"^node 'crowd': ") as error:
        find_body("crowd", spec)
    assert "\n" not in str(error.value)
    assert error.match(told)


def test_a_started_python_looks_behind_its_own_modules(lab: Path) -> None:
    """In the folders of $ZTEAM_PATH: nothing of Python, of PYTHONPATH and of the script is hidden, and another
    `sitecustomize` still runs."""
    for name in ("json.py", "single.py", "site/sitecustomize.py", "site/first.py", "first.py"):
        path = lab / "far" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"print({name!r})")
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([_SITE, str(lab / "far" / "site")]),
        "ZTEAM_PATH": str(lab / "far"),
    }
    done = subprocess.run(
        [sys.executable, "-P", "-c", "import first, single, json, sys; json.dumps(1); print(sys.path[-1])"],
        env=environment, capture_output=True, text=True, timeout=LIMIT, check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["site/sitecustomize.py", "site/first.py", "single.py", str(lab / "far")]
    assert done.stderr == ""
