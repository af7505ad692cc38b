"""Records a folder of images with a table of poses as a robot would that goes from view to view, as a bag of ROS.

The robot rests at every view for a second and then moves on; images come all the time.

usage: write_bag.py FOLDER BAG sqlite3|mcap [file|message|storage]
       write_bag.py FOLDER BAG.bag ros1 [bz2|lz4]
"""

import sys
from pathlib import Path

import numpy as np

from bags import Bag
from read_recordings import table

STEP_NS = 50_000_000
# Of the recording, which has twenty: each is eight images, and ten kinds of bags are read.
VIEWS = 8

folder = Path(sys.argv[1])
poses, _ = table(folder)
with Bag(Path(sys.argv[2]), *sys.argv[3:]) as bag:
    time = 1_700_000_000 * 10**9
    flange = np.eye(4)
    flange[2, 3] = 0.1
    bag.transform("/tf_static", time, "link6", "tool0", flange)
    names = list(poses)[:VIEWS]
    for view, name in enumerate(names):
        here = poses[name]
        there = poses[names[min(view + 1, len(names) - 1)]]
        for step in range(40):
            m = here.copy()
            # The second half of the time it moves.
            m[:3, 3] += (there - here)[:3, 3] * max(0, step - 20) / 20
            bag.transform("/tf", time, "base_link", "link6", m @ np.linalg.inv(flange))
            bag.joints("/joint_states", time, np.full(6, view + max(0, step - 20) / 20))
            if step % 5 == 0:
                data = (folder / name).read_bytes()
                bag.image("/camera/image/compressed", time + 3_000_000, data, "jpeg")
            time += STEP_NS
