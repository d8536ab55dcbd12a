"""A team file with a pair of robots that keeps driving, and starts again what fails."""

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
