"""Tests of the parts of assets/drivers that need no device: frames of tf, messages of ROS, pose files, clocks, stamps."""

import base64
import math
import pathlib
import struct
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "assets" / "drivers"))
import folder
import handeye_driver
import rosbridge
import v4l
from handeye_driver import Fault, quaternion


def at(x, turn_deg):
    return (x, 0.0, 0.0), quaternion((0.0, 0.0, math.radians(turn_deg)))


class Clock(unittest.TestCase):
    def test_the_fastest_message_tells_the_time_and_is_forgotten_when_the_clock_is_set(self):
        clock = handeye_driver.DeviceClock()
        self.assertEqual(clock.at(5.0), 5.0)
        for i in range(100):
            # The other clock is 1000 s ahead; messages take 1 ms, and every other 20 ms.
            own = 10.0 + 0.1 * i
            clock.heard(own + (1e-3 if i % 2 == 0 else 20e-3), own + 1000.0)
        self.assertAlmostEqual(clock.at(20.0), 1019.999, places=9)
        clock.heard(100.0, 1095.0)
        self.assertAlmostEqual(clock.at(101.0), 1096.0, places=9)
        self.assertLessEqual(len(clock.buckets), 31)

    def test_a_faster_message_does_not_make_the_time_jump(self):
        clock = handeye_driver.DeviceClock()
        clock.heard(0.010, 0.0)
        before = clock.at(1.0)
        clock.heard(1.001, 1.0)
        self.assertLess(abs(clock.at(2.0) - before - 1.0), 1e-4)
        self.assertAlmostEqual(clock.at(1000.0), 999.999, places=9)


class Frames(unittest.TestCase):
    def tree(self):
        tree = rosbridge.Tree()
        tree.insert("/world", "base_link", 0.0, at(5.0, 90.0), True)
        tree.insert("base_link", "link_1", 10.0, at(1.0, 0.0), False)
        tree.insert("base_link", "link_1", 10.2, at(1.0, 20.0), False)
        tree.insert("link_1", "tool0", 10.1, at(0.5, 0.0), False)
        tree.insert("world", "camera", 0.0, at(0.0, 0.0), True)
        return tree

    def assert_equal(self, pose, expected):
        for a, b in zip(pose[0] + pose[1], expected[0] + expected[1]):
            self.assertAlmostEqual(a, b, places=12)

    def test_the_pose_is_of_the_newest_instant_at_which_every_link_is_known(self):
        instant, pose = self.tree().newest("base_link", "tool0")
        self.assertEqual(instant, 10.1)
        self.assert_equal(pose, rosbridge.compose(at(1.0, 10.0), at(0.5, 0.0)))

    def test_a_chain_may_lead_up_and_down_and_may_be_at_rest(self):
        instant, pose = self.tree().newest("camera", "base_link")
        self.assertIsNone(instant)
        self.assert_equal(pose, at(5.0, 90.0))
        _, inverse = self.tree().newest("base_link", "camera")
        self.assert_equal(rosbridge.compose(inverse, pose), rosbridge.IDENTITY)

    def test_what_is_missing_is_named(self):
        tree = self.tree()
        with self.assertRaisesRegex(rosbridge.NoChain, 'no frame "base"'):
            tree.newest("base", "tool0")
        tree.insert("map", "odom", 1.0, at(0.0, 0.0), True)
        with self.assertRaisesRegex(rosbridge.NoChain, 'one hangs on "world", the other on "map"'):
            tree.newest("tool0", "odom")
        self.assertEqual(tree.describe(), "map\n  odom\nworld\n  base_link\n    link_1\n      tool0\n  camera")

    def test_a_loop_of_frames_ends_and_frames_are_bounded(self):
        tree = rosbridge.Tree()
        tree.insert("a", "b", 1.0, at(0.0, 0.0), False)
        tree.insert("b", "a", 1.0, at(0.0, 0.0), False)
        tree.newest("a", "b")
        tree.describe()
        taken = sum(tree.insert("world", f"f{i}", 0.0, at(0.0, 0.0), True) for i in range(5000))
        self.assertEqual(taken, rosbridge.MOST_FRAMES - 2)

    def test_values_are_interpolated_among_the_samples_and_nowhere_else(self):
        samples = rosbridge.Samples()
        self.assertIsNone(samples.at(1.0, rosbridge.line))
        samples.push(1.0, (10.0,))
        samples.push(3.0, (30.0,))
        found = [samples.at(stamp, rosbridge.line) for stamp in (0.9, 1.0, 2.5, 3.0, 3.1)]
        self.assertEqual(found, [None, (10.0,), (25.0,), (30.0,), None])
        samples.push(0.5, (5.0,))
        self.assertIsNone(samples.at(1.0, rosbridge.line), "the clock went back")


def image(encoding, step, pixels, **more):
    header = {"stamp": {"sec": 7, "nanosec": 0}}
    text = base64.b64encode(bytes(pixels)).decode()
    plain = {"header": header, "width": 2, "height": 2, "is_bigendian": 0, "encoding": encoding, "step": step, "data": text}
    return {**plain, **more}


def info(model, d, **more):
    k = [600.0, 0.0, 320.5, 0.0, 601.0, 240.5, 0.0, 0.0, 1.0]
    p = [590.0, 0.0, 321.0, 0.0, 0.0, 591.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    return {"width": 640, "height": 480, "distortion_model": model, "D": d, "K": k, "P": p, **more}


class Messages(unittest.TestCase):
    def test_rows_lose_their_padding_and_alpha_and_keep_the_order_of_their_colours(self):
        data, fields = rosbridge.picture(image("bgr8", 8, [1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0]))
        self.assertEqual((fields["encoding"], fields["stamp"], list(data)), ("bgr8", 7.0, list(range(1, 13))))
        alpha, _ = rosbridge.picture(image("bgra8", 8, [1, 2, 3, 255, 4, 5, 6, 255, 7, 8, 9, 255, 10, 11, 12, 255]))
        self.assertEqual(alpha, data)
        grey, _ = rosbridge.picture(image("mono8", 2, [1, 2, 3, 4]))
        self.assertEqual(list(grey), [1, 2, 3, 4])

    def test_depth_is_millimetres_or_metres_with_the_little_end_first(self):
        little, fields, size = rosbridge.depth_image(image("16UC1", 4, [1, 0, 2, 0, 3, 0, 4, 1]))
        self.assertEqual((fields["encoding"], size, list(little)), ("u16_mm", (2, 2), [1, 0, 2, 0, 3, 0, 4, 1]))
        big = image("16UC1", 4, [], is_bigendian=True, data=[0, 1, 0, 2, 0, 3, 1, 4])
        self.assertEqual(rosbridge.depth_image(big)[0], little)
        metres = image("32FC1", 8, struct.pack("<4f", 0.5, 1.0, math.nan, 2.0))
        self.assertEqual(rosbridge.depth_image(metres)[1]["encoding"], "f32_m")

    def test_what_cannot_be_read_is_refused_with_what_could(self):
        for message, expected in [
            (image("bayer_rggb8", 2, [0] * 4), "bayer_rggb8.*mono8"),
            (image("rgb8", 6, [0] * 11), "11 bytes"),
            (image("rgb8", 5, [0] * 12), "rows of 5 bytes"),
            (image("rgb8", 2**32, [0] * 12), "bytes"),
            (image("", 0, [], format="jpeg", data="AAAA"), "compressed image"),
            (image("", 0, [], format="16UC1; compressedDepth png", data="AAAA"), "raw"),
        ]:
            with self.assertRaisesRegex(Fault, expected):
                rosbridge.picture(message)
        with self.assertRaisesRegex(Fault, "32FC1"):
            rosbridge.depth_image(image("rgb8", 6, [0] * 12))

    def test_raw_images_have_the_matrix_and_the_distortion_and_rectified_ones_the_projection(self):
        d = [0.1, -0.2, 0.001, 0.002, 0.05]
        raw = rosbridge.lens(info("plumb_bob", d), (640, 480), False)
        bent = {"model": "brown_conrady", "coefficients": d}
        self.assertEqual(raw, {"fx": 600.0, "fy": 601.0, "cx": 320.5, "cy": 240.5, "distortion": bent})
        rectified = rosbridge.lens(info("plumb_bob", d), (640, 480), True)
        self.assertEqual(rectified, {"fx": 590.0, "fy": 591.0, "cx": 321.0, "cy": 241.0})

    def test_lens_models_are_taken_as_opencv_orders_them_or_refused(self):
        d = [float(i) for i in range(1, 9)]
        self.assertEqual(rosbridge.distortion("rational_polynomial", d + [0.0] * 6)["coefficients"], d)
        self.assertEqual(rosbridge.distortion("equidistant", d[:4]), {"model": "fisheye", "coefficients": d[:4]})
        self.assertIsNone(rosbridge.distortion("anything", [0.0] * 5))
        for model, count in (("plumb_bob", 8), ("rational_polynomial", 5), ("thin_prism", 8)):
            with self.assertRaises(Fault):
                rosbridge.distortion(model, d[:count])
        for wrong, expected in (({"K": [0.0] * 9}, "not calibrated"), ({"binning_x": 2}, "binned"), ({"width": 320}, "320×480")):
            with self.assertRaisesRegex(Fault, expected):
                rosbridge.lens(info("plumb_bob", [], **wrong), (640, 480), False)

    def test_joint_values_come_in_the_order_that_was_asked_for_and_between_messages(self):
        joints = rosbridge.Joints(["lift", "pan"])

        def take(at, names, positions):
            joints.take({"header": {"stamp": {"secs": at, "nsecs": 0}}, "name": names, "position": positions})

        take(1, ["elbow", "pan", "lift"], [9.0, 1.0, 2.0])
        take(2, ["gripper"], [0.0])
        take(2, ["pan", "lift"], [None, 5.0])
        take(3, ["elbow", "pan", "lift"], [9.0, 2.0, 4.0])
        self.assertEqual(joints.samples.at(2.0, rosbridge.line), (3.0, 1.5))
        self.assertIsNone(joints.samples.at(4.0, rosbridge.line))

    def test_pieces_of_two_messages_in_any_order_and_twice_make_both_and_are_bounded(self):
        bridge, whole = rosbridge.Bridge("ws://a", None), []
        protocol = type("Protocol", (), {"on_message": lambda self, data: whole.append(data)})()

        def piece(identity, num, total, data):
            bridge.piece(protocol, {"id": identity, "num": num, "total": total, "data": data})

        for words in [(1, 2, 3, "c"), (2, 0, 2, "x"), (1, 0, 3, "a"), (1, 0, 3, "a"), (2, 1, 2, "y"), (1, 1, 3, "b")]:
            piece(*words)
        self.assertEqual(whole, [b"xy", b"abc"])
        for identity in range(1000):
            piece(identity, 0, 2, "half")
        self.assertLessEqual(len(bridge.pieces), 4)
        for num, total in ((2, 2), (0, 0), (0, 1 << 40)):
            with self.assertRaises(ValueError):
                piece(1, num, total, "")

    def test_the_joints_of_a_urdf_are_those_between_the_frames(self):
        arm = str(pathlib.Path(__file__).parents[2] / "assets" / "arms" / "panda.urdf")
        joints = rosbridge.joints_of_urdf(arm, "panda_link0", "panda_link8")
        self.assertEqual([joint["name"] for joint in joints], [f"panda_joint{i}" for i in range(1, 8)])
        self.assertEqual((joints[0]["kind"], joints[0]["min"]), ("revolute", -2.8973))
        with self.assertRaisesRegex(Fault, "no chain of joints from panda_link0 to tool0"):
            rosbridge.joints_of_urdf(arm, "panda_link0", "tool0")

    def test_an_address_that_is_none_is_refused(self):
        self.assertEqual(rosbridge.address("ws://robot"), ("robot", 9090))
        self.assertEqual(rosbridge.address("ws://[::1]:9091"), ("::1", 9091))
        for url, expected in (("http://a:1", "does not begin with ws://"), ("wss://a", "encrypted"), ("ws://a:b", "Port"), ("ws://", "host")):
            with self.assertRaisesRegex(Fault, expected):
                rosbridge.address(url)


def form(**keys):
    return folder.Format({"length_unit": "m", "rotation": "quaternion_xyzw", "pose": "base_from_tip", **keys})


class Poses(unittest.TestCase):
    def setUp(self):
        home = tempfile.TemporaryDirectory()
        self.addCleanup(home.cleanup)
        self.home = pathlib.Path(home.name)

    def write(self, name, text):
        (self.home / name).write_text(text, encoding="utf-8")
        return str(self.home / name)

    def test_a_pose_is_read_from_each_kind_of_file_and_a_wrong_one_is_named(self):
        for name, text in [
            ("a.json", "[0.1, 0.2, 0.3, 0, 0, 0, 1]"),
            ("b.json", '{"x":0.1,"y":0.2,"z":0.3,"qx":0,"qy":0,"qz":0,"qw":1,"note":"by hand"}'),
            ("c.txt", "0.1 0.2 0.3 0 0 0 1\n"),
            ("d.csv", "x,y,z,qx,qy,qz,qw\n0.1,0.2,0.3,0,0,0,1\n"),
        ]:
            self.assertEqual(folder.pose_in_file(self.write(name, text), form()).translation, [0.1, 0.2, 0.3])
        for name, text, expected in [
            ("e.json", "[0.1, 0.2, 0.3, 0, 0, 1]", "6 numbers, where 7 are needed: x, y, z, qx, qy, qz, qw"),
            ("f.json", '{"x":0.1}', "it has no 'y'"),
            ("g.txt", "0.1 0.2 0.3 0 0 0 2\n", "length 2"),
            ("h.csv", "x,y,z,qw,qx,qy,qz\n0.1,0.2,0.3,1,0,0,0\n", "its columns are x, y, z, qw"),
            ("i.txt", "", "0 rows"),
            ("j.json", "[0.1, null, 0.3, 0, 0, 0, 1]", "y = None is not a number"),
        ]:
            with self.assertRaisesRegex(folder.Wrong, f"{name}: .*{expected}"):
                folder.pose_in_file(self.write(name, text), form())

    def test_conventions_are_those_that_are_given(self):
        turn = quaternion((0.3, -1.1, 0.7))
        columns = [handeye_driver.turned(turn, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        rows = [columns[j][i] for i in range(3) for j in range(3)]
        half = [math.degrees(v) for v in (0.3, -1.1, 0.7)]
        for keys, cells in [
            ({}, turn),
            ({"rotation": "quaternion_wxyz"}, (turn[3], *turn[:3])),
            ({"rotation": "rotation_vector", "angle_unit": "deg"}, half),
            ({"rotation": "matrix"}, rows),
        ]:
            found = form(length_unit="mm", **keys).pose([100, 200, 300, *cells])
            for a, b in zip((*found.translation, *found.rotation), (0.1, 0.2, 0.3, *turn)):
                self.assertAlmostEqual(a, b, places=12)
        # Of a URDF: about the fixed axes x, then y, then z.
        rpy = form(rotation="rpy", angle_unit="rad").pose([0, 0, 0, 0.1, 0.2, 0.3]).rotation
        about = [quaternion(axis) for axis in ((0.1, 0, 0), (0, 0.2, 0), (0, 0, 0.3))]
        expected = handeye_driver.times(about[2], handeye_driver.times(about[1], about[0]))
        self.assertEqual(rpy, expected)
        back = form(rotation="rotation_vector", angle_unit="deg", pose="tip_from_base").pose([0.1, 0, 0, 0, 0, 90])
        for a, b in zip(back.translation, (0.0, 0.1, 0.0)):
            self.assertAlmostEqual(a, b, places=12)
        joints = form(joints=2, joint_unit="deg").pose([0, 0, 0, 0, 0, 0, 1, 90, -180]).joints
        self.assertEqual(joints, [math.pi / 2, -math.pi])

    def test_a_convention_that_is_not_given_or_not_one_is_asked_for(self):
        for keys, expected in [
            ({"rotation": "rpy"}, "angle_unit is missing: it is one of rad, deg"),
            ({"length_unit": "cm"}, "length_unit = 'cm' is not usable"),
            ({"joints": 13}, "joints = 13"),
            ({"joints": 6}, "joint_unit is missing"),
        ]:
            with self.assertRaisesRegex(folder.Wrong, expected):
                form(**keys)

    def test_matrices_are_made_exact_or_refused(self):
        turn = quaternion((0.3, -1.1, 0.7))
        columns = [handeye_driver.turned(turn, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        # A rotation that is stretched symmetrically is the nearest to the product.
        stretch = [[1.0004, 0.0002, 0.0001], [0.0002, 0.9996, 0.0001], [0.0001, 0.0001, 1.0003]]
        off = folder.product([[columns[j][i] for j in range(3)] for i in range(3)], stretch)
        found = form(rotation="matrix").pose([0, 0, 0, *off[0], *off[1], *off[2]]).rotation
        for a, b in zip(found, turn):
            self.assertAlmostEqual(a, b, places=9)
        for matrix, expected in (([1, 0, 0, 0, 1, 0, 0, 0, -1], "mirrors"), ([2, 0, 0, 0, 1, 0, 0, 0, 1], "orthonormal")):
            with self.assertRaisesRegex(folder.Wrong, expected):
                form(rotation="matrix").pose([0, 0, 0, *matrix])
        with self.assertRaisesRegex(folder.Wrong, "two turns: check angle_unit"):
            form(rotation="rpy", angle_unit="rad").pose([0, 0, 0, 90, 0, 0])

    def test_a_row_counts_when_its_line_has_ended_or_the_table_rests(self):
        path = str(self.home / "poses.csv")
        table = folder.Table(path, form(rotation="rpy", angle_unit="rad"))

        def append(text):
            with open(path, "a", encoding="utf-8") as file:
                file.write(text)

        def count(now_s):
            table.look(now_s)
            return len(table.rows)

        self.assertEqual(count(0.0), 0, "there is none yet")
        append("image,x,y,z,roll,pitch,yaw\n")
        self.assertEqual(count(1.0), 0)
        append("a.png,1,2,3,0,0,0\nb.png,1,2,3,0,0,1")
        self.assertEqual(count(1.1), 1, "the line of b.png may go on")
        append(".5\n")
        self.assertEqual(count(1.2), 2)
        append("c.png,1,2,3,0,0,0")
        self.assertEqual(count(1.3), 2)
        self.assertEqual(count(2.4), 3, "nobody has added to it for a second")
        append("\nd.png,1,2,three,0,0,0\n")
        with self.assertRaisesRegex(folder.Wrong, "row 5: y = 'three'|row 5: z = 'three'"):
            table.look(3.0)
        self.assertEqual(count(3.1), 3, "what is wrong is raised once")
        for wrong, expected in (
            ("image,x,y,z\n1,2,3,4\n", "the header must be image,x,y,z,roll,pitch,yaw or image,x,y,z,rx,ry,rz"),
            ("image,x,y,z,rx,ry,rz\na,1,2,3,0,0,0\n./a,1,2,3,0,0,0\n", "already in row 2"),
            ("image,x,y,z,rx,ry,rz\na,1,2,3,0,0,0,5\n", "8 cells, the header has 7"),
        ):
            with self.assertRaisesRegex(folder.Wrong, expected):
                table.read(wrong)

    def test_names_are_sorted_as_people_count(self):
        names = ["2", "10", "a", "a01", "a1", "a2", "a10", "a10b2", "a10b10", "b1", "image-9.png", "image-10.png", "é2"]
        self.assertEqual(sorted(reversed(names), key=folder.natural), names)


class Camera(unittest.TestCase):
    def test_the_middle_of_every_exposure_that_is_possible_is_within_what_is_stated(self):
        interval_s = 1 / 30
        for exposed in (0.001, 0.5, 1.0):
            for read_out in (0.1, 0.5, 1.0):
                for waited in (0.0, 1.0):
                    begin_s = 100.0
                    middle_s = begin_s + 0.5 * exposed * interval_s
                    end_s = begin_s + (exposed + read_out) * interval_s
                    # Of the begin, the first packet, the end, and of another clock.
                    for stamp_s in (begin_s, begin_s + exposed * interval_s, end_s, 1.7e9):
                        stated_s, within_s, _ = v4l.exposure(stamp_s, end_s + waited * interval_s, interval_s)
                        self.assertLessEqual(abs(stated_s - middle_s), within_s + 1e-9)

    def test_each_trouble_is_answered_with_what_to_do(self):
        for error, expected in (
            (FileNotFoundError(2, "no"), "there is no /dev/video7"),
            (PermissionError(13, "no"), "group `video`"),
            (OSError(16, "busy"), "another program"),
            (OSError(12, "no memory"), "no memory"),
        ):
            self.assertIn(expected, v4l.trouble("/dev/video7", error))


if __name__ == "__main__":
    unittest.main()
