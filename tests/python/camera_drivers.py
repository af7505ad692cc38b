#!/usr/bin/env python3
"""Runs the drivers of RealSense and Orbbec cameras without a camera.

usage: camera_drivers.py DRIVERS

DRIVERS is the folder with realsense.py and orbbec.py. Each runs as the workbench runs it, with the maker's library in this Python
and frames that this library makes: those of a software device of librealsense, and those of a recording that Orbbec's SDK plays,
which is written here. Expected pixels are computed here, by OpenCV's formulas. Where a library is missing, its checks are skipped.
Prints a line per check; exits with 1 when one fails.
"""

import importlib
import json
import math
import os
import pathlib
import struct
import sys
import tempfile
import threading
import time
import types

from driver_process import Ended, Talk

RATE_HZ = 30
WIDTH, HEIGHT = 320, 240
# The lens of the colours; that of the depth, without distortion; and where the depth camera is in the colour camera [m].
COLOUR, DEPTH, BASELINE_M = (300.0, 301.0, 161.2, 118.7), (250.0, 250.0, 159.5, 119.5), (0.015, 0.0, 0.0)
# The tilted plane that the depth camera sees: 1 / its distance [1/m], and how much that changes by x / z and by y / z.
PLANE = (1.67, 1.2, 0.9)
# How far the makers' alignment is off, in the median and in all but 5 % of the pixels [px]: it rounds, and fills what is between.
ALIGNED_PX, FILLED_PX = 1.0, 2.0
# Of single precision, in pixels.
PROJECTED_PX = 2e-3
BROWN_CONRADY, RATIONAL = [0.12, -0.2, 0.001, -0.002, 0.05], [0.3, 0.1, 0.001, -0.002, 0.02, -0.1, 0.05, 0.01]
FISHEYE = [0.05, -0.02, 0.01, -0.003]


# ------------------------------------------------------------------------------------------------------------------------ lens


def projected(lens, point):
    """The pixel of a point by OpenCV's formulas, of a lens as a driver sends it."""
    x, y = point[0] / point[2], point[1] / point[2]
    distortion = lens.get("distortion", {"model": "brown_conrady", "coefficients": [0.0] * 5})
    k = distortion["coefficients"]
    if distortion["model"] == "fisheye":
        r = math.hypot(x, y)
        theta = math.atan(r)
        bent = theta * (1 + sum(value * theta ** (2 * i + 2) for i, value in enumerate(k)))
        x, y = (x * bent / r, y * bent / r) if r else (x, y)
    else:
        k1, k2, p1, p2, k3, k4, k5, k6 = [*k, 0.0, 0.0, 0.0][:8]
        r2 = x * x + y * y
        radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        x, y = (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )
    return lens["fx"] * x + lens["cx"], lens["fy"] * y + lens["cy"]


def assert_same_lens(lens, project):
    """That a lens which is sent projects as the library does."""
    for point in ((0.0, 0.0, 1.0), (0.3, -0.2, 0.8), (-0.45, 0.31, 1.0), (0.1, 0.4, 1.3)):
        off = math.dist(projected(lens, point), project(point))
        assert off < PROJECTED_PX, f"{lens}: {point} is {off} px off"


def depths():
    """What the depth camera sees, in metres."""
    import numpy as np

    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    fx, fy, cx, cy = DEPTH
    return 1 / (PLANE[0] + PLANE[1] * (u - cx) / fx + PLANE[2] * (v - cy) / fy)


def assert_aligned(data, lens):
    """That the depth of a pixel of the colours is that of what this pixel shows, by how many pixels it would be shifted."""
    import numpy as np

    found_m = np.frombuffer(data, "<f4").reshape(HEIGHT, WIDTH)
    assert np.mean(found_m > 0) > 0.9, "many pixels have no depth"
    plane_m, shifts_px = depths(), []
    fx, fy, cx, cy = DEPTH
    for v in range(0, HEIGHT, 4):
        for u in range(0, WIDTH, 4):
            z = plane_m[v, u]
            seen = [a + b for a, b in zip(((u - cx) / fx * z, (v - cy) / fy * z, z), BASELINE_M)]
            column, row = map(round, projected(lens, seen))
            if 0 <= column < WIDTH and 0 <= row < HEIGHT and found_m[row, column] > 0:
                # How much the distance changes from one pixel of the colours to the next.
                slope_m = math.hypot(PLANE[1], PLANE[2]) * z * z / lens["fx"]
                shifts_px.append(abs(found_m[row, column] - z) / slope_m)
    assert len(shifts_px) > 1000, len(shifts_px)
    median, most = np.percentile(shifts_px, (50, 95))
    assert median < ALIGNED_PX and most < FILLED_PX, f"depth is shifted by {median:.2f} px in the median, {most:.2f} in 95 %"


# ---------------------------------------------------------------------------------------------------------------- conversation


def ending(talk):
    """What a driver ends with."""
    try:
        while True:
            talk.wait("nothing")
    except Ended as ended:
        return str(ended)


class Quiet:
    """An outlet of which nothing is looked at but the log."""

    def __init__(self):
        self.texts = []

    def log(self, _, text):
        self.texts.append(text)


def fault_of(call):
    """The words of a driver's Fault."""
    try:
        call()
    except Exception as fault:
        assert type(fault).__name__ == "Fault", repr(fault)
        return str(fault)
    raise AssertionError("there was no fault")


def assert_plugged(module, file, line, find):
    """That a camera which Linux sees, and the library does not, is a matter of permission."""
    usual = module.USB
    with tempfile.TemporaryDirectory() as folder:
        pathlib.Path(folder, "1-1").mkdir()
        pathlib.Path(folder, "1-1", file).write_text(line + "\n")
        module.USB = f"{folder}/*/{file}"
        assert "udev rules" in (text := fault_of(find)), text
    module.USB = usual


def chosen_of(**given):
    """Options, as far as they are not given."""
    usual = {"serial": None, "size": None, "rate": None, "format": None, "no_depth": False, "exposure": None, "gain": None}
    return types.SimpleNamespace(**{**usual, **given})


def started(drivers, module, scenario, *options):
    """A driver with a camera of this file."""
    here = str(pathlib.Path(__file__).resolve())
    return Talk([sys.executable, here, drivers, module, json.dumps(scenario), *options])


# ------------------------------------------------------------------------------------------------------------------- RealSense


def intrinsics_of(rs, lens, model, coefficients):
    found = rs.intrinsics()
    found.width, found.height = WIDTH, HEIGHT
    found.fx, found.fy, found.ppx, found.ppy = lens
    found.model, found.coeffs = getattr(rs.distortion, model), list(coefficients)
    return found


class SoftwareCamera:
    """A software device of librealsense with colours and depth."""

    def __init__(self, rs, model="none", coefficients=(0.0,) * 5, serial="1", unit_m=0.001, rates=(RATE_HZ,), **_):
        self.rs, self.unit_m = rs, unit_m
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.name, "Software camera")
        self.device.register_info(rs.camera_info.serial_number, serial)
        self.colours, self.depths = self.device.add_sensor("RGB Camera"), self.device.add_sensor("Stereo Module")
        for option, value in (
            ("exposure", (1, 10000, 1, 156)),
            ("gain", (0, 128, 1, 64)),
            ("enable_auto_exposure", (0, 1, 1, 1)),
            ("auto_exposure_priority", (0, 1, 1, 1)),
            ("global_time_enabled", (0, 1, 1, 0)),
        ):
            span = rs.option_range()
            span.min, span.max, span.step, span.default = value
            self.colours.add_option(getattr(rs.option, option), span)
        self.depths.add_read_only_option(rs.option.depth_units, unit_m)
        lens = intrinsics_of(rs, COLOUR, model, coefficients)
        self.colour_profiles = [
            self.profile(self.colours, rs.stream.color, rs.format.rgb8, 3, lens, rate, 10 + i) for i, rate in enumerate(rates)
        ]
        lens = intrinsics_of(rs, DEPTH, "brown_conrady", [0.0] * 5)
        self.depth_profile = self.profile(self.depths, rs.stream.depth, rs.format.z16, 2, lens, RATE_HZ, 1)
        extrinsics = rs.extrinsics()
        extrinsics.rotation, extrinsics.translation = [1, 0, 0, 0, 1, 0, 0, 0, 1], list(BASELINE_M)
        for profile in self.colour_profiles:
            self.depth_profile.register_extrinsics_to(profile, extrinsics)

    @staticmethod
    def profile(sensor, kind, form, bytes_per_pixel, lens, rate, number):
        import pyrealsense2

        stream = pyrealsense2.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt, stream.bpp = kind, 0, number, form, bytes_per_pixel
        stream.width, stream.height, stream.fps, stream.intrinsics = WIDTH, HEIGHT, rate, lens
        return sensor.add_video_stream(stream)

    def feed(self, domain, number):
        """A frame of both, whose exposure of 10 ms ended 30 ms ago. The first pixel tells its number."""
        import numpy as np

        rs = self.rs
        colours = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        colours[0, 0] = number % 256, 1, 2
        stamp_ms = 1000 * time.time() - 30
        for name, value_us in (("frame_timestamp", 1_000_000), ("sensor_timestamp", 995_000)):
            self.colours.set_metadata(getattr(rs.frame_metadata_value, name), value_us)
        depth = np.rint(depths() / self.unit_m).astype("<u2")
        for sensor, profile, pixels, width in (
            (self.colours, self.colour_profiles[0], colours, 3),
            (self.depths, self.depth_profile, depth, 2),
        ):
            frame = rs.software_video_frame()
            frame.pixels, frame.bpp, frame.stride, frame.frame_number = pixels, width, width * WIDTH, number
            frame.timestamp, frame.domain = stamp_ms, getattr(rs.timestamp_domain, domain)
            frame.profile = profile.as_video_stream_profile()
            if sensor is self.depths:
                frame.depth_units = self.unit_m
            sensor.on_video_frame(frame)


def run_realsense(scenario):
    """The driver of RealSense cameras with a software device."""
    import pyrealsense2 as rs
    import realsense

    camera = SoftwareCamera(rs, **scenario)

    class Driver(realsense.RealSense):
        def find(self):
            return camera.device

        def run(self, outlet):
            threading.Thread(target=self.feed, daemon=True).start()
            super().run(outlet)

        def feed(self):
            for number in range(scenario.get("frames", 100_000)):
                camera.feed(scenario.get("domain", "global_time"), number)
                time.sleep(1 / RATE_HZ)
            if scenario.get("is_unplugged"):
                self.changed(types.SimpleNamespace(was_removed=lambda device: device is camera.device))

    realsense.RealSense = Driver
    realsense.main()


def realsense_lenses(_):
    import pyrealsense2 as rs
    import realsense

    for model, coefficients in (
        ("none", [0.0] * 5),
        ("inverse_brown_conrady", [0.0] * 5),
        ("modified_brown_conrady", [0.0] * 5),
        ("modified_brown_conrady", [*BROWN_CONRADY[:2], 0.0, 0.0, BROWN_CONRADY[4]]),
        ("brown_conrady", BROWN_CONRADY),
        ("kannala_brandt4", [*FISHEYE, 0.0]),
        ("kannala_brandt4", [0.0] * 5),
    ):
        intrinsics = intrinsics_of(rs, COLOUR, model, coefficients)
        lens, _ = realsense.lens_of(intrinsics)
        assert_same_lens(lens, lambda point, of=intrinsics: rs.rs2_project_point_to_pixel(of, list(point)))
    for model in ("inverse_brown_conrady", "modified_brown_conrady", "ftheta"):
        lens, why = realsense.lens_of(intrinsics_of(rs, COLOUR, model, BROWN_CONRADY))
        assert lens is None and model in why, (lens, why)
    lens, why = realsense.lens_of(intrinsics_of(rs, (0.0, 0.0, 0.0, 0.0), "none", [0.0] * 5))
    assert lens is None and "no calibration" in why, (lens, why)


def realsense_exposures(_):
    import realsense

    assert_exposures(realsense.exposure, is_told_the_middle=True)


def assert_exposures(exposure, is_told_the_middle):
    """That every exposure that is possible is within what is stated, of rolling and of global shutters."""
    interval_s, begin_s = 1 / RATE_HZ, 100.0
    for exposed in (0.001, 0.5, 1.0):
        for read_out in (0.0, 0.5, 1.0):
            middle_s = begin_s + (0.5 * exposed + 0.5 * read_out) * interval_s
            end_s = begin_s + exposed * interval_s
            for waited in (0.0, 1.0):
                arrived_s = end_s + (max(read_out, 0.1) + waited) * interval_s
                if is_told_the_middle:
                    stated = [exposure(end_s, before, arrived_s, interval_s) for before in (None, 0.5 * exposed * interval_s, 1e6)]
                else:
                    stated = [exposure(stamp_s, arrived_s, interval_s) for stamp_s in (begin_s, middle_s, end_s)]
                for found_s, within_s, is_stamped in stated:
                    assert is_stamped and abs(found_s - middle_s) <= within_s + 1e-9, (exposed, read_out, found_s, within_s)
            for stamp_s in (None, 1.7e9):
                given = (stamp_s, None, arrived_s) if is_told_the_middle else (stamp_s, arrived_s)
                found_s, within_s, is_stamped = exposure(*given, interval_s)
                assert not is_stamped and abs(found_s - middle_s) <= within_s + 1e-9, (exposed, read_out, found_s, within_s)


def realsense_choices(_):
    import pyrealsense2 as rs
    import realsense

    def driver(devices, **options):
        made = realsense.RealSense(chosen_of(**options))
        made.rs, made.name = rs, "it"
        made.context = types.SimpleNamespace(query_devices=lambda: devices)
        return made

    first, second = SoftwareCamera(rs, serial="7", rates=(RATE_HZ, 6, 90)), SoftwareCamera(rs, serial="8")
    both = [first.device, second.device]
    assert driver(both, serial="8").find().get_info(rs.camera_info.serial_number) == "8"
    assert "say which" in fault_of(driver(both).find) and "--serial 7" in fault_of(driver(both).find)
    assert "no camera 9" in fault_of(driver(both, serial="9").find)
    assert "no RealSense camera is connected" in fault_of(driver([]).find)
    assert_plugged(realsense, "product", "Intel(R) RealSense(TM) Depth Camera 435", driver([]).find)

    def chosen(**options):
        made = driver([], **options)
        made.device = first.device
        return made.choose()

    assert chosen()[1].fps() == RATE_HZ and chosen(no_depth=True)[2] is None
    assert chosen(rate=90, no_depth=True)[1].fps() == 90
    assert f"{WIDTH}x{HEIGHT} at 6, 30, 90 Hz" in fault_of(lambda: chosen(size=(640, 480)))
    assert "another --rate, or --no-depth" in fault_of(lambda: chosen(rate=90))

    def values(**options):
        driver([], **options).set_up(first.colours, Quiet())
        names = ("enable_auto_exposure", "exposure", "gain", "global_time_enabled")
        return [first.colours.get_option(getattr(rs.option, name)) for name in names]

    assert values(exposure=100.0, gain=16.0) == [0, 100, 16, 1], values(exposure=100.0, gain=16.0)
    assert values()[0] == 1 and first.colours.get_option(rs.option.auto_exposure_priority) == 0
    assert "1 to 10000" in fault_of(lambda: values(exposure=20_000.0))


def realsense_images(drivers):
    for scenario in ({}, {"unit_m": 0.0001}):
        with started(drivers, "realsense", scenario) as talk:
            hello = talk.hello()
            assert hello["can"] == ["image", "depth"] and hello["camera"]["width"] == WIDTH, hello
            (image, pixels), (depth, metres) = talk.image(depth=True)
            (later, next_pixels), _ = talk.image(after=image["stamp"])
            assert (image["encoding"], len(pixels)) == ("rgb8", 3 * WIDTH * HEIGHT) and pixels[1:3] == b"\1\2", image
            # The exposure ended 30 ms before the frame was made, and took 10 ms.
            assert 0.0 < time.monotonic() - image["stamp"] < 1.0 and image["stamp_uncertainty_s"] < 0.5 / RATE_HZ, image
            assert depth["encoding"] == "f32_m" and abs(depth["stamp"] - image["stamp"]) < 1 / RATE_HZ, depth
            assert later["stamp"] > image["stamp"] and next_pixels[0] != pixels[0], later
            assert_aligned(metres, hello["camera"]["intrinsics"])
    with started(drivers, "realsense", {"domain": "system_time"}, "--no-depth") as talk:
        assert talk.hello()["can"] == ["image"]
        (image, _), _ = talk.image()
        assert abs(image["stamp_uncertainty_s"] - 1.5 / RATE_HZ) < 1e-9, image
        assert "when frames arrive" in talk.said(), talk.said()
    for model, is_known in (("inverse_brown_conrady", False), ("brown_conrady", True)):
        with started(drivers, "realsense", {"model": model, "coefficients": BROWN_CONRADY}) as talk:
            hello = talk.hello()
            assert hello["can"] == ["image"] and ("intrinsics" in hello["camera"]) == is_known, hello
            talk.image()
            assert "no depth is sent" in talk.said() and (f"the model {model}" in talk.said()) != is_known, talk.said()


def realsense_ends(drivers):
    with started(drivers, "realsense", {"frames": 5, "is_unplugged": True}) as talk:
        talk.hello()
        assert "was unplugged" in (text := ending(talk)), text
    with started(drivers, "realsense", {"frames": 5}) as talk:
        talk.hello()
        assert "has sent no frame for 5 s" in (text := ending(talk)), text


# ---------------------------------------------------------------------------------------------------------------------- Orbbec

ANY_SUM, DEVICE_SUM = "0123456789abcdef0123456789abcdef", "afef5328bb4abebd1a309e1ea8b26b3a"
IMAGE_SUM = "060021388200f6f0f447d0fcd9c64743"
# A model whose depth the SDK plays as it is: Orbbec's number, and that of the Femto Bolt.
FEMTO_BOLT = (0x2BC5, 0x066B)
# Numbers of the SDK: of streams, sensors and kinds of frames alike; and of properties.
COLOUR_STREAM, DEPTH_STREAM, RECORDING_VERSION, COLOUR_MIRROR = 2, 3, 0, 81
# The SDK looks at the ends of a JPEG and at its length alone.
JPEG = b"\xff\xd8" + b"JPEG" * 500 + b"\xff\xd9"


def fields(**values):
    """A header of a recording of ROS."""
    parts = [name.encode() + b"=" + (value.encode() if isinstance(value, str) else value) for name, value in values.items()]
    return b"".join(struct.pack("<I", len(part)) + part for part in parts)


def record(data, **header):
    header = fields(**header)
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def u32(value):
    return struct.pack("<I", value)


def instant(seconds):
    return struct.pack("<II", int(seconds), round(seconds % 1 * 1e9))


def text_of(words):
    return u32(len(words)) + words.encode()


def write_recording(path, messages):
    """A recording of ROS 1 (format 2.0) in one piece: topic, type, sum of the type, time, content."""
    connections, index, pieces, length = {}, {}, [], 0
    for topic, kind, kind_sum, at_s, data in messages:
        if topic not in connections:
            about = fields(topic=topic, type=kind, md5sum=kind_sum, message_definition="none")
            connections[topic] = record(about, conn=u32(len(connections)), op=b"\7", topic=topic)
            pieces.append(connections[topic])
            length += len(pieces[-1])
        number = list(connections).index(topic)
        index.setdefault(number, []).append((at_s, length))
        pieces.append(record(data, conn=u32(number), op=b"\2", time=instant(at_s)))
        length += len(pieces[-1])
    piece = b"".join(pieces)
    body = record(piece, compression="none", op=b"\5", size=u32(len(piece)))
    for number, entries in index.items():
        places = b"".join(instant(at_s) + u32(place) for at_s, place in entries)
        body += record(places, conn=u32(number), count=u32(len(entries)), op=b"\4", ver=u32(1))
    magic, padded = b"#ROSBAG V2.0\n", 4096
    begin = len(magic) + padded
    header = fields(chunk_count=u32(1), conn_count=u32(len(connections)), index_pos=struct.pack("<Q", begin + len(body)), op=b"\3")
    padding = padded - 8 - len(header)
    times = [at_s for entries in index.values() for at_s, _ in entries]
    counts = b"".join(u32(number) + u32(len(entries)) for number, entries in index.items())
    place = {"chunk_pos": struct.pack("<Q", begin), "start_time": instant(min(times)), "end_time": instant(max(times))}
    tail = b"".join(connections.values()) + record(counts, **place, count=u32(len(index)), op=b"\6", ver=u32(1))
    pathlib.Path(path).write_bytes(magic + u32(len(header)) + header + u32(padding) + b" " * padding + body + tail)


def recording(ob, path, model="NONE", coefficients=(0.0,) * 8, form="YUYV", frames=60, is_stamped=True, is_mirrored=False, **_):
    """What Orbbec's SDK writes of a camera, as far as it is needed to be played. Coefficients are k1 to k6, p1, p2."""
    import numpy as np

    at_s, now_s = 1000.0, time.time()

    def head(seconds):
        return u32(0) + instant(seconds) + text_of("")

    def profile(stream, kind, lens, distortion, distortion_model):
        numbers = (1, 0, 0, 0, 1, 0, 0, 0, 1, *(1000 * value for value in BASELINE_M))
        content = struct.pack("<BB12fHHH12fB", stream, kind, *numbers, WIDTH, HEIGHT, RATE_HZ, *lens, *distortion, distortion_model)
        return f"/cam/streamProfileType_{stream}", "custom_msg/OBStreamProfileInfo", ANY_SUM, at_s, head(at_s) + content

    def setting(number, content):
        content = u32(number) + u32(len(content)) + content + u32(len(content))
        return "/cam/property", "custom_msg/OBProperty", ANY_SUM, at_s, head(at_s) + content

    def frame(stream, encoding, data, number, bits):
        seconds = at_s + number / RATE_HZ
        global_us = round((now_s + number / RATE_HZ) * 1e6)
        stamps = (number, round(seconds * 1e6), global_us, global_us if is_stamped else 0)
        content = u32(HEIGHT) + u32(WIDTH) + text_of(encoding) + b"\0" + u32(len(data) // HEIGHT) + u32(len(data)) + data
        content += struct.pack("<fQQQQ", 0.0, *stamps) + u32(0) + u32(0) + bytes([bits])
        return f"/cam/sensor_{stream}/frameType_{stream}", "sensor_msgs/Image", IMAGE_SUM, seconds, head(seconds) + content

    # Names, numbers, versions, connection, kind, and addresses.
    about = [*map(text_of, ("Femto Bolt", "Femto Bolt", "")), struct.pack("<HH", *FEMTO_BOLT)]
    about += [*map(text_of, ("uid", "5", "1.0.0", "1", "1.0.0", "USB3.2")), struct.pack("<HB", 0, 0), text_of(""), text_of("")]
    models = ob.OBCameraDistortionModel
    messages = [
        ("/cam/deviceInfo", "custom_msg/OBDeviceInfo", DEVICE_SUM, at_s, head(at_s) + b"".join(about)),
        setting(RECORDING_VERSION, struct.pack("<d", 2.1)),
        profile(COLOUR_STREAM, int(getattr(ob.OBFormat, form)), COLOUR, coefficients, int(getattr(models, model))),
        profile(DEPTH_STREAM, int(ob.OBFormat.Y16), DEPTH, (0.0,) * 8, int(models.BROWN_CONRADY)),
    ]
    if is_mirrored:
        messages.append(setting(COLOUR_MIRROR, u32(1)))
    depth = np.rint(1000 * depths()).astype("<u2").tobytes()
    for number in range(frames):
        # Grey without colour, of a brightness that tells the number. Each third JPEG is cut off.
        yuyv = np.full((HEIGHT, WIDTH, 2), (100 + number % 100, 128), np.uint8).tobytes()
        data = yuyv if form == "YUYV" else JPEG[:-2] if number % 3 == 0 else JPEG
        messages.append(frame(COLOUR_STREAM, form.lower(), data, number, 8))
        messages.append(frame(DEPTH_STREAM, "mono16", depth, number, 16))
    write_recording(path, messages)


def run_orbbec(scenario):
    """The driver of Orbbec cameras with a recording."""
    import orbbec

    class Driver(orbbec.Orbbec):
        def find(self):
            recording(self.ob, "recording.bag", **scenario)
            return self.ob.PlaybackDevice("recording.bag")

        def run(self, outlet):
            if scenario.get("is_unplugged"):
                gone = types.SimpleNamespace(get_count=lambda: 1, get_device_uid_by_index=lambda _: "uid")
                threading.Timer(0.3, self.changed, (gone, None)).start()
            super().run(outlet)

    orbbec.Orbbec = Driver
    orbbec.main()


def distortion_of(ob, model, coefficients):
    found = ob.OBCameraDistortion()
    for name, value in zip(("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"), coefficients):
        setattr(found, name, value)
    found.model = getattr(ob.OBCameraDistortionModel, model)
    return found


def in_their_order(rational):
    """k1 k2 p1 p2 k3 k4 k5 k6 as k1 to k6, p1, p2."""
    k1, k2, p1, p2, k3, k4, k5, k6 = [*rational, 0.0, 0.0, 0.0][:8]
    return k1, k2, k3, k4, k5, k6, p1, p2


def orbbec_lenses(_):
    import numpy as np
    import orbbec
    import pyorbbecsdk as ob

    intrinsic = ob.OBCameraIntrinsic()
    intrinsic.fx, intrinsic.fy, intrinsic.cx, intrinsic.cy = COLOUR
    intrinsic.width, intrinsic.height = WIDTH, HEIGHT
    stay = ob.OBExtrinsic()
    stay.rot, stay.transform = np.eye(3), np.zeros(3)

    def project(point, coefficients):
        # It computes one model alone, under this name; it is that of K6. Others are checked by depth that is aligned.
        distortion = distortion_of(ob, "BROWN_CONRADY", coefficients)
        found = ob.transformation3dto2d(ob.OBPoint3f(*(1000 * value for value in point)), intrinsic, distortion, stay)
        return found.x, found.y

    for model, coefficients in (
        ("BROWN_CONRADY", in_their_order(BROWN_CONRADY)),
        ("BROWN_CONRADY_K6", in_their_order(RATIONAL)),
        ("BROWN_CONRADY", (0.0,) * 8),
        ("NONE", (0.0,) * 8),
    ):
        lens, _ = orbbec.lens_of(intrinsic, distortion_of(ob, model, coefficients))
        assert_same_lens(lens, lambda point, of=coefficients: project(point, of))
    assert orbbec.lens_of(intrinsic, distortion_of(ob, "BROWN_CONRADY", in_their_order(RATIONAL)))[0] is None
    for model in ("NONE", "INVERSE_BROWN_CONRADY", "MODIFIED_BROWN_CONRADY"):
        assert "distortion" not in orbbec.lens_of(intrinsic, distortion_of(ob, model, (0.0,) * 8))[0]
        lens, why = orbbec.lens_of(intrinsic, distortion_of(ob, model, in_their_order(BROWN_CONRADY)))
        assert lens is None and model in why, (lens, why)


def orbbec_exposures(_):
    import orbbec

    assert_exposures(orbbec.exposure, is_told_the_middle=False)


class Settable:
    """What of a camera of Orbbec is set."""

    def __init__(self):
        self.values, self.is_related = {}, False

    def is_property_supported(self, which, _):
        return not which.name.endswith("PRIORITY_INT")

    def get_int_property_range(self, _):
        return types.SimpleNamespace(min=1, max=300)

    def set_property(self, which, value):
        self.values[which.name] = value

    set_int_property = set_bool_property = set_property

    def is_global_timestamp_supported(self):
        return True

    def enable_global_timestamp(self, is_on):
        self.is_related = is_on


def orbbec_choices(_):
    import orbbec
    import pyorbbecsdk as ob

    def driver(serials, **options):
        devices = types.SimpleNamespace(
            get_count=lambda: len(serials),
            get_device_serial_number_by_index=lambda i: serials[i],
            get_device_name_by_index=lambda _: "Gemini",
            get_device_by_index=lambda i: f"device {serials[i]}",
        )
        made = orbbec.Orbbec(chosen_of(**options))
        made.ob, made.name, made.device = ob, "it", Settable()
        made.context = types.SimpleNamespace(query_devices=lambda: devices)
        return made

    assert driver("78", serial="8").find() == "device 8" and driver("7").find() == "device 7"
    assert "say which" in fault_of(driver("78").find) and "--serial 7" in fault_of(driver("78").find)
    assert "no camera 9" in fault_of(driver("78", serial="9").find)
    assert "no Orbbec camera is connected" in fault_of(driver("").find)
    assert_plugged(orbbec, "idVendor", "2bc5", driver("").find)
    held = driver("7", exposure=100, gain=16)
    held.set_up(Quiet())
    names = ("AUTO_EXPOSURE_BOOL", "EXPOSURE_INT", "GAIN_INT")
    assert held.device.values == dict(zip((f"OB_PROP_COLOR_{name}" for name in names), (False, 100, 16))), held.device.values
    assert held.device.is_related
    free = driver("7")
    free.set_up(Quiet())
    assert free.device.values == {"OB_PROP_COLOR_AUTO_EXPOSURE_BOOL": True}, free.device.values
    assert "1 to 300" in fault_of(lambda: driver("7", exposure=20_000).set_up(Quiet()))


def orbbec_calls(_):
    """What only a camera answers: that the library has it, with these numbers of values."""
    import pyorbbecsdk as ob

    for owner, name in (
        (ob.Context, "set_device_changed_callback"),
        (ob.DeviceList, "get_device_serial_number_by_index"),
        (ob.DeviceList, "get_device_name_by_index"),
        (ob.DeviceList, "get_device_uid_by_index"),
        (ob.DeviceList, "get_device_by_index"),
        (ob.Device, "enable_global_timestamp"),
        (ob.Device, "set_bool_property"),
        (ob.Device, "set_int_property"),
        (ob.Device, "get_int_property_range"),
        (ob.OBIntPropertyRange, "min"),
        (ob.OBIntPropertyRange, "max"),
        (ob.OBPropertyID, "OB_PROP_COLOR_AUTO_EXPOSURE_BOOL"),
        (ob.OBPropertyID, "OB_PROP_COLOR_AUTO_EXPOSURE_PRIORITY_INT"),
        (ob.OBPropertyID, "OB_PROP_COLOR_EXPOSURE_INT"),
        (ob.OBPropertyID, "OB_PROP_COLOR_GAIN_INT"),
        (ob.OBPropertyID, "OB_PROP_COLOR_MIRROR_BOOL"),
        (ob.OBPropertyID, "OB_PROP_COLOR_FLIP_BOOL"),
        (ob.OBPropertyID, "OB_PROP_COLOR_ROTATE_INT"),
        (ob.OBPermissionType, "PERMISSION_WRITE"),
    ):
        assert hasattr(owner, name), f"{owner.__name__} has no {name}"


def orbbec_images(drivers):
    rational = in_their_order(RATIONAL)
    for scenario in (
        {},
        {"model": "BROWN_CONRADY", "coefficients": in_their_order(BROWN_CONRADY)},
        {"model": "BROWN_CONRADY_K6", "coefficients": rational},
        {"model": "KANNALA_BRANDT4", "coefficients": (*FISHEYE, 0.0, 0.0, 0.0, 0.0)},
    ):
        with started(drivers, "orbbec", scenario) as talk:
            hello = talk.hello()
            assert hello["can"] == ["image", "depth"] and hello["camera"]["width"] == WIDTH, hello
            (image, pixels), (depth, metres) = talk.image(depth=True)
            (later, _), _ = talk.image(after=image["stamp"])
            assert (image["encoding"], len(pixels)) == ("rgb8", 3 * WIDTH * HEIGHT) and later["stamp"] > image["stamp"], image
            assert max(pixels) - min(pixels) <= 2 and min(pixels) > 90, (min(pixels), max(pixels))
            assert -0.1 < time.monotonic() - image["stamp"] < 2.0, image
            assert abs(image["stamp_uncertainty_s"] - 1 / RATE_HZ) < 1e-9, image
            assert depth["encoding"] == "f32_m" and abs(depth["stamp"] - image["stamp"]) < 1 / RATE_HZ, depth
            assert_aligned(metres, hello["camera"]["intrinsics"])
        assert talk.written == ["recording.bag"], f"it writes {talk.written}"
    with started(drivers, "orbbec", {"form": "MJPG", "is_stamped": False}, "--no-depth") as talk:
        assert talk.hello()["can"] == ["image"]
        stamp = None
        for _ in range(4):
            (image, data), _ = talk.image(after=stamp)
            stamp = image["stamp"]
            assert image["encoding"] == "jpeg" and data == JPEG, (image, data[-4:])
            assert abs(image["stamp_uncertainty_s"] - 1.5 / RATE_HZ) < 1e-9, image
        assert "when frames arrive" in talk.said(), talk.said()
    with started(drivers, "orbbec", {"model": "INVERSE_BROWN_CONRADY", "coefficients": rational}) as talk:
        hello = talk.hello()
        assert hello["can"] == ["image"] and "intrinsics" not in hello["camera"], hello
        talk.image()


def orbbec_ends(drivers):
    for scenario, options, expected in (
        ({"is_unplugged": True}, (), "was unplugged"),
        ({"frames": 5}, (), "has sent no frame for 5 s"),
        ({"is_mirrored": True}, (), "COLOR_MIRROR_BOOL"),
        ({}, ("--size", "640x480"), f"{WIDTH}x{HEIGHT} YUYV at {RATE_HZ} Hz"),
        ({}, ("--exposure", "100"), "no exposure that can be set"),
    ):
        with started(drivers, "orbbec", scenario, *options) as talk:
            assert expected in (text := ending(talk)), text


# ------------------------------------------------------------------------------------------------------------------------- all


def nothing_connected(module, expected):
    """With no camera. On a computer that has one the driver works, which this does not look at."""

    def check(drivers):
        with Talk([sys.executable, str(pathlib.Path(drivers, f"{module}.py").resolve())]) as talk:
            try:
                print(f"     a camera is connected: {talk.hello()['name']}")
            except Ended as ended:
                assert expected in str(ended), ended
        assert not talk.written, f"it writes {talk.written}"

    return check


CHECKS = {
    "pyrealsense2": {
        "RealSense: a lens that is sent projects as librealsense does, and others are not sent": realsense_lenses,
        "RealSense: every exposure that is possible is within what is stated": realsense_exposures,
        "RealSense: camera, size, rate and exposure are those that are asked for, or it is said what there is": realsense_choices,
        "RealSense: images, stamps, and depth in metres where the lens shows it": realsense_images,
        "RealSense: a camera that is unplugged, or silent, ends the driver": realsense_ends,
        "RealSense: without a camera it is said what to do": nothing_connected("realsense", "no RealSense camera is connected"),
    },
    "pyorbbecsdk": {
        "Orbbec: a lens that is sent projects as the SDK does, and others are not sent": orbbec_lenses,
        "Orbbec: every exposure that is possible is within what is stated": orbbec_exposures,
        "Orbbec: camera and exposure are those that are asked for, or it is said what there is": orbbec_choices,
        "Orbbec: what only a camera answers is in the SDK": orbbec_calls,
        "Orbbec: images, stamps, and depth in metres where the lens shows it": orbbec_images,
        "Orbbec: a camera that is unplugged, silent or mirrored, and what it does not offer, end the driver": orbbec_ends,
        "Orbbec: without a camera it is said what to do": nothing_connected("orbbec", "no Orbbec camera is connected"),
    },
}


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    drivers = sys.argv[1]
    sys.path.insert(0, str(pathlib.Path(drivers).resolve()))
    if len(sys.argv) > 3:
        module, scenario = sys.argv[2], json.loads(sys.argv[3])
        del sys.argv[1:4]
        return {"realsense": run_realsense, "orbbec": run_orbbec}[module](scenario)
    drivers, failed = str(pathlib.Path(drivers).resolve()), 0
    for library, checks in CHECKS.items():
        try:
            found = importlib.import_module(library)
        except ImportError as error:
            print(f"skipped  {len(checks)} checks: this Python has no {library} ({error})")
            continue
        if library == "pyorbbecsdk":
            found.Context.set_logger_to_file(found.OBLogLevel.NONE, "")
        for name, check in checks.items():
            try:
                check(drivers)
                print(f"ok       {name}", flush=True)
            except Exception as error:
                failed += 1
                print(f"FAILED   {name}: {type(error).__name__}: {error}", flush=True)
    sys.stdout.flush()
    os._exit(1 if failed else 0)  # libraries have threads that would go on


if __name__ == "__main__":
    main()
