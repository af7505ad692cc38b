"""The viewer that the workbench replaces, as a peer for measurements: fetch colour and depth, convert, draw.

    pip install coppeliasim-zmqremoteapi-client==2.0.4 numpy opencv-python-headless matplotlib
    python reference_viewer.py PORT SECONDS

Does what a script for CoppeliaSim does step by step, one Python float per pixel of depth included, and prints one line
of JSON: images shown, seconds, and CPU seconds of this process.
"""

import json
import math
import resource
import struct
import sys
import time

import cv2
import matplotlib

matplotlib.use('TkAgg')
import matplotlib.pyplot as plt
import numpy as np
from coppeliasim_zmqremoteapi_client import RemoteAPIClient


def colour(sim, camera):
    data, (width, height) = sim.getVisionSensorImg(camera)
    image = np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3)
    return cv2.flip(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), 0)


def depth(sim, camera):
    data, (width, height) = sim.getVisionSensorDepth(camera, 1)
    metres = np.array(struct.unpack('%df' % (width * height), data), dtype=np.float32)
    return cv2.flip(metres.reshape(height, width), 0)


def as_colours(metres, scale=256 * 3.5 * 1000):
    value = np.clip(np.floor(metres.astype(np.float64) * scale + 0.5), 0, 2 ** 24 - 1).astype(np.uint32)
    return np.dstack([value // 65536, (value // 256) % 256, value % 256]).astype(np.uint8)


def main():
    port, seconds = int(sys.argv[1]), float(sys.argv[2])
    sim = RemoteAPIClient(port=port).require('sim')
    camera = sim.getObject('/UR5/3D_camera')
    depth_camera = sim.getObject('/UR5/3D_camera/depth')
    sim.startSimulation()

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 6))
    left.set_title('RGB img')
    right.set_title('Depth img')
    shown_colour = left.imshow(cv2.cvtColor(colour(sim, camera), cv2.COLOR_BGR2RGB))
    shown_depth = right.imshow(depth(sim, depth_camera), cmap='gray', vmin=0, vmax=3.5)
    plt.ion()
    plt.show(block=False)

    def cpu():
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return usage.ru_utime + usage.ru_stime

    frames, began, cpu_before = 0, time.monotonic(), cpu()
    while time.monotonic() - began < seconds:
        image = colour(sim, camera)
        metres = depth(sim, depth_camera)
        as_colours(metres)
        shown_colour.set_data(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
        shown_depth.set_data(metres)
        figure.canvas.flush_events()
        plt.pause(0.01)
        frames += 1
    took = time.monotonic() - began
    assert not math.isnan(took)
    print(json.dumps({'images': frames, 'seconds': took, 'cpu_seconds': cpu() - cpu_before}))


if __name__ == '__main__':
    main()
