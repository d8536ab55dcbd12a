"""zteam.world: what a world file must not say."""

from pathlib import Path

import pytest

from zteam.errors import WorldError
from zteam.world import load_world


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("model ()", r"1:1: this world has no robot"),
        ("map ()", r"1:1: unknown model type 'map'"),
        ("postion ()", r"1:1: unknown model type 'postion' \(did you mean 'position'\?\)"),
        ("define erratic position ()\neratic ()", r"2:1: .* \(did you mean 'erratic'\?\)"),
        ("sensor ()", r"1:1: a sensor belongs inside a ranger"),
        ("position ( sensor () )", r"1:12: a sensor belongs inside a ranger"),
        ("block ()", r"1:1: a block belongs inside a model"),
        ("position ( size [1 1] )", r"1:12: size takes 3 numbers, not 2"),
        ("position ( size 1 )", r"1:12: size takes 3 numbers, not 1"),
        ("position ( size [0 1 1] )", r"1:12: a body needs a size above 0"),
        ("position ( size [-1 1 1] )", r"1:12: size must not be negative"),
        ("position ( size [1e7 1 1] )", r"1:12: size: 1e\+07 m is too large"),
        ('position ( size "big" )', r"1:12: size takes 3 numbers, not 1"),
        ('position ( size ["a" 1 1] )', r"1:12: size takes numbers, not the string 'a'"),
        ("position ( pose [1 2 3] )", r"1:12: pose takes 4 numbers, not 3"),
        ("position ( name 5 )", r"1:12: name takes a string in quotes"),
        ('position ( name ["a" "b"] )', r"1:12: name takes a string in quotes"),
        ('position ( drive "tracks" )', r"1:12: drive must be one of diff, omni, car, not 'tracks'"),
        ('position ( localization "gsp" )', r"1:12: localization must be one of gps, odom"),
        ("position ( wheelbase 0 )", r"1:12: wheelbase must be above 0"),
        ("position ( mass -1 )", r"1:12: mass must be above 0"),
        ("position ( odom_error [-1 0 0 0] )", r"1:12: odom_error must not be negative"),
        ("position ( odom_error [1 0] )", r"1:12: odom_error takes 4 numbers"),
        ("position ( velocity_bounds [1 -1 0 0 0 0 0 0] )", r"1:12: .* smallest x 1 is above the largest -1"),
        ("position ( velocity_bounds [-1 1] )", r"1:12: velocity_bounds takes 8 numbers, not 2"),
        ("position ( ranger ( sensor ( samples 0 ) ) )", r"1:30: samples must be a whole number of 1 to 100000"),
        ("position ( ranger ( sensor ( samples -5 ) ) )", r"1:30: samples must be a whole number"),
        ("position ( ranger ( sensor ( samples 1e6 ) ) )", r"1:30: samples .* not 1e\+06"),
        ("position ( ranger ( sensor ( samples 2.5 ) ) )", r"1:30: samples .* not 2.5"),
        ("position ( ranger ( sensor ( fov 361 ) ) )", r"1:30: fov must be an angle of 0 to 360 degrees, not 361"),
        ("position ( ranger ( sensor ( samples 2 fov 0 ) ) )", r"1:40: 2 samples need a fov above 0"),
        ("position ( ranger ( sensor ( range [2 1] ) ) )", r"1:30: range: the smallest value 2 is above"),
        ("position ( ranger ( sensor ( range [-1 1] ) ) )", r"1:30: range \[-1 1\] must be two distances"),
        ("position ( ranger ( sensor ( range [0 0] ) ) )", r"1:30: range \[0 0\] must be two distances"),
        ("position ( ranger ( sensor ( noise [0 -1 0] ) ) )", r"1:30: noise must not be negative"),
        ("position ( laser ( range_max 0 ) )", r"1:20: range_min 0 and range_max 0 must be two distances"),
        ("interval_sim 0", r"1:1: interval_sim must be above 0"),
        ("interval_sim 1e6", r"1:1: interval_sim must be above 0 and at most 60000 ms"),
        ('unit_length "inch"', r"1:1: unit_length must be one of m, cm, mm, not 'inch'"),
        ("model ( block ( points 2 ) )", r"1:17: points must be a whole number of 3 to 256"),
        ("model ( block ( points 3 point[0] [0 0] ) )", r"1:9: a block of 3 points lacks point\[1\]"),
        ("model ( block ( points 3 point[0] [0] ) )", r"1:26: point\[0\] takes 2 numbers, not 1"),
        (
            "model ( block ( points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1] z [2 1] ) )",
            r"1:71: z: the smallest value 2 is above the largest 1",
        ),
        (
            "model ( block ( points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1] z [0 0] ) )",
            r"1:1: the blocks of a model must have an extent",
        ),
        ('model ( bitmap "gone.png" )', r"1:9: bitmap 'gone.png' not found in .* or \$STAGEPATH"),
        ('model ( bitmap "w.world" )', r"1:9: bitmap .*w\.world is not a PGM"),
        ("model ( bitmap 5 )", r"1:9: bitmap takes a string in quotes"),
    ],
)
def test_bad_values_are_errors_with_their_place(tmp_path: Path, text: str, error: str) -> None:
    """Every value that no robot could have is refused in one line that begins with file:line:column."""
    path = tmp_path / "w.world"
    path.write_text(text)
    with pytest.raises(WorldError, match=f"^{path}:{error}") as raised:
        load_world(path)
    assert "\n" not in str(raised.value)
