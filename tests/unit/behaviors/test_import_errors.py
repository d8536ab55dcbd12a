"""What a user hears of a module that cannot be imported."""

import importlib
from pathlib import Path

import pytest

from zteam.behaviors.import_errors import explain


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import nothere\n", "ModuleNotFoundError: No module named 'nothere' (is it beside the team file, in the "),
        ("x = 1\n1 / 0\n", "robots_of_mine.py:2: ZeroDivisionError: division by zero"),
        ("import json\njson.loads('{')\n", "robots_of_mine.py:2: JSONDecodeError: Expecting property name"),
        ("def f(:\n", "SyntaxError: invalid syntax (robots_of_mine.py, line 1)"),
        (
            "def f():\n\tx = 1\n        return x\n",
            "TabError: inconsistent use of tabs and spaces in indentation (robots",
        ),
        (
            "import rospy\n",
            "robots_of_mine.py:1: ModuleNotFoundError: No module named 'rospy' (zteam works without ROS: ",
        ),
        ("from geometry_msgs.msg import Twist\n", "(zteam works without ROS: its message types are in zteam.messages)"),
        ("from zteam import Twist\n", "(from zteam.messages import Twist)"),
        ("from zteam import Behaviour\n", " (did you mean Behavior?)"),
        ("raise SystemExit\n", "robots_of_mine.py:1: SystemExit"),
    ],
)
def test_an_error_names_the_users_line_and_the_way_out(text: str, told: str, empty_folder: Path) -> None:
    """One line: where in the user's file, what, and what to write instead."""
    (empty_folder / "robots_of_mine.py").write_text(text)
    with pytest.raises(BaseException) as caught:
        importlib.import_module("robots_of_mine")
    line = explain(caught.value)
    assert told in line
    assert "\n" not in line
