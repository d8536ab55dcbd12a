"""IR-SIM beside `zteam bench sim`: four robots with lasers of 270° and 30 m on a bitmap, without noise or a picture.

`python tests/bench/ir_sim.py PICTURE CELL`, in an environment with `ir-sim==2.12.*` and OPENBLAS_NUM_THREADS=1. Dark
pixels of CELL metres are walls. It prints simulated seconds a second of processor time, in steps of 0.1 s.
"""

import json
import math
import random
import sys
import tempfile
import time

import irsim
from PIL import Image

STEPS = 20
STARTS = [(x, y, 0.5 * math.pi) for x in (22.3, 23.3) for y in (11.3, 13.3)]
"""x, y and yaw: those of willow-four-erratics.world, on the map as Stage turns it."""

picture, cell = sys.argv[1], float(sys.argv[2])
columns, rows = Image.open(picture).size
laser = {"name": "lidar2d", "range_max": 30, "angle_range": 1.5 * math.pi, "number": 1081}
robot = {
    "kinematics": {"name": "diff"},
    "shape": {"name": "rectangle", "length": 0.35, "width": 0.35},
    "vel_max": [1.0, 1.0],
    "sensors": [laser],
}
world = {"width": columns * cell, "height": rows * cell, "obstacle_map": picture, "collision_mode": "stop"}
with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
    # JSON is YAML.
    robots = [{**robot, "state": start} for start in STARTS]
    json.dump({"world": {**world, "step_time": 0.1, "sample_time": 0.1}, "robot": robots}, file)
    file.flush()
    env = irsim.make(file.name, headless=True)
draw = random.Random(1)
spent = -time.process_time()
for _ in range(STEPS):
    env.step([[[0.4], [draw.uniform(-1.0, 1.0)]] for _ in STARTS])
spent += time.process_time()
print(f"{0.1 * STEPS / spent:.3g} x real time")
