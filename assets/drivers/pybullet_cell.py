# /// script
# requires-python = ">=3.9"
# dependencies = ["pybullet>=3.2,<4", "numpy<3"]
# ///
"""A driver of Handeye Workbench with a cell simulated by PyBullet: an arm, a camera and a chessboard.

No display and no graphics card are needed: images are rendered by PyBullet's own TinyRenderer. Its arms are a Franka Panda, a KUKA
iiwa and a UFACTORY xArm 6, and with --urdf and --tip any other that PyBullet loads. The workbench calibrates the camera on the arm,
or with --eye-to-hand one beside it:

    handeye driver test "handeye driver pybullet" --allow-motion

    handeye auto --driver "handeye driver pybullet --truth truth.json" \\
        --allow-motion --speed 100 --target 10x7x15 --poses guided --out panda

    handeye auto --driver "handeye driver pybullet --arm xarm6 --eye-to-hand" \\
        --mode eye_to_hand --allow-motion --speed 100 --target 10x7x15 \\
        --poses guided --out xarm6

Run with PyBullet 3.2.7, and numpy 2.0 and 2.4, on Python 3.9 and 3.11.
"""

import math
import os

from handeye_driver import Fault, parser, turned
from simulated_cell import DARK, FAR_M, FASTEST, LIGHT, NEAR_M, add_options, compose, in_radians, inverse, package, serve_cell


class Arm:
    """One that comes with PyBullet: its file in pybullet_data, its tip, and where it begins with the camera or the board on it
    [deg]: with the camera over the table, and with the board turned to the front."""

    def __init__(self, urdf, tip, over_table, to_front):
        self.urdf, self.tip, self.over_table, self.to_front = urdf, tip, over_table, to_front


ARMS = {
    "panda": Arm("franka_panda/panda.urdf", "panda_hand", [0, -20, 0, -140, 0, 120, 45], [0, -20, 0, -120, 0, 170, 45]),
    "iiwa": Arm("kuka_iiwa/model.urdf", "lbr_iiwa_link_7", [0, 30, 0, -100, 0, 50, 0], [0, 10, 0, -90, 0, 10, 0]),
    "xarm6": Arm("xarm/xarm6_robot.urdf", "link6", [0, -20, -50, 0, 70, 0], [0, -40, -70, 0, 40, 0]),
}
# Types of joints, as PyBullet numbers them.
REVOLUTE, PRISMATIC, FIXED = 0, 1, 4
# The table: its edge and thickness [m], with its upper side at z = 0, and its colour.
TABLE_M, TABLE_COLOUR = (3.0, 0.02), (0.62, 0.6, 0.56, 1)


class PyBulletCell:
    def __init__(self, options):
        self.pybullet = package("pybullet", "pybullet numpy")
        package("numpy", "numpy")
        self.client = self.pybullet.connect(self.pybullet.DIRECT)
        urdf, tip, start = chosen(options)
        self.name = f"PyBullet cell, {options.arm or os.path.basename(urdf)}"
        try:
            self.body = self.pybullet.loadURDF(urdf, useFixedBase=True)
        except self.pybullet.error as error:
            raise Fault(f"PyBullet does not load {urdf} ({error}); standard error says why") from None
        self.index, self.tip, self.joints, self.fastest = self.chain(urdf, tip)
        base = self.pybullet.getBodyInfo(self.body)[0].decode()
        self.arm = {"urdf": os.path.abspath(urdf), "base_link": base, "tip_link": tip}
        self.start = in_radians(start or [0.0] * len(self.joints), self.joints)
        self.camera = None
        self.board = []

    def chain(self, urdf, tip):
        """The joints that move, the tip's number, and of the joints what `hello` has and how fast they are, from the base up."""
        links = [self.pybullet.getJointInfo(self.body, i) for i in range(self.pybullet.getNumJoints(self.body))]
        names = [link[12].decode() for link in links]
        if tip not in names:
            raise Fault(f"{urdf} has no link {tip!r} below its base: its links are {', '.join(names)}")
        number, index = names.index(tip), []
        while number >= 0:
            index.append(number)
            number = links[number][16]
        moving = [i for i in reversed(index) if links[i][2] != FIXED]
        joints, fastest = [], []
        for i in moving:
            name, kind, least, most, speed = links[i][1].decode(), links[i][2], *links[i][8:10], links[i][11]
            if kind not in (REVOLUTE, PRISMATIC):
                raise Fault(f"the joint {name} of {urdf} is neither revolute nor prismatic")
            kind = "revolute" if kind == REVOLUTE else "prismatic"
            joints.append({"name": name, "kind": kind, **({"min": least, "max": most} if least < most else {})})
            fastest.append(min(speed or math.inf, FASTEST[kind]))
        if not joints:
            raise Fault(f"no joint of {urdf} moves {tip}")
        return moving, names.index(tip), joints, fastest

    def put(self, joints):
        for index, value in zip(self.index, joints):
            self.pybullet.resetJointState(self.body, index, value)

    def base_from_tip(self, joints):
        self.put(joints)
        # Of the link's frame; [0] and [1] are those of its centre of mass.
        return self.pybullet.getLinkState(self.body, self.tip, computeForwardKinematics=True)[4:6]

    def furnish(self, options):
        edge, thickness = TABLE_M
        box = [edge / 2, edge / 2, thickness / 2]
        table = self.pybullet.createVisualShape(self.pybullet.GEOM_BOX, halfExtents=box, rgbaColor=TABLE_COLOUR)
        self.pybullet.createMultiBody(0, -1, table, [0, 0, -thickness / 2])
        for is_dark, grey in ((True, DARK), (False, LIGHT)):
            vertices, indices = [], []
            for (x, y), (other_x, other_y), dark in options.board.rectangles():
                if dark == is_dark:
                    first = len(vertices)
                    vertices += [(x, y, 0), (x, other_y, 0), (other_x, other_y, 0), (other_x, y, 0)]
                    indices += [first, first + 1, first + 2, first, first + 2, first + 3]
            shape = self.pybullet.createVisualShape(
                self.pybullet.GEOM_MESH,
                vertices=vertices,
                indices=indices,
                normals=[(0, 0, -1)] * len(vertices),
                rgbaColor=(grey, grey, grey, 1),
            )
            self.board.append(self.pybullet.createMultiBody(0, -1, shape))

    def render(self, joints, base_from_camera, base_from_target, lens, with_depths):
        import numpy as np

        self.put(joints)
        for body in self.board:
            self.pybullet.resetBasePositionAndOrientation(body, *base_from_target)
        width, height = lens["width"], lens["height"]
        _, _, colours, depths, _ = self.pybullet.getCameraImage(
            width,
            height,
            self.view_matrix(base_from_camera),
            projection_matrix(lens),
            # Beside the camera, far away: the board is as bright at one end as at the other, without shadows and highlights.
            lightDirection=turned(base_from_camera[1], (0, 0, -1)),
            lightAmbientCoeff=0.55,
            lightDiffuseCoeff=0.45,
            lightSpecularCoeff=0,
            shadow=0,
            renderer=self.pybullet.ER_TINY_RENDERER,
            flags=self.pybullet.ER_NO_SEGMENTATION_MASK,
        )
        colours = np.asarray(colours, dtype=np.uint8).reshape(height, width, 4)
        if not with_depths:
            return colours, None
        depths = np.asarray(depths, dtype=np.float64).reshape(height, width)
        # 0 to 1 between the planes, evenly in the inverse of the distance.
        return colours, FAR_M * NEAR_M / (FAR_M - (FAR_M - NEAR_M) * depths)

    def view_matrix(self, base_from_camera):
        """Column by column. A camera of OpenGL looks along -z, with y up: half a turn about x from ours."""
        (x, y, z), q = inverse(compose(base_from_camera, ((0, 0, 0), (1, 0, 0, 0))))
        a, b, c, d, e, f, g, h, i = self.pybullet.getMatrixFromQuaternion(q)
        return [a, d, g, 0, b, e, h, 0, c, f, i, 0, x, y, z, 1]


def chosen(options):
    """The URDF, the name of the tip and the joint values at the start [deg, mm]."""
    if options.urdf:
        if not options.tip:
            raise Fault("--urdf needs --tip: the link whose pose is reported, and that carries the camera or the board")
        if not os.path.isfile(options.urdf):
            raise Fault(f"there is no file {options.urdf}")
        return options.urdf, options.tip, options.start
    arm = ARMS[options.arm or "panda"]
    folder = package("pybullet_data", "pybullet numpy").getDataPath()
    start = options.start or (arm.to_front if options.eye_to_hand else arm.over_table)
    return os.path.join(folder, arm.urdf), options.tip or arm.tip, start


def projection_matrix(lens):
    """Column by column.

    TinyRenderer is not OpenGL: it looks at integer places, and has the middle of a W × H image at column W / 2 and row H / 2 - 1,
    (0, 0) being the centre of the first pixel; OpenGL has it at (W - 1) / 2 and (H - 1) / 2. Measured by edges at known places.
    The third column shifts the picture so that the axis is where the lens has it.
    """
    width, height = lens["width"], lens["height"]
    right, up = 1 - 2 * lens["cx"] / width, 2 * (lens["cy"] + 1) / height - 1
    z, w = -(FAR_M + NEAR_M) / (FAR_M - NEAR_M), -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    return [2 * lens["fx"] / width, 0, 0, 0, 0, 2 * lens["fy"] / height, 0, 0, right, up, z, -1, 0, 0, w, 0]


def main():
    options = parser(__doc__)
    options.add_argument("--arm", choices=ARMS, help="an arm that comes with PyBullet, panda if none is given")
    options.add_argument("--urdf", metavar="FILE", help="another arm; with --tip, and --start")
    options.add_argument("--tip", metavar="LINK", help="the link whose pose is reported, and that carries the camera or the board")
    add_options(options, samples=16)
    given = options.parse_args()
    if given.arm and given.urdf:
        options.error("either --arm or --urdf")
    serve_cell(PyBulletCell, given)


if __name__ == "__main__":
    main()
