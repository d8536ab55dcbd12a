"""The modules of the package, each by itself."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import zteam
from support.limits import LIMIT

SCRIPT = """
import os, sys
import msgspec, numpy, zenoh

for name in sys.argv[1:]:
    child = os.fork()
    if not child:
        __import__(name)
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        sys.exit(name)
"""
"""Imports each module in a process of its own, in which nothing of zteam was imported before."""


@pytest.mark.ci
def test_each_module_may_be_imported_first() -> None:
    """No module needs another one of the package to have been imported before: their imports have no circle."""
    package = Path(str(zteam.__file__)).parent
    # An installed package has a folder of worlds too, which is none.
    paths = [path for path in sorted(package.glob("**/*.py")) if (path.parent / "__init__.py").exists()]
    parts = [path.relative_to(package.parent).with_suffix("").parts for path in paths if path.name != "__main__.py"]
    modules = [".".join(each).removesuffix(".__init__") for each in parts]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *modules], capture_output=True, text=True, timeout=4 * LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr


def test_pytest_without_the_plugins_of_this_checkout_names_them(tmp_path: Path) -> None:
    """A test of a user's own that lies in the checkout takes its options, which plain pytest does not know."""
    options = Path(__file__).parents[2] / "pyproject.toml"
    (tmp_path / "pyproject.toml").write_bytes(options.read_bytes())
    command, environment = [sys.executable, "-m", "pytest"], {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "Missing required plugins: pytest-benchmark, pytest-timeout, pytest-xdist" in done.stderr
