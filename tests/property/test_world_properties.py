"""Properties of zteam.world: printing and parsing agree, and no text does harm."""

import math
import string
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from support.examples import examples
from zteam.errors import WorldError
from zteam.geometry import convex_hull, signed_area
from zteam.simulator.world.bodies import Block, fit_blocks, is_simple, rectangles
from zteam.simulator.world.parser import Entity, Property, parse_text
from zteam.simulator.world.properties import Size3
from zteam.simulator.world.text import Remarks, TextPlace
from zteam.world import load_world

PLACE = TextPlace("", 0, 0)

names = (
    st.tuples(
        st.sampled_from(string.ascii_letters), st.text(string.ascii_letters + string.digits + "._-[]", max_size=8)
    )
    .map("".join)
    .filter(lambda name: name not in ("include", "define"))
)
numbers = st.floats(allow_nan=False, allow_infinity=False)
strings = st.text(st.characters(codec="utf-8", exclude_characters='"\n\r'), max_size=12)
values = numbers | strings


def make_entity(type_: str, found: dict[str, list[float | str]], children: list[Entity]) -> Entity:
    properties = {name: Property(name, tuple(items), PLACE, tuple(map(str, items))) for name, items in found.items()}
    return Entity(type_, type_, PLACE, properties, children)


entities = st.recursive(
    st.builds(make_entity, names, st.dictionaries(names, st.lists(values, max_size=4), max_size=4), st.just([])),
    lambda inner: st.builds(
        make_entity,
        names,
        st.dictionaries(names, st.lists(values, max_size=4), max_size=3),
        st.lists(inner, max_size=3),
    ),
    max_leaves=12,
)


def print_property(found: Property) -> str:
    items = [f'"{value}"' if isinstance(value, str) else repr(value) for value in found.values]
    return f"{found.name} [ {' '.join(items)} ]" if len(items) != 1 else f"{found.name} {items[0]}"


def print_body(entity: Entity) -> str:
    """The text of an entity's properties and children."""
    return "\n".join(
        [*map(print_property, entity.properties.values())]
        + [f"{child.name} # a comment (\n(\n{print_body(child)}\n)" for child in entity.children]
    )


def content(entity: Entity) -> object:
    """All of an entity but its places."""
    return (
        entity.type,
        {name: found.values for name, found in entity.properties.items()},
        [content(child) for child in entity.children],
    )


def parse(text: str) -> Entity:
    return parse_text(text, Remarks(), "test.world").root


@given(entities)
def test_a_printed_tree_parses_to_itself(tree: Entity) -> None:
    """Whatever tree is printed in the language's grammar, the parser gives it back: names, values, order."""
    tree.name = tree.type = "world"
    assert content(parse(print_body(tree))) == content(tree)


@given(entities, entities)
def test_a_macro_is_its_body_written_in_place(macro: Entity, instance: Entity) -> None:
    """Using a macro equals writing its body before the instance's own, whatever the two contain."""
    macro.type, instance.type = "model", "model"
    by_macro = parse(f"define Macro model ( {print_body(macro)}\n)\nMacro ( {print_body(instance)}\n)")
    in_place = parse(f"model ( {print_body(macro)}\n{print_body(instance)}\n)")
    assert content(by_macro.children[0]) == content(in_place.children[0])


lengths = st.sampled_from([0.0, 1e-9, 0.1, 1.0, -1.0, 90.0, 1e7, 1e9]) | st.floats(0, 1e6) | st.floats(-1e6, 1e6)
tuples = st.lists(lengths, min_size=8, max_size=8)
model_properties = st.dictionaries(
    st.sampled_from(
        [
            *("pose", "size", "origin", "boundary", "noblocks", "stack_children", "ranger_return", "mass", "wheelbase"),
            *("velocity_bounds", "acceleration_bounds", "odom_error", "range_max", "samples", "fov", "color_rgba"),
        ]
    ),
    tuples,
    max_size=4,
)
sensors = st.builds(
    make_entity,
    st.just("sensor"),
    st.dictionaries(st.sampled_from(["pose", "size", "range", "fov", "samples", "noise"]), tuples, max_size=3),
    st.just([]),
)
blocks = st.lists(st.lists(lengths, min_size=2, max_size=2), min_size=3, max_size=6).map(
    lambda corners: make_entity(
        "block", {"points": [len(corners)]} | {f"point[{i}]": list(c) for i, c in enumerate(corners)}, []
    )
)
types = st.sampled_from(["model", "position", "ranger", "laser", "camera", "gripper"])
models = st.recursive(
    st.builds(make_entity, types, model_properties, st.lists(blocks, max_size=2))
    | st.builds(make_entity, st.sampled_from(["ranger", "laser"]), model_properties, st.lists(sensors, max_size=2)),
    lambda inner: st.builds(make_entity, types, model_properties, st.lists(inner, max_size=3)),
    max_leaves=6,
)


@examples(200)
@given(st.lists(models, max_size=4))
def test_models_with_any_numbers_are_finite_or_a_world_error(trees: list[Entity]) -> None:
    """Well-formed models with odd numbers give a world of finite numbers and sound shapes."""
    text = print_body(make_entity("world", {}, trees))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "w.world"
        path.write_text(text + "\nposition ()")
        try:
            world = load_world(path)
        except WorldError as error:
            assert str(error).startswith(f"{path}:")
            return
    for robot in world.robots:
        assert all(map(math.isfinite, robot.pose))
        for ranger in robot.rangers:
            assert all(map(math.isfinite, (ranger.x, ranger.y, ranger.z, ranger.yaw, ranger.range_max, *ranger.noise)))
            assert ranger.samples >= 1 and 0 <= ranger.fov <= math.tau + 1e-9
    for shape in (shape for owner in (*world.robots, *world.obstacles) for shape in owner.shapes):
        assert np.isfinite(shape.points).all()
        assert len(shape.points) >= 3 and signed_area(shape.points) > 0
        assert math.isfinite(shape.z_min) and shape.z_min <= shape.z_max


points = st.tuples(st.integers(-8, 8), st.integers(-8, 8))


@given(st.lists(points, min_size=3, max_size=12))
def test_a_hull_is_convex_and_holds_every_point(corners: list[tuple[int, int]]) -> None:
    """No point lies outside the hull, every turn is a left turn, and an outline made of it is simple."""
    hull = convex_hull(corners)
    if len(hull) < 3:
        assert signed_area(corners) == 0
        return
    assert is_simple(hull)
    for (ax, ay), (bx, by) in zip(hull, (*hull[1:], hull[0]), strict=True):
        assert all((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0 for x, y in corners)


@given(st.lists(points, min_size=3, max_size=8, unique=True))
def test_simple_is_what_no_pair_of_edges_denies(corners: list[tuple[int, int]]) -> None:
    """The vectorised test of an outline agrees with exact arithmetic on each pair of its edges."""
    n = len(corners)

    def turn(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> int:
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    def on(a: tuple[int, int], b: tuple[int, int], p: tuple[int, int]) -> bool:
        return turn(a, b, p) == 0 and all(min(a[k], b[k]) <= p[k] <= max(a[k], b[k]) for k in (0, 1))

    def meets(i: int, j: int) -> bool:
        a, b, c, d = corners[i], corners[(i + 1) % n], corners[j], corners[(j + 1) % n]
        if (i + 1) % n == j or (j + 1) % n == i:
            # Neighbours meet beyond their corner only if one folds back on the other.
            mine, other = (a, d) if b == c else (b, c)
            return on(c, d, mine) or on(a, b, other)
        crossing = turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0
        return crossing or on(a, b, c) or on(a, b, d) or on(c, d, a) or on(c, d, b)

    expected = not any(meets(i, j) for i in range(n) for j in range(i + 1, n))
    assert is_simple(tuple((float(x), float(y)) for x, y in corners)) is expected


@given(st.lists(st.lists(points, min_size=3, max_size=6), min_size=1, max_size=4), st.floats(0.01, 100))
def test_fitted_blocks_fill_the_size(outlines: list[list[tuple[int, int]]], side: float) -> None:
    """Whatever the blocks, their common box is the model's size, centred; heights end at the size's z."""
    blocks = [Block(tuple(outline), 0.0, float(i + 1)) for i, outline in enumerate(outlines)]
    assume(len({x for o in outlines for x, _ in o}) > 1 and len({y for o in outlines for _, y in o}) > 1)
    fitted = fit_blocks(blocks, Size3(side, 2 * side, 3 * side))
    for axis, half in ((0, side / 2), (1, side)):
        along = [point[axis] for block in fitted for point in block.points]
        assert math.isclose(min(along), -half) and math.isclose(max(along), half)
    assert math.isclose(max(block.z_max for block in fitted), 3 * side)


@given(st.integers(0, 2**30), st.integers(1, 12), st.integers(1, 12), st.floats(0, 1))
def test_rectangles_cover_each_occupied_cell_once(seed: int, rows: int, columns: int, share: float) -> None:
    """The boxes of a bitmap are disjoint, and their union is its occupied cells."""
    grid = np.random.default_rng(seed).random((rows, columns)) < share
    covered = np.zeros((rows, columns), int)
    for bottom, top, left, right in rectangles(grid, 144) or []:
        covered[bottom:top, left:right] += 1
    assert (covered == grid).all()
