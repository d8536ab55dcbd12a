"""Python imports this when it starts in the environment of a team under test: it looks for modules in the folders of
$ZTEAM_PATH behind its own.

Any Python may import it, so it needs none of zteam.
"""

import os
import sys

_HERE = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120
sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != _HERE]  # noqa: PTH100
for _folder in os.environ.get("ZTEAM_PATH", "").split(os.pathsep):
    if _folder and _folder not in sys.path:
        sys.path.append(_folder)

# The one that this one has hidden.
_this = sys.modules.pop("sitecustomize")
try:
    import sitecustomize  # type: ignore[import-not-found]  # noqa: F401
except ImportError:
    pass
sys.modules.setdefault("sitecustomize", _this)
