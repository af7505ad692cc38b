"""A webcam in the place of OpenCV, as far as the driver of cameras asks: `YUYV` up to 640x480, `MJPG` up to 1920x1080.

Each third JPEG is cut off. Reading fails once the file that stands for the device is gone.
"""

import os
import time

CAP_V4L2 = 200
CAP_PROP_POS_MSEC, CAP_PROP_FRAME_WIDTH, CAP_PROP_FRAME_HEIGHT, CAP_PROP_FPS, CAP_PROP_FOURCC, CAP_PROP_CONVERT_RGB = range(6)
SIZES = {"YUYV": [(320, 240), (640, 480)], "MJPG": [(640, 480), (1920, 1080)]}


def VideoWriter_fourcc(*letters):
    return sum(ord(letter) << 8 * i for i, letter in enumerate(letters))


class Frame(bytes):
    def tobytes(self):
        return bytes(self)


class VideoCapture:
    def __init__(self, device, api):
        assert api == CAP_V4L2
        self.device, self.count = device, 0
        self.values = {CAP_PROP_FOURCC: VideoWriter_fourcc(*"YUYV"), CAP_PROP_FPS: 25.0, CAP_PROP_CONVERT_RGB: True}
        self.set(CAP_PROP_FRAME_WIDTH, 320)
        self.set(CAP_PROP_FRAME_HEIGHT, 240)

    def isOpened(self):
        return True

    def format(self):
        return next(name for name in SIZES if VideoWriter_fourcc(*name) == self.values[CAP_PROP_FOURCC])

    def set(self, what, value):
        if what == CAP_PROP_FOURCC and value not in [VideoWriter_fourcc(*name) for name in SIZES]:
            return False
        self.values[what] = value
        if CAP_PROP_FRAME_WIDTH in self.values and CAP_PROP_FRAME_HEIGHT in self.values:
            # The kernel takes the nearest that there is.
            wanted = self.values[CAP_PROP_FRAME_WIDTH] * self.values[CAP_PROP_FRAME_HEIGHT]
            self.size = min(SIZES[self.format()], key=lambda size: abs(size[0] * size[1] - wanted))
        return True

    def get(self, what):
        if what == CAP_PROP_POS_MSEC:
            return 1000 * self.stamp
        if what in (CAP_PROP_FRAME_WIDTH, CAP_PROP_FRAME_HEIGHT):
            return float(self.size[what - CAP_PROP_FRAME_WIDTH])
        return float(self.values[what])

    def read(self):
        time.sleep(1 / self.values[CAP_PROP_FPS])
        self.stamp = time.monotonic()
        self.count += 1
        if not os.path.exists(self.device):
            return False, None
        if self.format() == "MJPG":
            assert not self.values[CAP_PROP_CONVERT_RGB]
            return True, Frame(b"\xff\xd8JP" if self.count % 3 == 0 else b"\xff\xd8JP\xff\xd9\0\0")
        assert self.values[CAP_PROP_CONVERT_RGB]
        width, height = self.size
        return True, Frame(width * height * 3)
