"""Team files with a pair and a line of robots that keep driving, and start again what fails."""

PAIR = """
[team]
world = "office.world"
world_robots = false
[defaults]
model = "erratic"
restart = "on-failure"
[[robots]]
id = 0
pose = [24.0, 25.0, 0.0]
behavior = "path"
speed = 0.4
waypoints = [[24.0, 25.0], [41.9, 25.0], [41.9, 41.9], [8.3, 41.9], [8.3, 25.0]]
loop = true
[[robots]]
id = 1
follow = 0
pose = [23.0, 25.0, 0.0]
"""

LINE = PAIR + "".join(
    f"""[[robots]]
id = {i}
follow = {i - 1}
pose = [{24.0 - i}, 25.0, 0.0]
"""
    for i in (2, 3)
)
"""Four robots."""
