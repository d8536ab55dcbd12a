"""zteam.simulator.world.parser: entities, properties, macros, includes, and the bounds of each."""

from pathlib import Path

import pytest

from zteam.errors import WorldError
from zteam.simulator.world.parser import Document, Entity, parse_text, parse_world
from zteam.simulator.world.text import MAX_FILE_BYTES, Remarks


def parse(text: str) -> Document:
    return parse_text(text, Remarks(), "w.world")


def values(entity: Entity) -> dict[str, tuple[object, ...]]:
    return {name: found.values for name, found in entity.properties.items()}


def test_properties_are_scalars_strings_or_tuples() -> None:
    """The three kinds of values are read, and told apart; of two values of one property the last counts."""
    root = parse('a 2 a 1.5\nb "text"\nc [1 "x" -2]\nd []\n').root
    assert values(root) == {"a": (1.5,), "b": ("text",), "c": (1.0, "x", -2.0), "d": ()}


def test_entities_nest_and_a_body_may_open_on_a_later_line() -> None:
    """Children keep their order; `(` may follow after line ends and comments."""
    root = parse('model # a box\n\n(\n name "x" model(size [1 1 1]) ranger ( ) )').root
    assert [child.type for child in root.children] == ["model"]
    assert [child.type for child in root.children[0].children] == ["model", "ranger"]
    assert values(root.children[0]) == {"name": ("x",)}


def test_a_macro_is_replayed_and_overridden() -> None:
    """An instance has the macro's properties and children first, then its own, and does not change the macro."""
    text = 'define box model ( color "red" size [1 1 1] ranger() )\nbox ( color "blue" fiducial() )\nbox ()'
    box, plain = parse(text).root.children
    assert (box.name, box.type) == ("box", "model")
    assert values(box) == {"color": ("blue",), "size": (1.0, 1.0, 1.0)}
    assert [child.type for child in box.children] == ["ranger", "fiducial"]
    assert (values(plain)["color"], [child.type for child in plain.children]) == (("red",), ["ranger"])


def test_macros_of_macros_end_at_a_type() -> None:
    """A chain of definitions resolves to the type at its end; each link adds and overrides."""
    text = "define a position ( x 1 y 1 )\ndefine b a ( y 2 z 2 )\ndefine c b ( z 3 )\nc ( w 4 )"
    entity = parse(text).root.children[0]
    assert (entity.name, entity.type) == ("c", "position")
    assert values(entity) == {"x": (1.0,), "y": (2.0,), "z": (3.0,), "w": (4.0,)}


def test_a_macro_is_bound_where_it_is_used() -> None:
    """A macro may use what is defined after it, as its base and in its body; only its use needs the definition."""
    text = "define cart base ( mount ( x 1 ) )\ndefine base position ( y 1 )\ndefine mount ranger ( z 1 )\ncart ( w 1 )"
    (cart,) = parse(text).root.children
    assert (cart.type, values(cart)) == ("position", {"y": (1.0,), "w": (1.0,)})
    assert [(child.type, values(child)) for child in cart.children] == [("ranger", {"z": (1.0,), "x": (1.0,)})]


def test_a_later_macro_changes_what_an_earlier_one_means() -> None:
    """`define block model` turns the blocks of macros that are used after it into models, as in Stage."""
    text = "define cart position ( block () )\ncart ()\ndefine block model ()\ncart ()"
    assert [cart.children[0].type for cart in parse(text).root.children] == ["block", "model"]


def test_an_unused_macro_is_not_read() -> None:
    """Stage looks only for the end of a definition; a mistake in it counts where it is used, with its own place."""
    text = "define bad model ( size [1 1 )\nmodel ()\n"
    assert len(parse(text).root.children) == 1
    with pytest.raises(WorldError, match=r"w\.world:1:30: expected a number, a string or '\]' on the line of 'size'"):
        parse(text + "bad ()")


@pytest.mark.parametrize(
    "text", ["define a a ()", "define a b ()\ndefine b a ()", "define model model ()\ndefine a model ()"]
)
def test_a_macro_of_itself_is_an_error(text: str) -> None:
    """A chain without an end is refused where it is used (Stage overruns its stack)."""
    document = parse(text)
    assert document.type_of("a") == ""
    with pytest.raises(WorldError, match=r"w\.world:\d+:1: macro '\w+' is made of itself"):
        parse(text + "\na ()")


def test_a_second_definition_is_remarked_and_ignored() -> None:
    """The first definition of a macro stays, and the user is told."""
    remarks = Remarks()
    document = parse_text("define a model ( x 1 )\ndefine a model ( x 2 )\n", remarks, "w.world")
    assert values(document.expand("a")) == {"x": (1.0,)}
    assert [str(remark) for remark in remarks.all()] == [
        "w.world:2:8: macro 'a' is defined already: the first definition stays"
    ]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("model (", r"w\.world:1:7: this '\(' is never closed"),
        ("model ( size [1 1", r"w\.world:1:18: .* on the line of 'size', found the end of the file"),
        ("size [1\n1]", r"w\.world:1:8: .* on the line of 'size', found the end of the line"),
        ("size [1 # one\n]", r"w\.world:1:14: .* on the line of 'size', found the end of the line"),
        ("model ( size\n1 )", r"w\.world:1:9: 'size' has neither a value on its line nor a body"),
        ("size", r"w\.world:1:5: expected the value of 'size', found the end of the file"),
        ("size )", r"w\.world:1:6: expected the value of 'size', found '\)'"),
        ("size small", r"w\.world:1:6: expected the value of 'size', found 'small'; text needs quotes"),
        (")", r"w\.world:1:1: expected a property, an entity, 'include' or 'define', found '\)'"),
        ("model ( 1 )", r"w\.world:1:9: expected a property, an entity or '\)', found 1"),
        ("model ( define a model () )", r"w\.world:1:9: 'define' belongs at the top level"),
        ("define", r"w\.world:1:7: expected the macro's name"),
        ("define a model (", r"w\.world:1:16: this '\(' is never closed"),
        ("define a (", r"w\.world:1:10: expected the type or macro that 'a' is made of"),
        ("define a model\nx 1", r"w\.world:2:1: expected '\('"),
        ("include map.inc", r"w\.world:1:9: expected the name of the file to include"),
        ('\nname "x\n"', r"w\.world:2:6: this string is not closed on its line"),
        ("model (){", r"w\.world:1:9: unexpected character '\{'; write '\('$"),
        ("model (}", r"w\.world:1:8: unexpected character '\}'; write '\)'$"),
        ("name 'x'", r"""w\.world:1:6: unexpected character "'"; a string is quoted by "$"""),
        ("size [1;1]", r"w\.world:1:8: unexpected character ';'$"),
        *((f"a {number}", r"w\.world:1:3: .* is not a number$") for number in ("5m", "1_000", "1e", "0x10", "1.2.3m")),
        *(
            (f"a {number}", r"w\.world:1:3: .* is not a finite number$")
            for number in ("1e999", "-1e999", "+inf", "-nan", "1" * 400)
        ),
    ],
)
def test_errors_name_file_line_and_column(text: str, error: str) -> None:
    """Every kind of syntax error is one line that begins with its place."""
    with pytest.raises(WorldError, match=f"^{error}") as raised:
        parse(text)
    assert "\n" not in str(raised.value)


def test_nesting_is_bounded() -> None:
    """64 levels of entities are read, 65 are an error and not a RecursionError, also by macros around macros."""
    parse("model(" * 64 + ")" * 64)
    for deep in ("model(" * 65 + ")" * 65, "define a model ( a () a () )\na ()"):
        with pytest.raises(WorldError, match="nest deeper than 64"):
            parse(deep)
    text = "define a0 model ()\n" + "".join(f"define a{i} model ( a{i - 1}() )\n" for i in range(1, 100))
    parse(text + "a63 ()")
    for use in ("a64 ()", "a99 ()"):
        with pytest.raises(WorldError, match=r"w\.world:\d+:\d+: entities nest deeper than 64"):
            parse(text + use)


@pytest.mark.parametrize(
    ("bound", "most", "text", "use", "error"),
    [
        ("text.MAX_TOKENS", 10, "", "a 1\n" * 10, r"w\.world:4:3: more than 10 words and values"),
        (
            "parser.MAX_ENTITIES", 10_000,
            "define a0 model ()\n" + "".join(f"define a{i} model ( a{i - 1}() a{i - 1}() )\n" for i in range(1, 60)),
            "a59 ()", "more than 10000 entities once macros are expanded",
        ),
        (
            "parser.MAX_STEPS", 20_000,
            "define a0 model ( x0 1 )\n" + "".join(f"define a{i} a{i - 1} ( x{i} 1 )\n" for i in range(1, 1000)),
            "".join(f"a{i} ()\n" for i in range(1000)), "macros of macros",
        ),
    ],
    ids=["tokens", "doubling macros", "copies by macros"],
)  # fmt: skip
def test_a_small_file_does_not_make_much(
    monkeypatch: pytest.MonkeyPatch, bound: str, most: int, text: str, use: str, error: str
) -> None:
    """Words, entities of macros that use the one before twice, and copies by a long chain of macros have bounds."""
    monkeypatch.setattr(f"zteam.simulator.world.{bound}", most)
    parse(text)
    with pytest.raises(WorldError, match=error):
        parse(text + use)


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return path


def test_an_include_is_read_in_its_place(tmp_path: Path) -> None:
    """Included macros are known after the include, and errors in an included file name that file."""
    top = write(tmp_path, "w.world", 'include "a.inc" # first\na ()\n')
    write(tmp_path, "a.inc", "define a model ( x 1 )")
    assert parse_world(top, Remarks()).root.children[0].type == "model"
    write(tmp_path, "a.inc", "\n  )")
    with pytest.raises(WorldError, match=r"a\.inc:2:3: expected"):
        parse_world(top, Remarks())


def test_includes_are_relative_to_the_top_file(tmp_path: Path) -> None:
    """An included file's own includes are looked for beside the world, as in Stage, not beside itself."""
    top = write(tmp_path, "w.world", 'include "deep/a.inc"\n')
    write(tmp_path, "deep/a.inc", 'include "b.inc"\n')
    write(tmp_path, "deep/b.inc", "x 1\n")
    with pytest.raises(WorldError, match=r"deep/a\.inc:1:9: included file 'b.inc' not found"):
        parse_world(top, Remarks())
    write(tmp_path, "b.inc", "x 2\n")
    assert values(parse_world(top, Remarks()).root) == {"x": (2.0,)}


def test_stagepath_is_searched_by_base_name_and_by_the_whole_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For a file that is not beside the world. An include found there may name files beside itself, as in Stage."""
    top = write(tmp_path, "w.world", 'include "../worlds/a.inc"\n')
    write(tmp_path, "lib/a.inc", 'include "parts/b.inc"\n')
    (tmp_path / "lib" / "parts").mkdir()
    write(tmp_path, "lib/parts/b.inc", "x 4\n")
    monkeypatch.setenv("STAGEPATH", f"/nowhere:{tmp_path / 'lib'}")
    assert values(parse_world(top, Remarks()).root) == {"x": (4.0,)}


def test_a_file_may_be_included_twice_but_not_by_itself(tmp_path: Path) -> None:
    """Only an include that would never end is refused, however long its way round."""
    top = write(tmp_path, "w.world", 'include "a.inc"\ninclude "a.inc"\n')
    write(tmp_path, "a.inc", "x 1\n")
    parse_world(top, Remarks())
    write(tmp_path, "a.inc", 'include "b.inc"\n')
    write(tmp_path, "b.inc", 'include "./a.inc"\n')
    with pytest.raises(WorldError, match=r"b\.inc:1:9: './a.inc' includes itself"):
        parse_world(top, Remarks())


@pytest.mark.parametrize(("fan", "depth"), [(1, 300), (2, 12)])
def test_the_number_of_files_is_bounded(tmp_path: Path, fan: int, depth: int) -> None:
    """Includes that nest deeply, or fan out by two at every level, end at a bound."""
    for i in range(depth):
        write(tmp_path, f"{i}.inc", f'include "{i + 1}.inc"\n' * fan if i < depth - 1 else "")
    parse_world(write(tmp_path, "ok.world", f'include "{depth - 8}.inc"\n'), Remarks())
    with pytest.raises(WorldError, match="more than 256 files"):
        parse_world(write(tmp_path, "w.world", 'include "0.inc"\n'), Remarks())


def test_what_follows_an_include_on_its_line_is_ignored(tmp_path: Path) -> None:
    """Whatever it is, the rest of the line is skipped as in Stage, with a remark unless it is a comment."""
    write(tmp_path, "a.inc", "x 1")
    remarks = Remarks()
    text = 'include "a.inc"; y 1 "\ninclude "a.inc" # y 1\nz 1'
    assert values(parse_world(write(tmp_path, "w.world", text), remarks).root) == {"x": (1.0,), "z": (1.0,)}
    assert [str(remark).rpartition("/")[2] for remark in remarks.all()] == [
        "w.world:1:16: '; y 1 \"' behind an include is ignored, as Stage does"
    ]


def test_an_include_may_stand_in_a_model_and_in_a_macro(tmp_path: Path) -> None:
    """Its text stands in its place, wherever that is: an entity can be filled from a file."""
    write(tmp_path, "a.inc", "x 1 ranger ()")
    text = 'model (\ninclude "a.inc"\n)\ndefine m model (\ninclude "a.inc"\n)\nm ()'
    for entity in parse_world(write(tmp_path, "w.world", text), Remarks()).root.children:
        assert (values(entity), [child.type for child in entity.children]) == ({"x": (1.0,)}, ["ranger"])


@pytest.mark.parametrize("name", ["gone.inc", "x" * 5000, "a\0b", "."])
def test_a_missing_include_is_named(tmp_path: Path, name: str) -> None:
    """Names that no file has or can have, and folders, give the same clear error."""
    with pytest.raises(WorldError, match=r"w\.world:1:9: included file .* not found in"):
        parse_world(write(tmp_path, "w.world", f'include "{name}"'), Remarks())


def test_a_world_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    """A missing file, a folder and a file of more than 16 MB are one-line errors."""
    with pytest.raises(WorldError, match=r"gone\.world: cannot read this world file: No such file"):
        parse_world(tmp_path / "gone.world", Remarks())
    with pytest.raises(WorldError, match="cannot read this world file: Is a directory"):
        parse_world(tmp_path, Remarks())
    with pytest.raises(WorldError, match="of more than 16 MB is refused"):
        parse_world(write(tmp_path, "w.world", "#" * (MAX_FILE_BYTES + 1)), Remarks())


def test_bytes_that_are_no_utf8_are_harmless_in_comments(tmp_path: Path) -> None:
    """Old worlds have Latin-1 names in comments; a byte order mark is skipped."""
    path = tmp_path / "w.world"
    path.write_bytes(b"\xef\xbb\xbf# Andr\xe9\nx 1")
    assert values(parse_world(path, Remarks()).root) == {"x": (1.0,)}
