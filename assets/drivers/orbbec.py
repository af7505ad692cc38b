# /// script
# requires-python = ">=3.9"
# dependencies = ["pyorbbecsdk2>=2.1.2,<2.2", "numpy<3"]
# ///
"""A driver for Orbbec cameras. It has not been run with a camera: it is checked with recordings of our own that Orbbec's SDK plays.

It reads colours, their lens and the depth that belongs to them (docs/drivers/orbbec.md).

    handeye driver orbbec --size 1280x720 --exposure 100

It is a camera alone: the robot is another driver, or its poses are typed.
"""

import glob
import os
import sys
import threading
import time

from handeye_driver import Fault, parser, serve, size, within

# Formats that are read, and how they are sent. YUYV comes first, since JPEG blurs the edges of corners; RGB comes last, since for
# most cameras the SDK makes it of the JPEG.
FORMATS = {"YUYV": "rgb8", "MJPG": "jpeg", "RGB": "rgb8"}
# Formats of depth that can be aligned.
DEPTHS = ("Y16", "Z16")
# Images a second without --rate, at most: more take bandwidth and light, and are not looked at.
USUAL_HZ = 30
# Longest wait for a frame [s], and of one step of it [ms].
PATIENCE_S, STEP_MS = 5, 500
# Where Linux says of what is plugged in who made it, and Orbbec's number.
USB, ORBBEC = "/sys/bus/usb/devices/*/idVendor", "2bc5"


class Orbbec:
    def __init__(self, options):
        self.options = options
        self.ob = self.context = self.device = self.pipeline = self.align = self.convert = None
        self.name = self.uid = self.format = self.size = self.interval_s = None
        self.is_gone = threading.Event()
        self.is_told = False

    def open(self, outlet):
        self.ob = library()
        # By itself the SDK writes a file into the folder that this is started in.
        self.ob.Context.set_logger_to_file(self.ob.OBLogLevel.NONE, "")
        try:
            self.context = self.ob.Context()
            self.context.set_device_changed_callback(self.changed)
            self.device = self.find()
            return self.start(outlet)
        except (self.ob.OBError, RuntimeError) as error:
            raise Fault(trouble(error)) from error

    def find(self):
        """The camera that is asked for, or the only one."""
        devices = self.context.query_devices()
        serials = [devices.get_device_serial_number_by_index(i) for i in range(devices.get_count())]
        if not serials:
            raise Fault(nothing(self.ob))
        wanted = self.options.serial
        found = [i for i, serial in enumerate(serials) if wanted in (None, serial)]
        if len(found) == 1:
            return devices.get_device_by_index(found[0])
        there = ", ".join(f"{devices.get_device_name_by_index(i)} with --serial {serial}" for i, serial in enumerate(serials))
        if found:
            raise Fault(f"several cameras are connected: say which. There are {there}")
        raise Fault(f"no camera {wanted} is connected. There are {there}")

    def start(self, outlet):
        ob, device = self.ob, self.device
        about = device.get_device_info()
        self.name = f"Orbbec {about.get_name().removeprefix('Orbbec ')}, serial number {about.get_serial_number()}"
        self.uid = about.get_uid()
        self.pipeline = ob.Pipeline(device)
        colour, depth = self.choose()
        self.check_orientation()
        self.set_up(outlet)
        self.format, self.size = colour.get_format().name, (colour.get_width(), colour.get_height())
        self.interval_s = 1 / colour.get_fps()
        lens, why = lens_of(colour.get_intrinsic(), colour.get_distortion())
        if lens is None:
            depth = None
            outlet.log("warn", f"{why}: neither the lens, which has to be estimated or given, nor depth, aligned by it, is sent")
        self.prepare(depth, lens)
        config = ob.Config()
        chosen = [profile for profile in (colour, depth) if profile]
        for profile in chosen:
            config.enable_stream(profile)
        config.set_frame_aggregate_output_mode(ob.OBFrameAggregateOutputMode.FULL_FRAME_REQUIRE)
        self.pipeline.start(config)
        outlet.log("info", f"{self.name}: {' and '.join(map(described, chosen))}")
        width, height = self.size
        camera = {"width": width, "height": height, **({"intrinsics": lens} if lens else {})}
        return {"name": self.name, "clock": "monotonic", "can": ["image", *(["depth"] if depth else [])], "camera": camera}

    def prepare(self, depth, lens):
        """What is done with each frame that is asked for."""
        ob = self.ob
        if self.format == "YUYV":
            self.convert = ob.FormatConvertFilter()
            self.convert.set_format_convert_format(ob.OBConvertFormat.YUYV_TO_RGB888)
        if depth:
            self.align = ob.AlignFilter(align_to_stream=ob.OBStreamType.COLOR_STREAM)
            # By itself the SDK aligns depth to an image without the distortion of the lens, which is not the one that is sent.
            self.align.set_config_value("TargetDistortion", int("distortion" in lens))
            try:
                self.pipeline.enable_frame_sync()
            except ob.OBError:
                pass  # not every model has it: depth has a stamp of its own

    def choose(self):
        """The profiles of colours and depth: as they are wished, or the largest of the format that loses least."""
        options, sensors = self.options, self.ob.OBSensorType
        colours = [profile for profile in self.profiles(sensors.COLOR_SENSOR) if profile.get_format().name in FORMATS]
        if not colours:
            raise Fault(f"{self.name} sends no colours as {', '.join(FORMATS)}: there is nothing to calibrate")
        fitting = [
            profile
            for profile in colours
            if options.size in (None, (profile.get_width(), profile.get_height()))
            and options.rate in (None, profile.get_fps())
            and options.format in (None, profile.get_format().name)
        ]
        if not fitting:
            raise Fault(f"{self.name} does not send what --size, --rate and --format ask for. It has {listed(colours)}")
        colour = max(fitting, key=preference)
        if options.no_depth:
            return colour, None
        depths = [profile for profile in self.profiles(sensors.DEPTH_SENSOR) if profile.get_format().name in DEPTHS]
        fitting = [profile for profile in depths if profile.get_fps() == colour.get_fps()]
        if not fitting:
            has = f"has {listed(depths)}" if depths else "has none"
            hz = colour.get_fps()
            raise Fault(f"{self.name} sends no depth {hz} times a second: it {has}. Give another --rate, or --no-depth")
        return colour, max(fitting, key=preference)

    def profiles(self, sensor):
        """What a sensor can send; nothing where the camera has no such sensor."""
        try:
            found = self.pipeline.get_stream_profile_list(sensor)
        except self.ob.OBError:
            return []
        profiles = [found.get_stream_profile_by_index(i) for i in range(found.get_count())]
        return [profile.as_video_stream_profile() for profile in profiles if profile.is_video_stream_profile()]

    def check_orientation(self):
        """No camera sees a mirrored world, and the lens is that of images which are not turned."""
        for name in ("COLOR_MIRROR_BOOL", "COLOR_FLIP_BOOL", "COLOR_ROTATE_INT"):
            which = getattr(self.ob.OBPropertyID, f"OB_PROP_{name}")
            if not self.device.is_property_supported(which, self.ob.OBPermissionType.PERMISSION_READ):
                continue
            get = self.device.get_bool_property if name.endswith("BOOL") else self.device.get_int_property
            if get(which):
                raise Fault(f"{self.name} mirrors or turns its colours ({name}): switch that off in Orbbec Viewer")

    def set_up(self, outlet):
        """Exposure and clock, before the first frame."""
        ids, options, device = self.ob.OBPropertyID, self.options, self.device
        automatic, priority = ids.OB_PROP_COLOR_AUTO_EXPOSURE_BOOL, ids.OB_PROP_COLOR_AUTO_EXPOSURE_PRIORITY_INT

        def can(which):
            return device.is_property_supported(which, self.ob.OBPermissionType.PERMISSION_WRITE)

        def put(what, which, value):
            if not can(which):
                raise Fault(f"{self.name} has no {what} that can be set")
            range_ = device.get_int_property_range(which)
            if not range_.min <= value <= range_.max:
                raise Fault(f"{what} of {self.name} is {range_.min} to {range_.max}, in the camera's units, and not {value}")
            device.set_int_property(which, value)

        if device.is_global_timestamp_supported():
            device.enable_global_timestamp(True)
        if options.exposure is not None:
            if can(automatic):
                device.set_bool_property(automatic, False)
            put("exposure", ids.OB_PROP_COLOR_EXPOSURE_INT, options.exposure)
            if options.gain is not None:
                put("gain", ids.OB_PROP_COLOR_GAIN_INT, options.gain)
        else:
            # What an earlier program has set stays in the camera.
            if can(automatic):
                device.set_bool_property(automatic, True)
            # In the dark the exposure would become longer than the time between two frames.
            if can(priority):
                device.set_int_property(priority, 0)
            outlet.log("info", "the exposure changes by itself: --exposure holds it, and a short one blurs less")

    def changed(self, removed, _added):
        """The SDK calls this in a thread of its own."""
        if self.uid in [removed.get_device_uid_by_index(i) for i in range(removed.get_count())]:
            self.is_gone.set()

    def run(self, outlet):
        last_s = outlet.own_time()
        while not outlet.ended.is_set():
            frames = self.pipeline.wait_for_frames(STEP_MS)
            now_s = outlet.own_time()
            if self.is_gone.is_set():
                raise Fault(f"{self.name} was unplugged, or has reset itself: plug it in again")
            if frames is not None:
                last_s = now_s
                self.take(frames, now_s, outlet)
            elif now_s - last_s > PATIENCE_S:
                raise Fault(
                    f"{self.name} has sent no frame for {PATIENCE_S} s: a cable or a hub loses data, or the USB port lacks power "
                    "or bandwidth. Plug it into a USB 3 port of the computer, or give a smaller --size or --rate, or --no-depth"
                )

    def take(self, frames, arrived_s, outlet):
        """Sends what is asked for: aligning takes much of a processor, so that unasked nothing is done."""
        request = outlet.wanted
        if request is None or frames.get_color_frame() is None:
            return
        colour, depth = frames.get_color_frame(), None
        stamp_s, within_s, is_stamped = self.exposure(colour, arrived_s)
        if not is_stamped and not self.is_told:
            self.is_told = True
            outlet.log("warn", "the SDK does not know this camera's clock (yet): when frames arrive counts")
        if request.get("depth") and self.align and frames.get_depth_frame() is not None:
            aligned = self.align.process(frames)
            if aligned is None:
                raise Fault(f"the SDK does not align the depth of {self.name} to its colours: give --no-depth")
            aligned = aligned.as_frame_set().get_depth_frame()
            depth = (metres(aligned), {"stamp": self.exposure(aligned, arrived_s)[0], "encoding": "f32_m"})
        width, height = self.size
        stated = {"stamp": stamp_s, "stamp_uncertainty_s": within_s, "width": width, "height": height}
        outlet.image(self.bytes_of(colour), depth, **stated, encoding=FORMATS[self.format])
        # What came meanwhile has waited, and would be stamped too late by its arrival.
        while self.pipeline.wait_for_frames(1) is not None:
            pass

    def bytes_of(self, frame):
        """The bytes of an image as they are sent. The SDK leaves out frames that are not whole."""
        width, height = self.size
        if self.convert:
            frame = self.convert.process(frame)
        data = frame.get_data().tobytes() if frame is not None else b""
        if FORMATS[self.format] == "rgb8" and len(data) != 3 * width * height:
            raise Fault(f"{self.name}: the SDK makes {len(data)} bytes of a frame in {self.format}: give another --format")
        return data

    def exposure(self, frame, arrived_s):
        """`exposure` of a frame of the SDK."""
        stamp_us = frame.get_global_timestamp_us()
        # On the clock of the system; 0 where it is not known.
        stamp_s = stamp_us / 1e6 + time.monotonic() - time.time() if stamp_us else None
        return exposure(stamp_s, arrived_s, self.interval_s)


def exposure(stamp_s, arrived_s, interval_s):
    """The middle of the exposure on the steady clock, within ± how much, and whether the camera's clock says it.

    `stamp_s` is when the camera captured the frame, which is "typically in the mid-exposure, unless otherwise stated" (Frame.h of
    the SDK): an instant of the exposure, which with frames every interval is at most that long. None where the SDK does not
    relate the camera's clock to that of the system. A rolling shutter exposes the row in the middle up to half an interval after
    the first one.
    """
    if stamp_s is None or not -interval_s < arrived_s - stamp_s < PATIENCE_S:
        # Exposed, read out, and behind another frame in the queue.
        return arrived_s - 1.5 * interval_s, 1.5 * interval_s, False
    return stamp_s, interval_s, True


def lens_of(intrinsic, distortion):
    """The lens as `camera` has it; or None, and why.

    Pixel (0, 0) of the SDK is the centre of the first pixel, as here: its alignment takes a pixel to reach half a pixel to both
    sides of its coordinates (AlignImpl.cpp), and a mirrored cx is width - 1 - cx (AlgParamManager.cpp). For sizes that were not
    calibrated at the factory the SDK multiplies cx and cy by the ratio of the sizes, which is off by up to half a pixel. Of its
    models (ObTypes.h; formulas: addDistortion in AlignImpl.cpp)

        None                     has no distortion
        Brown-Conrady            is OpenCV's, k1 k2 p1 p2 k3; with k4, k5 or k6 the SDK's own formulas contradict each other
                                 (CoordinateUtil.cpp divides by them)
        Brown-Conrady K6         is OpenCV's with a denominator of k4 k5 k6, the protocol's `rational`
        Kannala-Brandt           is OpenCV's fisheye, k1 k2 k3 k4
        modified, inverse        are not computed by the SDK, and differ from Brown-Conrady: the one has the tangential part of the
                                 radially distorted point, the other maps distorted to undistorted points
    """
    model = distortion.model.name
    k1, k2, k3, k4, k5, k6, p1, p2 = (getattr(distortion, name) for name in ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"))
    lens = {"fx": intrinsic.fx, "fy": intrinsic.fy, "cx": intrinsic.cx, "cy": intrinsic.cy}
    if not (lens["fx"] > 0 and lens["fy"] > 0):
        return None, "the camera has no calibration of its colours"
    if model != "KANNALA_BRANDT4" and not any((k1, k2, k3, k4, k5, k6, p1, p2)):
        return lens, None
    if model == "BROWN_CONRADY" and not any((k4, k5, k6)):
        return {**lens, "distortion": {"model": "brown_conrady", "coefficients": [k1, k2, p1, p2, k3]}}, None
    if model == "BROWN_CONRADY_K6":
        return {**lens, "distortion": {"model": "rational", "coefficients": [k1, k2, p1, p2, k3, k4, k5, k6]}}, None
    if model == "KANNALA_BRANDT4":
        return {**lens, "distortion": {"model": "fisheye", "coefficients": [k1, k2, k3, k4]}}, None
    return None, f"the camera states its lens by the model {model} with {distortion}, which cannot be converted exactly"


def metres(depth):
    """A depth image as `f32_m`. Its unit is stated in mm; 0, where nothing was measured, stays 0."""
    return (depth.get_data().view("<u2") * (depth.get_depth_scale() / 1000)).astype("<f4").tobytes()


def preference(profile):
    """The best format, large, and then as fast as is usual."""
    rank = list(FORMATS).index(profile.get_format().name) if profile.get_format().name in FORMATS else 0
    rate = profile.get_fps()
    return -rank, profile.get_width() * profile.get_height(), rate <= USUAL_HZ, -abs(rate - USUAL_HZ)


def described(profile):
    return f"{profile.get_format().name} of {profile.get_width()}x{profile.get_height()}, {profile.get_fps()} a second"


def listed(profiles):
    rates = {}
    for profile in profiles:
        rates.setdefault((profile.get_width(), profile.get_height(), profile.get_format().name), set()).add(profile.get_fps())
    kinds = sorted(rates.items(), reverse=True)
    return "; ".join(f"{width}x{height} {name} at {', '.join(map(str, sorted(hz)))} Hz" for (width, height, name), hz in kinds)


def library():
    try:
        import pyorbbecsdk
    except ImportError as error:
        install = f"{sys.executable} -m pip install pyorbbecsdk2 numpy"
        raise Fault(f"pyorbbecsdk cannot be imported ({error}). To install it: {install}") from None
    # Without it nobody knows what the coefficients of a lens are.
    if not hasattr(pyorbbecsdk.OBCameraDistortion, "model"):
        raise Fault("this version of pyorbbecsdk does not state the model of a lens: install pyorbbecsdk2 2.1.2 or newer")
    return pyorbbecsdk


def nothing(package):
    """Why no camera is found, and what to do."""
    if ORBBEC in map(first_line, glob.glob(USB)):
        script = os.path.join(os.path.dirname(package.__file__), "shared", "install_udev_rules.sh")
        return (
            f"a device of Orbbec is plugged in, and the SDK may not open it: install its udev rules (sudo sh {script}), and plug "
            "the camera in again"
        )
    return "no Orbbec camera is connected: plug it into a USB 3 port of the computer, and see that lsusb lists a device 2bc5:…"


def first_line(path):
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return file.readline().strip()
    except OSError:  # it was unplugged meanwhile
        return ""


def trouble(error):
    """Why the SDK does not start the camera, and what to do."""
    return (
        f"Orbbec's SDK does not start the camera: {' '.join(str(error).split())}. If another program uses it, end that one, since "
        "a camera serves one at a time; otherwise unplug it and plug it in again"
    )


def main():
    options = parser(__doc__)
    options.add_argument("--serial", metavar="NUMBER", help="which camera, where several are connected")
    options.add_argument("--size", metavar="WIDTHxHEIGHT", type=size, help="size of the images; the largest if not given")
    rate = f"images a second; next to {USUAL_HZ} if not given"
    options.add_argument("--rate", metavar="HZ", type=within(1, 1000, int), help=rate)
    format_help = "the first of these that the camera offers in this size if not given"
    options.add_argument("--format", type=str.upper, choices=FORMATS, help=format_help)
    options.add_argument("--no-depth", action="store_true", help="colours only, which takes less of USB and processor")
    exposure_help = "holds the exposure, in the camera's units; automatic if not given"
    options.add_argument("--exposure", metavar="VALUE", type=int, help=exposure_help)
    gain_help = "with --exposure: holds the gain as well, in the camera's units"
    options.add_argument("--gain", metavar="VALUE", type=int, help=gain_help)
    chosen = options.parse_args()
    if chosen.gain is not None and chosen.exposure is None:
        options.error("--gain needs --exposure")
    serve(Orbbec(chosen))


if __name__ == "__main__":
    main()
