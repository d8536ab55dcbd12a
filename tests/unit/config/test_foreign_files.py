"""Files of other programs, named where a world, a map or a team is asked for."""

import gzip
import io
import os
import zipfile
from pathlib import Path

import pytest
from PIL import Image

from zteam.config.resources import find_team
from zteam.errors import UsageError
from zteam.navigation.planning.maps import read_map
from zteam.team.file.reading import read_team_file
from zteam.world import load_world


def picture(kind: str) -> bytes:
    """A picture as a file of a kind of Pillow's."""
    file = io.BytesIO()
    Image.new("L", (4, 4), 255).save(file, kind)
    return file.getvalue()


def packed() -> bytes:
    """A zip with a world in it."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.world", "model ( )")
    return file.getvalue()


SDF = '<?xml version="1.0" ?>\n<!-- by <b>me</b> -->\n<sdf version="1.7"><world name="w"></world></sdf>\n'
FILES: list[tuple[str | bytes, str]] = [
    (SDF, "Gazebo .*world new"),
    (SDF.encode("utf-16"), "Gazebo"),
    ("\ufeff" + SDF, "Gazebo"),
    ("<mvsim_world version='1.0'>\n</mvsim_world>", "MVSim"),
    ('<robot name="r"><link name="base"/></robot>', "URDF.*description"),
    ('<launch>\n  <node pkg="stage_ros" type="stageros" name="s"/>\n</launch>', "launch file .*team file"),
    ("from launch import LaunchDescription\ndef generate_launch_description():\n    pass\n", "launch file"),
    ('<?xml version="1.0"?>\n<!DOCTYPE map SYSTEM "x.dtd">\n<map version="1.10" width="9"></map>', "Tiled.*world new"),
    ('<svg xmlns="http://www.w3.org/2000/svg"/>', "SVG.*world new"),
    ("<!DOCTYPE html>\n<html><body>404</body></html>", "web page.*download"),
    ("<COLLADA/>", "XML"),
    ("WorldInfo {\n  gravity 9.81\n}\n", "Webots"),
    ("  0\nSECTION\n  2\nHEADER\n", "a drawing.*PNG"),
    ('"""My robot."""\n\nfrom zteam import Behavior\n', "Python.*behavior"),
    ("#VRML_SIM R2023b utf8\nWorldInfo {\n}\n", "Webots"),
    ("# a lab\nworld:\n  height: 10\nrobot:\n  - kinematics: {name: 'diff'}\nobstacle:\n  - number: 5\n", "IR-SIM"),
    ("properties: {}\nlayers:\n  - name: '2d'\n    map: 'map.yaml'\nmodels: []\n", "flatland.*image and resolution"),
    (
        '# Player\ndriver\n(\n  name "stage"\n  provides [ "simulation:0" ]\n  worldfile "x.world"\n)\n',
        "Player.*worldfile",
    ),
    ('{"world": {}}', "JSON|key image is missing"),
    ("# a lab\nworld:  # its size\n  height: 10\n", "IR-SIM"),
    ("world: {height: 10, width: 10}\r\nrobot: []\r\n", "IR-SIM"),
    ("<HTML><BODY>404</BODY></HTML>", "web page"),
    (picture("TIFF"), "a drawing or a picture.*save it as a PNG"),
    (picture("WEBP"), "a drawing or a picture.*save it as a PNG"),
    (picture("PNG"), "a picture.*world new .* --resolution"),
    ("P2 2 1 255\n0 255\n", "a picture.*world new"),
    (packed(), "unpack"),
    (gzip.compress(b"model ( )"), "unpack"),
    (b"%PDF-1.7\n", "a drawing.*PNG"),
    ("version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
    ("model ( )\n".encode("utf-16-le"), "a binary file"),
    ("amcl:\n  ros__parameters:\n    alpha1: 0.2\n", "a YAML.*a team file is TOML|key image is missing"),
    ("Panels:\n  - Class: rviz_common/Displays\n", "a YAML|key image is missing"),
    ("999\ndxfrw 0.6.3\n0\nSECTION\n2\nHEADER\n", "a drawing"),
    ("solid part\n  facet normal 0 0 1\n    outer loop\n", "a mesh"),
    ("# CARMEN Logfile\nPARAM robot_frontlaser_offset 0.0 nohost 0\n", "CARMEN"),
    ("# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n", "a point cloud"),
    ("#usda 1.0\n", "a point cloud"),
    (b"#ROSBAG V2.0\n", "or a recording"),
    ('<!DOCTYPE x [ <!ENTITY a "<b>"> ]>\n<sdf version="1.7"/>', "Gazebo"),
]


@pytest.mark.parametrize(("content", "text"), FILES, ids=[text for _, text in FILES])
def test_a_file_of_another_program_is_told_as_what_it_is(tmp_path: Path, content: str | bytes, text: str) -> None:
    """Whatever its name is and whatever reads it: one line with the file, what it is, and what to do."""
    data = content if isinstance(content, bytes) else content.encode()
    readers = ("x.world", load_world), ("x.yaml", load_world), ("x.yaml", read_map), ("x.toml", read_team_file)
    for name, read in readers:
        (tmp_path / name).write_bytes(data)
        with pytest.raises(UsageError, match=text) as caught:
            read(tmp_path / name)
        message = str(caught.value)
        assert message.startswith(f"{tmp_path / name}: ") and "not YAML" not in message and message.count("\n") == 0


def test_a_pipe_is_left_to_its_reader(tmp_path: Path) -> None:
    """Looking into it would take its text away, or wait for one that never comes."""
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(UsageError, match="no such file"):
        find_team(tmp_path / "pipe.toml")


def test_what_zteam_reads_itself_is_not_foreign(tmp_path: Path) -> None:
    """A macro may be called `driver`, a map is one of map_server under its own ending only, also as JSON, and no team
    file at all."""
    (tmp_path / "a.world").write_text("define driver model ( size [1 1 1] )\ndriver ( pose [0 0 0 0] )\n")
    assert len(load_world(tmp_path / "a.world").obstacles) == 1
    Image.new("L", (4, 4), 255).save(tmp_path / "m.png")
    for name in ("m.yaml", "m.world", "m.toml"):
        (tmp_path / name).write_text("image: m.png\nresolution: 0.1\norigin: [0, 0, 0]\n")
    assert load_world(tmp_path / "m.yaml").floorplans[0].cell == (0.1, 0.1)
    (tmp_path / "j.yaml").write_text('{"image": "m.png", "resolution": 0.2}')
    assert load_world(tmp_path / "j.yaml").floorplans[0].cell == (0.2, 0.2)
    for read, name in ((load_world, "m.world"), (read_team_file, "m.toml")):
        with pytest.raises(UsageError, match=r"a map of map_server, .*named \*\.yaml"):
            read(tmp_path / name)


ROBOT = '[[robots]]\nid = 0\nbehavior = "wander"\n'
PROGRAM = '\n[[nodes]]\nname = "n"\ncommand = ["python", "-c", """\nimport time\nlayers:\nworld:\n"""]\n'
MAP = "image: m.png\nresolution: 0.1\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("t.toml", "# [world]\n" + ROBOT),
        ("t.toml", "# generate_launch_description\n" + ROBOT + PROGRAM),
        ("t.toml", "# <launch>\n# import time\n" + ROBOT),
        ("a.world", "# def generate_launch_description():\nmodel ( size [1 1 1] )\n"),
        ("a.world", "# P1\ndefine P1 model ( size [1 1 1] )\nP1 ( )\n"),
        ("a.world", "# CARMEN log\nmodel ( size [1 1 1] )\n"),
        ("m.yaml", "# generate_launch_description\n---\n" + MAP),
        ("m.yaml", "layers:\nworld:\n" + MAP),
        ("m.yaml", "size: &size 0.1\nimage: m.png\nresolution: *size\norigin: [&x 0, *x, *x]\n"),
    ],
)
def test_words_of_other_programs_do_not_make_a_file_foreign(tmp_path: Path, name: str, text: str) -> None:
    """Whatever its comments, texts, macros and other keys are, a file that its own reader takes is taken."""
    Image.new("L", (4, 4), 255).save(tmp_path / "m.png")
    (tmp_path / name).write_text(text)
    if name == "t.toml":
        assert len(read_team_file(tmp_path / name).team.robots) == 1
    else:
        world = load_world(tmp_path / name)
        assert len(world.floorplans) + len(world.obstacles) == 1


def test_a_mistake_in_a_team_file_is_told_with_its_line(tmp_path: Path) -> None:
    """Also where the file has a program in it."""
    (tmp_path / "t.toml").write_text(ROBOT + PROGRAM + "x = wander\n")
    with pytest.raises(UsageError, match=r"t\.toml:\d+:\d+: not TOML: Invalid value"):
        read_team_file(tmp_path / "t.toml")
