# /// script
# requires-python = ">=3.9"
# dependencies = ["pyrealsense2>=2.56,<2.60", "numpy<3"]
# ///
"""A driver for RealSense cameras. It has not been run with a camera: it is checked with software devices of librealsense.

It reads colours, their lens and the depth that belongs to them (docs/drivers/realsense.md).

    handeye driver realsense --size 1280x720 --exposure 100

It is a camera alone: the robot is another driver, or its poses are typed.
"""

import glob
import sys
import threading
import time

from handeye_driver import Fault, parser, serve, size, within

# Images a second without --rate, at most: more take bandwidth and light, and are not looked at.
USUAL_HZ = 30
# Longest wait for a frame [s], and of one step of it [ms].
PATIENCE_S, STEP_MS = 5, 500
# Where Linux names what is plugged in.
USB = "/sys/bus/usb/devices/*/product"


class RealSense:
    def __init__(self, options):
        self.options = options
        self.rs = self.context = self.device = self.pipeline = self.queue = self.align = None
        self.name = self.size = self.interval_s = None
        self.is_gone = threading.Event()
        self.is_told = False

    def open(self, outlet):
        self.rs = library()
        try:
            self.context = self.rs.context()
            self.device = self.find()
            return self.start(outlet)
        except RuntimeError as error:  # librealsense has no more specific one
            raise Fault(trouble(error)) from error

    def find(self):
        """The camera that is asked for, or the only one."""
        # One whose firmware is being updated has no serial number.
        serial_number = self.rs.camera_info.serial_number
        devices = [device for device in self.context.query_devices() if device.supports(serial_number)]
        if not devices:
            raise Fault(nothing())
        wanted = self.options.serial
        found = [device for device in devices if wanted in (None, device.get_info(serial_number))]
        if len(found) == 1:
            return found[0]
        there = ", ".join(f"{self.named(device)} with --serial {device.get_info(serial_number)}" for device in devices)
        if found:
            raise Fault(f"several cameras are connected: say which. There are {there}")
        raise Fault(f"no camera {wanted} is connected. There are {there}")

    def named(self, device):
        info = self.rs.camera_info.name
        return device.get_info(info) if device.supports(info) else "a camera without a name"

    def start(self, outlet):
        rs, device = self.rs, self.device
        self.name = f"{self.named(device)}, serial number {device.get_info(rs.camera_info.serial_number)}"
        self.context.set_devices_changed_callback(self.changed)
        sensor, colour, depth = self.choose()
        self.set_up(sensor, outlet)
        lens, why = lens_of(colour.get_intrinsics())
        if lens is None:
            outlet.log("warn", f"{why}: the lens is not sent, and has to be estimated or given")
        if depth and (lens is None or "distortion" in lens):
            # On most processors: sse-align.cpp computes the modified Brown-Conrady model alone.
            depth = None
            outlet.log("warn", "librealsense aligns depth as if no lens had distortion, which this one may: no depth is sent")
        config = rs.config()
        chosen = [profile for profile in (colour, depth) if profile]
        for profile in chosen:
            config.enable_stream(
                profile.stream_type(), profile.stream_index(), profile.width(), profile.height(), profile.format(), profile.fps()
            )
        # The pipeline starts again by itself what was plugged in again, without the exposure: so its frames are taken by a queue.
        self.pipeline, self.queue = rs.pipeline(self.context), rs.frame_queue(1)
        self.pipeline.set_device(device)
        self.pipeline.start(config, self.queue)
        self.size, self.interval_s = (colour.width(), colour.height()), 1 / colour.fps()
        if depth:
            self.align = rs.align(rs.stream.color)
        outlet.log("info", f"{self.name}: {' and '.join(map(described, chosen))}")
        usb = rs.camera_info.usb_type_descriptor
        if device.supports(usb) and device.get_info(usb).startswith("2"):
            outlet.log("warn", "it is connected by USB 2, which has few sizes and rates: use a USB 3 port, and its own cable")
        width, height = self.size
        camera = {"width": width, "height": height, **({"intrinsics": lens} if lens else {})}
        return {"name": self.name, "clock": "monotonic", "can": ["image", *(["depth"] if depth else [])], "camera": camera}

    def choose(self):
        """The sensor of the colours, and the profiles of colours and depth: as they are wished, or the largest."""
        rs, options = self.rs, self.options
        profiles = [
            (sensor, profile.as_video_stream_profile())
            for sensor in self.device.query_sensors()
            for profile in sensor.get_stream_profiles()
            if profile.is_video_stream_profile()
        ]
        # librealsense makes rgb8 of what the camera sends uncompressed.
        colours = [(s, p) for s, p in profiles if p.stream_type() == rs.stream.color and p.format() == rs.format.rgb8]
        if not colours:
            raise Fault(f"{self.name} sends no colours: there is nothing to calibrate")
        fitting = [(s, p) for s, p in colours if options.size in (None, (p.width(), p.height()))]
        fitting = [(s, p) for s, p in fitting if options.rate in (None, p.fps())]
        if not fitting:
            raise Fault(f"{self.name} does not send what --size and --rate ask for. It has {listed(p for _, p in colours)}")
        sensor, colour = max(fitting, key=lambda pair: preference(pair[1]))
        if options.no_depth:
            return sensor, colour, None
        depths = [p for _, p in profiles if p.stream_type() == rs.stream.depth and p.format() == rs.format.z16]
        fitting = [p for p in depths if p.fps() == colour.fps()]
        if not fitting:
            has = f"has {listed(depths)}" if depths else "has none"
            raise Fault(f"{self.name} sends no depth {colour.fps()} times a second: it {has}. Give another --rate, or --no-depth")
        return sensor, colour, max(fitting, key=preference)

    def set_up(self, sensor, outlet):
        """Exposure and clock, before the first frame."""
        option, options = self.rs.option, self.options

        def put(which, value):
            if not sensor.supports(which):
                raise Fault(f"{self.name} has no {which.name} that can be set")
            least, most = (getattr(sensor.get_option_range(which), end) for end in ("min", "max"))
            if not least <= value <= most:
                raise Fault(f"{which.name} of {self.name} is {least:g} to {most:g}, in the camera's units, and not {value:g}")
            sensor.set_option(which, value)

        if sensor.supports(option.global_time_enabled):
            put(option.global_time_enabled, 1)
        if options.exposure is not None:
            put(option.enable_auto_exposure, 0)
            put(option.exposure, options.exposure)
            if options.gain is not None:
                put(option.gain, options.gain)
        else:
            # What an earlier program has set stays in the camera.
            if sensor.supports(option.enable_auto_exposure):
                put(option.enable_auto_exposure, 1)
            # In the dark the exposure would become longer than the time between two frames.
            if sensor.supports(option.auto_exposure_priority):
                put(option.auto_exposure_priority, 0)
            outlet.log("info", "the exposure changes by itself: --exposure holds it, and a short one blurs less")

    def changed(self, event):
        """librealsense calls this in a thread of its own."""
        if event.was_removed(self.device):
            self.is_gone.set()

    def run(self, outlet):
        last_s = outlet.own_time()
        while not outlet.ended.is_set():
            is_there, frame = self.queue.try_wait_for_frame(STEP_MS)
            now_s = outlet.own_time()
            if self.is_gone.is_set():
                raise Fault(f"{self.name} was unplugged, or has reset itself: plug it in again")
            if is_there:
                last_s = now_s
                self.take(frame.as_frameset(), now_s, outlet)
            elif now_s - last_s > PATIENCE_S:
                raise Fault(
                    f"{self.name} has sent no frame for {PATIENCE_S} s: a cable or a hub loses data, or the USB port lacks power "
                    "or bandwidth. Plug it into a USB 3 port of the computer, or give a smaller --size or --rate, or --no-depth"
                )

    def take(self, frames, arrived_s, outlet):
        """Sends what is asked for: aligning takes much of a processor, so that unasked nothing is done."""
        request = outlet.wanted
        if request is None or not frames or not frames.get_color_frame():
            return
        colour, depth = frames.get_color_frame(), None
        stamp_s, within_s, is_stamped = self.exposure(colour, arrived_s)
        if not is_stamped and not self.is_told:
            self.is_told = True
            outlet.log("warn", "librealsense does not know the camera's clock (yet): when frames arrive counts")
        if request.get("depth") and self.align and frames.get_depth_frame():
            aligned = self.align.process(frames).get_depth_frame()
            depth = (metres(aligned), {"stamp": self.exposure(aligned, arrived_s)[0], "encoding": "f32_m"})
        width, height = self.size
        stated = {"stamp": stamp_s, "stamp_uncertainty_s": within_s, "width": width, "height": height, "encoding": "rgb8"}
        outlet.image(pixels(colour).tobytes(), depth, **stated)
        # What came meanwhile has waited, and would be stamped too late by its arrival.
        self.queue.poll_for_frame()

    def exposure(self, frame, arrived_s):
        """`exposure` of a frame of librealsense."""
        rs = self.rs
        stamp_s = before_s = None
        if frame.get_frame_timestamp_domain() == rs.timestamp_domain.global_time:
            # On the clock of the system, in ms.
            stamp_s = frame.get_timestamp() / 1000 + time.monotonic() - time.time()
        begin, middle = rs.frame_metadata_value.frame_timestamp, rs.frame_metadata_value.sensor_timestamp
        if frame.supports_frame_metadata(begin) and frame.supports_frame_metadata(middle):
            before_s = (frame.get_frame_metadata(begin) - frame.get_frame_metadata(middle)) / 1e6
        return exposure(stamp_s, before_s, arrived_s, self.interval_s)


def exposure(stamp_s, before_s, arrived_s, interval_s):
    """The middle of the exposure on the steady clock, within ± how much, and whether the camera's clock says it.

    `stamp_s` is when the sensor began to be read out, which ends the exposure of the first row; None where librealsense does not
    relate the camera's clock to that of the system. `before_s` is how much earlier the middle of the exposure was; None where
    the camera does not say it. (rs_frame.h: FRAME_TIMESTAMP, SENSOR_TIMESTAMP, both of the camera's clock.)

    With frames every interval the exposure is at most that long, and so is reading out. A rolling shutter exposes the row in the
    middle up to half an interval after the first one.
    """
    if stamp_s is None or not -interval_s < arrived_s - stamp_s < PATIENCE_S:
        # Exposed, read out, and behind another frame in the queue.
        return arrived_s - 1.5 * interval_s, 1.5 * interval_s, False
    # Of other clocks the difference would be anything.
    if before_s is None or not 0 <= before_s <= interval_s:
        return stamp_s, 0.5 * interval_s, True
    return stamp_s - before_s + 0.25 * interval_s, 0.25 * interval_s, True


def lens_of(intrinsics):
    """The lens as `camera` has it; or None, and why.

    Pixel (0, 0) of librealsense is the centre of the first pixel, as here ("Projection in RealSense SDK 2.0", Pixel Coordinates).
    Of its models (rs_types.h; formulas: rs2_project_point_to_pixel in rs.cpp)

        None                     has no distortion
        Brown-Conrady            is OpenCV's, k1 k2 p1 p2 k3
        modified Brown-Conrady   has the tangential part of the radially distorted point: the same where p1 and p2 are 0
        Kannala-Brandt           is OpenCV's fisheye, with the first four coefficients
        F-Theta                  has no counterpart
        inverse Brown-Conrady    maps distorted to undistorted points, which no coefficients of the others do. librealsense calls
                                 that of the colours of D400 cameras so, its table of the same numbers "forward" (d400-private.h),
                                 and projects with them as with the modified model: which it is, only a calibration tells
    """
    model, coefficients = intrinsics.model.name, [float(value) for value in intrinsics.coeffs]
    lens = {"fx": intrinsics.fx, "fy": intrinsics.fy, "cx": intrinsics.ppx, "cy": intrinsics.ppy}
    if not (lens["fx"] > 0 and lens["fy"] > 0):
        return None, "the camera has no calibration of its colours"
    if model == "none" or model.endswith("brown_conrady") and not any(coefficients):
        return lens, None
    if model == "brown_conrady" or model == "modified_brown_conrady" and not any(coefficients[2:4]):
        return {**lens, "distortion": {"model": "brown_conrady", "coefficients": coefficients}}, None
    if model == "kannala_brandt4":
        return {**lens, "distortion": {"model": "fisheye", "coefficients": coefficients[:4]}}, None
    return None, f"the camera states its lens by the model {model} with {coefficients}, which cannot be converted exactly"


def pixels(frame):
    """The pixels of a frame, which may have padding behind each row."""
    import numpy as np

    return np.asarray(frame.get_data())


def metres(depth):
    """A depth image as `f32_m`. Its unit differs between models, and 0, where nothing was measured, stays 0."""
    return (pixels(depth) * float(depth.get_units())).astype("<f4").tobytes()


def preference(profile):
    """Large, and then as fast as is usual."""
    return profile.width() * profile.height(), profile.fps() <= USUAL_HZ, -abs(profile.fps() - USUAL_HZ)


def described(profile):
    what = "depth" if profile.stream_type().name == "depth" else "colours"
    return f"{what} of {profile.width()}x{profile.height()}, {profile.fps()} a second"


def listed(profiles):
    rates = {}
    for profile in profiles:
        rates.setdefault((profile.width(), profile.height()), set()).add(profile.fps())
    sizes = sorted(rates.items(), reverse=True)
    return "; ".join(f"{width}x{height} at {', '.join(map(str, sorted(hz)))} Hz" for (width, height), hz in sizes)


def library():
    try:
        import pyrealsense2
    except ImportError as error:
        install = f"{sys.executable} -m pip install pyrealsense2 numpy"
        raise Fault(f"pyrealsense2 cannot be imported ({error}). To install it: {install}") from None
    return pyrealsense2


def nothing():
    """Why no camera is found, and what to do."""
    plugged = sorted(product for product in map(first_line, glob.glob(USB)) if "RealSense" in product)
    if plugged:
        return (
            f"{' and '.join(plugged)} is plugged in, and librealsense may not open it: copy its udev rules "
            "(https://github.com/IntelRealSense/librealsense, config/99-realsense-libusb.rules) into /etc/udev/rules.d, and plug "
            "the camera in again"
        )
    return (
        "no RealSense camera is connected: plug it into a USB 3 port of the computer, with its own cable, and see that lsusb lists "
        "it"
    )


def first_line(path):
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return file.readline().strip()
    except OSError:  # it was unplugged meanwhile
        return ""


def trouble(error):
    """Why librealsense does not start the camera, and what to do."""
    text = " ".join(str(error).split())
    if "resolve" in text:
        return (
            f"the camera does not send these sizes and rates together ({text}): give a smaller --size, another --rate, or "
            "--no-depth"
        )
    return (
        f"librealsense does not start the camera: {text}. If another program uses it, end that one, since a camera serves one at a "
        "time; otherwise unplug it and plug it in again"
    )


def main():
    options = parser(__doc__)
    options.add_argument("--serial", metavar="NUMBER", help="which camera, where several are connected")
    options.add_argument("--size", metavar="WIDTHxHEIGHT", type=size, help="size of the images; the largest if not given")
    rate = f"images a second; next to {USUAL_HZ} if not given"
    options.add_argument("--rate", metavar="HZ", type=within(1, 1000, int), help=rate)
    options.add_argument("--no-depth", action="store_true", help="colours only, which takes less of USB and processor")
    exposure_help = "holds the exposure, in the camera's units; automatic if not given"
    options.add_argument("--exposure", metavar="VALUE", type=float, help=exposure_help)
    gain_help = "with --exposure: holds the gain as well, in the camera's units"
    options.add_argument("--gain", metavar="VALUE", type=float, help=gain_help)
    chosen = options.parse_args()
    if chosen.gain is not None and chosen.exposure is None:
        options.error("--gain needs --exposure")
    serve(RealSense(chosen))


if __name__ == "__main__":
    main()
