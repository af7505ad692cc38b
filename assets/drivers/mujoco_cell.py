# /// script
# requires-python = ">=3.9"
# dependencies = ["mujoco>=3.2.7,<5", "numpy<3"]
# ///
"""A driver of Handeye Workbench with a cell simulated by MuJoCo: an arm, a camera and a chessboard.

On Linux images are rendered without a display by EGL or OSMesa, in software where there is no graphics card: on Debian and Ubuntu
apt install libegl1 libgl1-mesa-dri, or libosmesa6. MUJOCO_GL=egl, osmesa or glfw chooses among them. Its own arm has the dimensions
of a Universal Robots UR5e; --model and --tip name another one, such as those of MuJoCo Menagerie, to which camera and board are
added. The workbench calibrates the camera on the arm, or with --eye-to-hand one beside it:

    handeye driver test "handeye driver mujoco" --allow-motion

    handeye auto --driver "handeye driver mujoco --truth truth.json" \\
        --allow-motion --speed 100 --target 10x7x15 --poses guided --out ur5e

    handeye auto --driver "handeye driver mujoco --eye-to-hand" \\
        --mode eye_to_hand --allow-motion --speed 100 --target 10x7x15 \\
        --poses guided --out beside

    handeye auto --driver "handeye driver mujoco --model scene.xml --tip site" \\
        --allow-motion --speed 100 --target 10x7x15 --poses guided --out other

Run with MuJoCo 3.2.7, 3.3.7 and 4.0.0 by EGL in software, on Python 3.9 and 3.11; OSMesa gave the same image as EGL.
"""

import ctypes.util
import math
import os
import sys
from xml.etree import ElementTree

from handeye_driver import Fault, parser, quaternion, turned
from simulated_cell import (
    DARK, FAR_M, FASTEST, LIGHT, NEAR_M, add_options, compose, in_radians, inverse, lens, package, serve_cell,
    transformed,
)  # fmt: skip

# The arm that there is without a model: frames and lengths by the maker's Denavit and Hartenberg rows, links as capsules.
UR5E = """
<mujoco model="arm of a UR5e's dimensions">
  <default>
    <geom type="capsule" contype="0" conaffinity="0" rgba="0.55 0.62 0.7 1"/>
    <joint type="hinge" axis="0 0 1" range="-360 360" limited="true"/>
  </default>
  <visual>
    <headlight ambient="0.5 0.5 0.5" diffuse="0.35 0.35 0.35" specular="0 0 0"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.8 0.85 0.9" rgb2="0.6 0.65 0.7" width="64" height="64"/>
  </asset>
  <worldbody>
    <light directional="true" dir="-0.1 0.3 -1" diffuse="0.15 0.15 0.15" specular="0 0 0" castshadow="false"/>
    <geom name="table" type="box" size="1.5 1.5 0.01" pos="0 0 -0.01" rgba="0.62 0.6 0.56 1"/>
    <body name="base">
      <geom fromto="0 0 0.04 0 0 0.06" size="0.07"/>
      <body name="shoulder">
        <joint name="shoulder_pan"/>
        <geom fromto="0 0 0.1 0 0 0.1625" size="0.058"/>
        <geom fromto="0 0 0.1625 0 -0.138 0.1625" size="0.058"/>
        <body name="upper_arm" pos="0 0 0.1625" euler="90 0 0">
          <joint name="shoulder_lift"/>
          <geom fromto="0 0 0.138 -0.425 0 0.138" size="0.054"/>
          <body name="forearm" pos="-0.425 0 0">
            <joint name="elbow" range="-180 180"/>
            <geom fromto="0 0 0.138 0 0 0.007" size="0.05"/>
            <geom fromto="0 0 0.007 -0.3922 0 0.007" size="0.045"/>
            <body name="wrist_1_link" pos="-0.3922 0 0">
              <joint name="wrist_1"/>
              <geom fromto="0 0 0.007 0 0 0.1333" size="0.042"/>
              <body name="wrist_2_link" pos="0 0 0.1333" euler="90 0 0">
                <joint name="wrist_2"/>
                <geom fromto="0 0 0 0 0 0.0997" size="0.042"/>
                <body name="wrist_3_link" pos="0 0 0.0997" euler="-90 0 0">
                  <joint name="wrist_3"/>
                  <geom type="cylinder" fromto="0 0 0.03 0 0 0.0996" size="0.04"/>
                  <site name="flange" pos="0 0 0.0996"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
# Its tip, and its joint values at the start [deg]: with the camera over the table, and with the board turned to the front.
FLANGE, OVER_TABLE, TO_FRONT = "flange", [0, -80, -110, -80, 90, 0], [0, -80, -110, -10, 90, 0]
# Added to every model: a body of this name, as thick as this [m].
BOARD, BOARD_M = "handeye_board", 2e-3
# The types of joints that can be driven, by the library's numbers.
KINDS = {2: "prismatic", 3: "revolute"}
# Half a turn about x: a camera of OpenGL looks along -z, with y up.
GL_FROM_CAMERA = ((0, 0, 0), (1, 0, 0, 0))
# What is a metre in front of a camera moves by no more than this [m] for what carries the camera.
RIGID_M = 1e-6
GRAPHICS = (
    "MuJoCo cannot render on this computer ({}). Install EGL (Debian, Ubuntu: sudo apt install libegl1 libgl1-mesa-dri) or OSMesa "
    "(libosmesa6), and where the one does not work choose the other with MUJOCO_GL=egl or MUJOCO_GL=osmesa in the environment"
)


class MujocoCell:
    def __init__(self, options):
        self.mujoco = library()
        self.options = options
        self.name = f"MuJoCo cell, {os.path.basename(options.model) if options.model else 'UR5e'}"
        try:
            spec = self.mujoco.MjSpec.from_file(options.model) if options.model else self.mujoco.MjSpec.from_string(UR5E)
            self.add_board(spec)
            self.model = spec.compile()
        except Exception as error:  # the library has several, whose words name file and line
            raise Fault(f"MuJoCo {self.mujoco.__version__} does not load {options.model or 'the built-in arm'}: {error}") from None
        self.data = self.mujoco.MjData(self.model)
        if self.model.nkey:
            self.mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        self.tip = self.find("tip", options.tip or (None if options.model else FLANGE), ("site", "body"))
        self.path, self.moving = self.chain()
        # The chain begins at what its first joint is on.
        self.base = ("body", int(self.model.body_parentid[self.path[0]]))
        self.joints = [self.joint(number) for number in self.moving]
        self.fastest = [FASTEST[joint["kind"]] for joint in self.joints]
        self.start = self.at_start()
        self.arm = {"urdf": self.urdf(), "base_link": "base", "tip_link": "tip"}
        self.camera = self.own_camera()
        self.renderer = None

    def add_board(self, spec):
        """A body that is put where it is to be; its frame is the board's."""
        board = spec.worldbody.add_body(name=BOARD, mocap=True)
        spec.add_material(name=BOARD, specular=0, shininess=0, reflectance=0)  # without highlights, which would move the edges
        for (x, y), (other_x, other_y), is_dark in self.options.board.rectangles():
            board.add_geom(
                type=self.mujoco.mjtGeom.mjGEOM_BOX,
                size=[(other_x - x) / 2, (other_y - y) / 2, BOARD_M / 2],
                pos=[(other_x + x) / 2, (other_y + y) / 2, BOARD_M / 2],
                # All that a default of the model may have changed.
                quat=[1, 0, 0, 0],
                rgba=[DARK if is_dark else LIGHT] * 3 + [1],
                group=0,
                contype=0,
                conaffinity=0,
                material=BOARD,
            )

    def find(self, what, name, kinds):
        """Kind and number of what has this name."""
        for kind in kinds if name else ():
            number = self.mujoco.mj_name2id(self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name)
            if number >= 0:
                return kind, number
        counts = {"site": self.model.nsite, "body": self.model.nbody, "camera": self.model.ncam}
        there = [(kind, getattr(self.model, kind)(i).name) for kind in kinds for i in range(counts[kind])]
        there = ", ".join(f"{kind} {known}" for kind, known in there if known not in ("", "world", BOARD))
        said = f"the model has no {' or '.join(kinds)} {name!r}" if name else f"say with --{what} which part of the model it is"
        raise Fault(f"{said}: there is {there or 'none with a name'}")

    def chain(self):
        """The bodies from the first that a joint moves up to that of the tip, and the joints that move it."""
        kind, number = self.tip
        body = int(self.model.site_bodyid[number]) if kind == "site" else number
        path, joints = [], []
        while body > 0:
            first, count = int(self.model.body_jntadr[body]), int(self.model.body_jntnum[body])
            path.insert(0, body)
            joints[:0] = range(first, first + count)
            body = int(self.model.body_parentid[body])
        while path and not self.model.body_jntnum[path[0]]:
            del path[0]
        if not joints:
            raise Fault(f"no joint of the model moves {self.options.tip}")
        return path, joints

    def joint(self, number):
        """What `hello` says of a joint."""
        name, kind = self.model.joint(number).name or f"joint {number}", KINDS.get(int(self.model.jnt_type[number]))
        if kind is None:
            raise Fault(f"the joint {name} is neither a hinge nor a slide: arms on a free body, and ball joints, cannot be driven")
        if self.model.jnt_limited[number]:
            least, most = map(float, self.model.jnt_range[number])
            return {"name": name, "kind": kind, "min": least, "max": most}
        if kind == "prismatic":
            raise Fault(f"the slide {name} needs a range in the model")
        return {"name": name, "kind": kind}

    def at_start(self):
        given = self.options.start
        if given is None and not self.options.model:
            given = TO_FRONT if self.options.eye_to_hand else OVER_TABLE
        if given is not None:
            return in_radians(given, self.joints)
        return [float(self.data.qpos[self.model.jnt_qposadr[joint]]) for joint in self.moving]

    def put(self, joints):
        for joint, value in zip(self.moving, joints):
            self.data.qpos[self.model.jnt_qposadr[joint]] = value
        self.mujoco.mj_kinematics(self.model, self.data)
        self.mujoco.mj_camlight(self.model, self.data)

    def world_from(self, kind, number):
        """The pose of a body, site or camera."""
        prefix = {"body": "x", "site": "site_x", "camera": "cam_x"}[kind]
        place, matrix = getattr(self.data, f"{prefix}pos")[number], getattr(self.data, f"{prefix}mat")[number]
        w, x, y, z = quaternion_of(self.mujoco, matrix)
        return tuple(map(float, place)), (x, y, z, w)

    def base_from(self, thing):
        return compose(inverse(self.world_from(*self.base)), self.world_from(*thing))

    def base_from_tip(self, joints):
        self.put(joints)
        return self.base_from(self.tip)

    def urdf(self):
        """The chain as a URDF: joints one after the other, each turned or shifted in a frame of its own."""
        robot = ElementTree.Element("robot", name="arm", version="1.1")  # from 1.1 on there are quaternions
        ElementTree.SubElement(robot, "link", name="base")

        def add(name, kind, origin, link):
            joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
            ElementTree.SubElement(joint, "parent", link=robot.findall("link")[-1].get("name"))
            ElementTree.SubElement(joint, "child", link=link)
            ElementTree.SubElement(joint, "origin", xyz=text(origin[0]), quat_xyzw=text(origin[1]))
            ElementTree.SubElement(robot, "link", name=link)
            return joint

        model, known = self.model, dict(zip(self.moving, self.joints))
        # From the joint before to where the next one is.
        at = ((0, 0, 0), (0, 0, 0, 1))
        for body in self.path:
            w, x, y, z = map(float, model.body_quat[body])
            at = compose(at, (tuple(map(float, model.body_pos[body])), (x, y, z, w)))
            for number in range(int(model.body_jntadr[body]), int(model.body_jntadr[body] + model.body_jntnum[body])):
                said = known[number]
                anchor, axis = (tuple(map(float, of_joint[number])) for of_joint in (model.jnt_pos, model.jnt_axis))
                is_turn = said["kind"] == "revolute"
                kind = "prismatic" if not is_turn else "revolute" if "min" in said else "continuous"
                joint = add(said["name"], kind, compose(at, (anchor, (0, 0, 0, 1))), f"{said['name']} moves")
                ElementTree.SubElement(joint, "axis", xyz=text(axis))
                limits = {"lower": repr(said["min"]), "upper": repr(said["max"])} if "min" in said else {}
                ElementTree.SubElement(joint, "limit", effort="0", velocity=repr(FASTEST[said["kind"]]), **limits)
                # The joint value at which the body is as the model states it.
                back = tuple(-float(model.qpos0[model.jnt_qposadr[number]]) * x for x in axis)
                undone = ((0, 0, 0), quaternion(back)) if is_turn else (back, (0, 0, 0, 1))
                at = compose(undone, (tuple(-x for x in anchor), (0, 0, 0, 1)))
        kind, number = self.tip
        if kind == "site":
            w, x, y, z = map(float, model.site_quat[number])
            at = compose(at, (tuple(map(float, model.site_pos[number])), (x, y, z, w)))
        add("to the tip", "fixed", at, "tip")
        return ElementTree.tostring(robot, encoding="unicode")

    def own_camera(self):
        """Pose and lens of the camera that is chosen of the model; None without one."""
        if not self.options.camera:
            return None
        camera = self.find("camera", self.options.camera, ("camera",))
        carrier, places = self.base if self.options.eye_to_hand else self.tip, []
        for joints in (self.start, [value + 0.1 for value in self.start]):
            self.put(joints)
            carrier_from_camera = compose(inverse(self.base_from(carrier)), self.base_from(camera))
            places.append(compose(carrier_from_camera, GL_FROM_CAMERA))
        if math.dist(*(transformed(place, (1, 1, 1)) for place in places)) > RIGID_M:
            what = "stand still, as with --eye-to-hand it has to" if self.options.eye_to_hand else "move with the tip"
            raise Fault(f"the camera {self.options.camera} does not {what}: name another one, or none")
        (width, height), number = self.options.size, camera[1]
        fy = height / 2 / math.tan(math.radians(float(self.model.cam_fovy[number])) / 2)
        fx = fy
        if self.model.cam_sensorsize[number][0] > 0:
            # Of its intrinsics the focal lengths count. A principal point off the middle does not: versions of MuJoCo differ in
            # which way they shift it.
            fx, fy = (
                float(self.model.cam_intrinsic[number][i] / self.model.cam_sensorsize[number][i]) * pixels
                for i, pixels in enumerate((width, height))
            )
        return places[0], lens(width, height, fx, fy)

    def furnish(self, options):
        width, height = options.size
        visual = self.model.vis
        visual.global_.offwidth, visual.global_.offheight = width, height
        # A pixel is what is at its centre: the mean over it is made of shifted images, and a depth has no mean.
        visual.quality.offsamples = 0
        visual.map.znear, visual.map.zfar = NEAR_M / self.model.stat.extent, FAR_M / self.model.stat.extent
        try:
            self.renderer = self.mujoco.Renderer(self.model, height, width)
        except Exception as error:  # of the platform's libraries, each with its own
            raise Fault(GRAPHICS.format(str(error) or repr(error))) from None
        # In software a shadow takes longer than all else.
        for effect in (self.mujoco.mjtRndFlag.mjRND_SHADOW, self.mujoco.mjtRndFlag.mjRND_REFLECTION):
            self.renderer.scene.flags[effect] = 0

    def render(self, joints, base_from_camera, base_from_target, of_lens, with_depths):
        world_from_base = self.world_from(*self.base)
        place, (x, y, z, w) = compose(world_from_base, base_from_target)
        board = self.model.body(BOARD).mocapid[0]
        self.data.mocap_pos[board], self.data.mocap_quat[board] = place, (w, x, y, z)
        self.put(joints)
        self.renderer.update_scene(self.data)
        self.look_from(compose(world_from_base, base_from_camera), of_lens)
        if not with_depths:
            return self.renderer.render(), None
        self.renderer.enable_depth_rendering()
        depths = self.renderer.render().copy()
        self.renderer.disable_depth_rendering()
        return self.renderer.render(), depths

    def look_from(self, world_from_camera, of_lens):
        """Puts the camera of the scene, and the lamp on it, which is where the camera was before."""
        place, q = world_from_camera
        forward, up = turned(q, (0, 0, 1)), turned(q, (0, -1, 0))
        for camera in self.renderer.scene.camera:  # of both eyes
            camera.pos, camera.forward, camera.up = place, forward, up
            # The image on the plane at the nearest distance. Its edge is half a pixel outside the centres of the first pixels.
            near = camera.frustum_near
            left, right = (near * (u - of_lens["cx"]) / of_lens["fx"] for u in (-0.5, of_lens["width"] - 0.5))
            top, bottom = (near * (of_lens["cy"] - v) / of_lens["fy"] for v in (-0.5, of_lens["height"] - 0.5))
            camera.frustum_center, camera.frustum_width = (left + right) / 2, (right - left) / 2
            camera.frustum_top, camera.frustum_bottom = top, bottom
        for light in self.renderer.scene.lights[: self.renderer.scene.nlight]:
            if light.headlight:
                light.pos, light.dir = place, forward


def library():
    """The library, which decides as it is imported what it renders with."""
    if sys.platform.startswith("linux") and not os.environ.get("MUJOCO_GL"):
        found = [name for name, file in (("egl", "EGL"), ("osmesa", "OSMesa")) if ctypes.util.find_library(file)]
        if not found:
            raise Fault(GRAPHICS.format("neither EGL nor OSMesa is there"))
        os.environ["MUJOCO_GL"] = found[0]
    try:
        return package("mujoco", "mujoco")
    except (ImportError, AttributeError, RuntimeError, OSError) as error:
        raise Fault(GRAPHICS.format(f"with MUJOCO_GL={os.environ.get('MUJOCO_GL')}: {error}")) from None


def quaternion_of(mujoco, matrix):
    """w, x, y, z of a rotation."""
    import numpy as np

    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.asarray(matrix, dtype=np.float64).ravel())
    return tuple(map(float, found))


def text(numbers):
    return " ".join(repr(float(number)) for number in numbers)


def main():
    options = parser(__doc__)
    options.add_argument("--model", metavar="FILE", help="an arm of yours (MJCF); with --tip, and --start")
    tip = "the site or body whose pose is reported, and that carries the camera or the board"
    options.add_argument("--tip", metavar="NAME", help=tip)
    options.add_argument("--camera", metavar="NAME", help="a camera of the model; one is added if not given")
    add_options(options, samples=64)
    serve_cell(MujocoCell, options.parse_args())


if __name__ == "__main__":
    main()
