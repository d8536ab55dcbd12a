"""Bodies as lasers see them: movers of several heights, against every ray and every edge."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from support.ray_references import cast_at_polygons
from zteam.geometry import Pose2
from zteam.kernels.simulator import BeamTable, Fans, Rays, cast_edges
from zteam.simulator.core.casting import NO_MOVER, group_shapes, make_polygons
from zteam.simulator.world.model import Obstacle, Robot, Shape

LIMIT = 9.0
BEAMS = 61


@st.composite
def polygons(draw: st.DrawFn) -> tuple[tuple[float, float], ...]:
    """A star-shaped polygon about the origin, counter-clockwise, often concave."""
    count = draw(st.integers(3, 8))
    radii = [draw(st.floats(0.1, 0.6)) for _ in range(count)]
    turn = draw(st.floats(0.0, 1.0))
    angles = [turn + math.tau * i / count for i in range(count)]
    return tuple((r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles, strict=True))


@given(
    bodies=st.lists(
        st.tuples(polygons(), st.floats(-4, 4), st.floats(-4, 4), st.floats(-7, 7), st.sampled_from([0.1, 0.2, 0.5])),
        min_size=1,
        max_size=45,
    ),
    fov=st.sampled_from([math.radians(d) for d in (20, 180, 270, 360)]),
    yaw=st.floats(-7.0, 7.0),
    inside=st.booleans(),
)
@examples(150)
def test_bodies_are_seen_exactly(
    bodies: list[tuple[tuple[tuple[float, float], ...], float, float, float, float]],
    fov: float,
    yaw: float,
    inside: bool,
) -> None:
    """Each beam of a sensor among up to 45 bodies of three heights reads what brute force says."""
    robots = [
        Robot(f"r{i}", "r", Pose2(x, y, a), (Shape(points, 0.0, high),), ())
        for i, (points, x, y, a, high) in enumerate(bodies[:-1])
    ]
    points, x, y, _, high = bodies[-1]
    fixed = Obstacle("o", Pose2(x, y, 0.0), (Shape(points, 0.0, high), Shape(points, 0.3, 0.4)))
    groups = group_shapes(robots, [fixed])
    polygons = make_polygons(groups)
    polygons.move(np.array([robot.pose for robot in robots], float).reshape(-1, 3))
    at = (robots[0].pose.x, robots[0].pose.y) if inside and robots else (0.0123, -0.0321)
    own = 0 if inside and robots else NO_MOVER
    seen = []
    for group in groups:
        pose = Pose2(0.0, 0.0, 0.0) if group.owner == NO_MOVER else robots[group.owner].pose
        for shape in group.shapes:
            if shape.z_min <= 0.15 <= shape.z_max and (group.owner != own or own == NO_MOVER):
                seen.append([pose.compose(Pose2(u, v, 0.0))[:2] for u, v in shape.points])
    increment = fov / (BEAMS - 1)
    angles = -fov / 2 + increment * np.arange(BEAMS)
    beams = BeamTable(np.cos(angles)[None, :], np.sin(angles)[None, :], -fov / 2, increment, LIMIT)
    fans = Fans(Rays(np.array([[at[0]], [at[1]], [yaw]]), np.array([0.15]), np.array([own])), beams)
    fans.ranges.fill(LIMIT)
    fans.hits.fill(-1)
    cast_edges(polygons, fans)
    assert ((fans.hits >= 0) == (fans.ranges < LIMIT)).all()
    # A ray past a corner may be said to touch it or not; a hair beside it decides the same way.
    near = [
        cast_at_polygons(seen, (*at, yaw + turn), np.cos(angles), np.sin(angles), LIMIT) for turn in (0.0, -1e-8, 1e-8)
    ]
    assert (np.abs(fans.ranges[0] - near).min(axis=0) <= 1e-6).all()
