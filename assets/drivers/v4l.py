# /// script
# requires-python = ">=3.9"
# dependencies = ["opencv-python-headless>=4.8,<5"]
# ///
"""A driver of Handeye Workbench that reads a USB camera, or another one of Video4Linux, through OpenCV (docs/drivers/v4l.md).

    handeye driver v4l --device /dev/video2 --size 1280x720 --rate 15

It is a camera alone: the robot is another driver, or its poses are typed.
"""

import errno
import glob
import os

from handeye_driver import Fault, parser, serve, size, within

# Formats that are read, the least lossy ones first, since JPEG blurs the edges of corners; and how they are sent.
# OpenCV returns colours as blue, green, red.
FORMATS = {"RGB3": "bgr8", "YUYV": "bgr8", "GREY": "mono8", "MJPG": "jpeg"}
# Larger than any: the kernel takes the nearest that the camera has.
LARGEST = (16_384, 16_384)
# Longest wait for a frame [s]: a camera that has to adapt to the dark is slow with the first.
PATIENCE_S = 5
# Assumed time between two frames [s] if the device does not report it: longer than that of any usual camera, so that the
# stated uncertainty of stamps is not too small.
SLOW_S = 0.1
# Consecutive incomplete frames before the driver gives up.
MOST_BROKEN = 100


class V4l:
    def __init__(self, options):
        self.options = options
        self.device = options.device
        self.camera = self.encoding = self.size = self.interval_s = None

    def open(self, outlet):
        self.check_device()
        os.environ["OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT"] = str(PATIENCE_S)
        import cv2

        self.cv2 = cv2
        self.camera = cv2.VideoCapture(self.device, cv2.CAP_V4L2)
        if not self.camera.isOpened():
            raise Fault(
                f"{self.device} is no camera that sends images to a program, or is used by another one, and a camera serves one at a "
                f"time (fuser -v {self.device} says which it is). {others()}"
            )
        name = self.choose()
        if self.options.rate:
            self.camera.set(cv2.CAP_PROP_FPS, self.options.rate)
        rate = self.camera.get(cv2.CAP_PROP_FPS)
        self.interval_s = 1 / rate if 0.1 <= rate <= 10_000 else SLOW_S
        width, height = self.size
        outlet.log("info", f"{name} of {width}x{height}, {1 / self.interval_s:.1f} a second")
        camera = {"width": width, "height": height}
        return {"name": f"camera at {self.device}", "clock": "monotonic", "can": ["image"], "camera": camera}

    def check_device(self):
        """What the system says of the device, which OpenCV does not."""
        try:
            os.close(os.open(self.device, os.O_RDWR))
        except OSError as error:
            raise Fault(trouble(self.device, error)) from None

    def choose(self):
        """Sets format and size as they are wished, or the largest of the format that loses least; gives the format."""
        cv2, camera = self.cv2, self.camera
        width, height = self.options.size or LARGEST
        given = []
        for name in [self.options.format] if self.options.format else FORMATS:
            camera.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter_fourcc(*name))
            camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
            code = int(camera.get(cv2.CAP_PROP_FOURCC))
            taken = "".join(chr(code >> shift & 0xFF) for shift in (0, 8, 16, 24))
            found = (int(camera.get(cv2.CAP_PROP_FRAME_WIDTH)), int(camera.get(cv2.CAP_PROP_FRAME_HEIGHT)))
            if taken == name and (self.options.size is None or found == self.options.size):
                # A JPEG is kept as it is, and grey is not converted to colour.
                camera.set(cv2.CAP_PROP_CONVERT_RGB, FORMATS[name] == "bgr8")
                self.encoding, self.size = FORMATS[name], found
                return name
            given.append(f"{taken} of {found[0]}x{found[1]} for {name}")
        wanted = f" of {width}x{height}" if self.options.size else ""
        raise Fault(
            f"{self.device} offers no {self.options.format or ' or '.join(FORMATS)}{wanted}: it gives {', '.join(given)}. What it has is "
            f"listed by v4l2-ctl --list-formats-ext -d {self.device}"
        )

    def run(self, outlet):
        broken, is_told = 0, False
        while not outlet.ended.is_set():
            is_read, frame = self.camera.read()
            arrived_s = outlet.own_time()
            if not is_read:
                raise Fault(self.lost())
            try:
                data = bytes_of(frame, self.encoding, self.size)
            except ValueError as why:
                broken += 1
                if broken == MOST_BROKEN:
                    raise Fault(f"{MOST_BROKEN} frames in a row are not whole: {why}") from None
                if broken == 1:
                    outlet.log("warn", f"{why}; it is left out")
                continue
            broken = 0
            stamp_s = self.camera.get(self.cv2.CAP_PROP_POS_MSEC) / 1000
            middle_s, uncertainty_s, is_stamped = exposure(stamp_s, arrived_s, self.interval_s)
            if not is_stamped and not is_told:
                is_told = True
                outlet.log("warn", "the kernel does not stamp its frames with its steady clock: when they arrive counts")
            width, height = self.size
            stated = {"stamp": middle_s, "stamp_uncertainty_s": uncertainty_s, "width": width, "height": height}
            outlet.image(data, **stated, encoding=self.encoding)

    def lost(self):
        if not os.path.exists(self.device):
            return f"{self.device} was unplugged, or its driver gave it up. {others()}"
        return (
            f"{self.device} has sent no frame for {PATIENCE_S} s: another program uses it, a cable or a hub loses data, or the USB port "
            "has not enough power or bandwidth for this size and rate"
        )


def bytes_of(frame, encoding, image_size):
    """The bytes of a frame as they are sent. ValueError for one that is not whole: the next one may be."""
    width, height = image_size
    data = frame.tobytes()
    if encoding == "jpeg":
        # A frame that is truncated in the USB transfer has no end marker; some cameras fill up the buffer after it.
        end = data.rfind(b"\xff\xd9")
        if not data.startswith(b"\xff\xd8") or end < 0:
            raise ValueError(f"a frame of {len(data)} bytes is no whole JPEG")
        return data[: end + 2]
    need = width * height * (1 if encoding == "mono8" else 3)
    if len(data) != need:
        raise ValueError(f"a frame has {len(data)} bytes, and {width}×{height} needs {need}")
    return data


def exposure(stamp_s, arrived_s, interval_s):
    """The middle of the exposure, within ± how much, and whether the kernel's stamp says it.

    With frames every interval the exposure is at most that long, and so is reading out the sensor. OpenCV does not say whether
    the stamp is that of the begin, or of the first packet, which is within an interval of the middle, or that of the end, which
    is up to two intervals behind it. What arrives may have waited for another one.
    """
    if 0 <= arrived_s - stamp_s < PATIENCE_S:
        return stamp_s - 0.5 * interval_s, 1.5 * interval_s, True
    return arrived_s - 1.5 * interval_s, 1.5 * interval_s, False


def others():
    """The devices that there are."""

    def named(device):
        try:
            with open(f"/sys/class/video4linux/{os.path.basename(device)}/name", encoding="utf-8") as file:
                return f"{device} ({file.read().strip()})"
        except OSError:
            return device

    devices = [named(device) for device in sorted(glob.glob("/dev/video*"))]
    if not devices:
        return "There is no /dev/video* at all: plug the camera in, and look at what the kernel says of it (dmesg)"
    return f"There are {', '.join(devices)}: say which with --device"


def trouble(device, error):
    """Why a device cannot be opened, and what to do."""
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return f"there is no {device}. {others()}"
    if error.errno in (errno.EACCES, errno.EPERM):
        return (
            f"{device} may not be opened by this user: cameras belong to the group `video`. Add the user to it (sudo usermod -aG "
            "video $USER) and log in again"
        )
    if error.errno == errno.EBUSY:
        return f"{device} is used by another program, and a camera serves one at a time: end that one (fuser -v {device} says which it is)"
    return f"{device} cannot be opened: {error.strerror}"


def main():
    options = parser(__doc__)
    options.add_argument("--device", metavar="FILE", default="/dev/video0", help="the camera, /dev/video0 if not given")
    options.add_argument("--size", metavar="WIDTHxHEIGHT", type=size, help="size of the images; the largest of the format if not given")
    options.add_argument(
        "--format", type=str.upper, choices=FORMATS, help="the first of these that the camera offers in this size if not given"
    )
    options.add_argument("--rate", metavar="HZ", type=within(1, 1000, int), help="images a second; the camera's choice if not given")
    serve(V4l(options.parse_args()))


if __name__ == "__main__":
    main()
