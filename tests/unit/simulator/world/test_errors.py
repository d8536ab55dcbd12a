"""Values in world files that are errors."""

from pathlib import Path

import pytest

from zteam.errors import WorldError
from zteam.world import load_world


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (
            "map ()",
            r"1:1: unknown model type 'map': no type or macro has this name; 'define' it, or 'include' the file",
        ),
        ("postion ()", r"1:1: unknown model type 'postion' \(did you mean 'position'\?\)"),
        ("define erratic position ()\neratic ()", r"2:1: .* \(did you mean 'erratic'\?\)"),
        ("sensor ()", r"1:1: a sensor belongs inside a ranger"),
        ("position ( sensor () )", r"1:12: a sensor belongs inside a ranger"),
        ("block ()", r"1:1: a block belongs inside a model"),
        ("position ( size [1 1] )", r"1:12: size takes 3 numbers, not 2"),
        ("position ( size 1 )", r"1:12: size takes 3 numbers, not 1"),
        ("position ( size [-1 1 1] )", r"1:12: size must not be negative"),
        ("position ( size [1e9 1 1] )", r"1:12: size: 1e\+09 m is too large"),
        ('position ( size "big" )', r"1:12: size takes 3 numbers, not 1"),
        ('position ( size ["a" 1 1] )', r"1:12: size takes numbers, not the string 'a'"),
        ("position ( pose [1 2 3] )", r"1:12: pose takes 4 numbers, not 3"),
        ("foo ( )\ndefine foo model ( )", r"1:1: 'foo' is defined further down, at .*w\.world:2:8"),
        ("define bar foo ( )\nbar ( )\ndefine foo model ( )", r"2:1: 'foo' is defined further down, at .*w\.world:3:8"),
        ("position ( odom_error [1 0] )", r"1:12: odom_error takes 4 numbers"),
        ("position ( velocity_bounds [1 -1 0 0 0 0 0 0] )", r"1:12: .* smallest x 1 is above the largest -1"),
        ("position ( velocity_bounds [-1 1] )", r"1:12: velocity_bounds takes 8 numbers, not 2"),
        (
            "position ( ranger ( sensor ( samples -5 ) ) )",
            r"1:30: samples must be a whole number of 0 to 100000, not -5",
        ),
        ("position ( ranger ( sensor ( samples 1e6 ) ) )", r"1:30: samples .* not 1e\+06"),
        ("position ( ranger ( sensor ( fov 361 ) ) )", r"1:30: fov must be an angle of 0 to 360 degrees, not 361"),
        ("position ( ranger ( sensor ( range [0 0] ) ) )", r"1:30: the largest range must be above 0, not 0"),
        ("position ( ranger ( sensor ( noise [0 -1 0] ) ) )", r"1:30: noise must not be negative"),
        ("position ( laser ( range_max 0 ) )", r"1:20: the largest range must be above 0, not 0"),
        ('position ( drive "car" wheelbase 0 )', r"1:24: wheelbase must be above 0"),
        ("position ( name [] )", r"1:12: name takes a string"),
        ("interval_sim 0", r"1:1: interval_sim must be above 0"),
        ("interval_sim 1e6", r"1:1: interval_sim must be above 0 and at most 60000 ms"),
        ("model ( block ( points 3 point[0] [0] ) )", r"1:26: point\[0\] takes 2 numbers, not 1"),
        (
            "model ( block ( points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1] z [2 1] ) )",
            r"1:71: z: the smallest value 2 is above the largest 1",
        ),
        ('model ( bitmap "gone.png" )', r"1:9: bitmap 'gone.png' not found in .* or \$STAGEPATH"),
        ('model ( bitmap "w.world" )', r"1:9: cannot read bitmap .*w\.world: it is no PNG"),
    ],
)
def test_bad_values_are_errors_with_their_place(tmp_path: Path, text: str, error: str) -> None:
    """Every value that no robot could have is refused in one line that begins with file:line:column."""
    path = tmp_path / "w.world"
    path.write_text(text)
    with pytest.raises(WorldError, match=f"^{path}:{error}") as raised:
        load_world(path)
    assert "\n" not in str(raised.value)
