#!/usr/bin/env python3
"""Builds the reference scene in a running CoppeliaSim (4.7 or later) and saves it as a .ttt file.

    pip install coppeliasim-zmqremoteapi-client cbor2
    # start CoppeliaSim with an empty scene, then
    python3 build_reference_scene.py --scene reference.toml --save reference.ttt

It builds in CoppeliaSim 4.10.0, where it was run. The test `scene_script` of the repository runs it with the vendor's
client against a stand-in: the built-in cell, with what the cell does not serve answered from a record. If a step fails, the
message says which one, and the rest can be done by hand in the editor.

The numbers come from the same scene file that the built-in cell reads, so that both simulate the same cell. What
cannot be built there (lens distortion, noise, errors of the robot) is refused rather than ignored, and so is a field that
is not known here; what CoppeliaSim has of its own (lights, clock, how it samples) is left to it, which one line says. The
board is made of flat squares instead of a texture: their edges are exact, and no texture is filtered or turned upside down.

Needs Python 3.11 for tomllib.
"""

import argparse
import math
import os
import sys
import tomllib

HERE = os.path.dirname(os.path.abspath(__file__))
REFERENCE = os.path.join(HERE, "reference.toml")
# Dark squares lie this far above the sheet: enough for the depth buffer, a fiftieth of a millimetre for the camera.
LIFT_M = 2e-5
WHITE = [0.95, 0.95, 0.95]
BLACK = [0.05, 0.05, 0.05]
IDENTITY = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
# Options of sim.createVisionSensor: perspective, and no drawing of the view volume.
PERSPECTIVE_HIDDEN = 2 | 4
VIEW_ANGLE_DEG = 57.0
JOINTS = 6

# Every field of a scene file is in one of these three.
BUILT = {
    "robot.arm",
    "robot.tip",
    "robot.start_joints_deg",
    "robot.min_joints_deg",
    "robot.max_joints_deg",
    "camera.width",
    "camera.height",
    "camera.view_angle_deg",
    "camera.near_m",
    "camera.far_m",
    "camera.sensor",
    "board.columns",
    "board.rows",
    "board.square_m",
    "board.paper_m",
    "board.plane",
}
# What is built is as if the field were this, and a scene that says anything else is refused: a vision sensor is an exact
# pinhole, an arm of the simulator has no hidden errors, squares are exact shapes. None: absent.
ONLY = {
    "robot.model": "ur5_coppeliasim",
    "robot.name": "UR5",
    "robot.repeatability_mm": 0.0,
    "robot.repeatability_deg": 0.0,
    "robot.joint_offset_deg": JOINTS * [0.0],
    "robot.arm_errors": {"angle_deg": 0.0, "length_mm": 0.0, "compliance_deg": 0.0},
    "camera.fx": None,
    "camera.fy": None,
    "camera.cx": None,
    "camera.cy": None,
    "camera.distortion": {"model": "none"},
    "camera.random_offset_mm": 0.0,
    "camera.random_offset_deg": 0.0,
    "board.random_offset_mm": 0.0,
    "board.random_offset_deg": 0.0,
    "board.motion.path": "still",
    "board.slip": None,
    "board.print": None,
    "image.noise_grey": 0.0,
    "image.blur_px": 0.0,
    "image.exposure": 1.0,
    "depth.noise_mm_per_m2": 0.0,
}
# Not built on purpose, because something else decides it; one that differs from the reference scene is named.
LEFT = {
    "seed": "nothing that is built is random",
    "simulation.time_step_s": "CoppeliaSim's simulation settings decide",
    "simulation.real_time": "CoppeliaSim's toolbar decides",
    "simulation.speed_factor": "CoppeliaSim's toolbar decides",
    "robot.joint_mode": "dynamic unless --kinematic is given",
    "robot.rest_error_deg": "CoppeliaSim's dynamics has its own",
    "board.motion.speed_m_s": "the board stands still",
    "board.motion.size_m": "the board stands still",
    "board.motion.tilt_deg": "the board stands still",
    "image.sampling": "CoppeliaSim samples at the centres of pixels",
    "depth.noise_mm": "CoppeliaSim's depth buffer rounds by its own",
    "depth.offset_px": "CoppeliaSim's renderer has its own",
    "depth.nothing_m": "CoppeliaSim has its own",
    "light.direction": "CoppeliaSim's scene has its own lights",
    "light.ambient": "CoppeliaSim's scene has its own lights",
    "light.diffuse": "CoppeliaSim's scene has its own lights",
    "light.background": "CoppeliaSim's scene has its own background",
}


def main():
    arguments = parse_arguments()
    scene = read_scene(arguments.scene)
    sim = connect(arguments)
    if sim.getSimulationState() != sim.simulation_stopped:
        sys.exit("The simulation is running. Stop it, and try again.")
    arm = step("load the UR5", load_arm, sim, arguments.model)
    step("place the UR5", place_arm, sim, arm, scene, arguments.kinematic)
    tip = step("add the tip and its target", add_tip, sim, arm, scene)
    step("add the camera", add_camera, sim, tip, scene)
    step("add the board", add_board, sim, scene)
    report(sim, arm, tip)
    if arguments.save:
        path = os.path.abspath(arguments.save)
        step("save the scene", sim.saveScene, path)
        print(f"saved {path}")


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default=REFERENCE, help="scene file to build")
    parser.add_argument("--host", default="localhost")
    parser.add_argument("--port", type=int, default=23000)
    parser.add_argument("--model", help="path of UR5.ttm on the machine of the simulator, if not in its usual place")
    parser.add_argument(
        "--kinematic",
        action="store_true",
        help="joints follow exactly, without dynamics; without it they are dynamic, whatever joint_mode the scene has",
    )
    parser.add_argument("--save", help="where the simulator saves the scene")
    return parser.parse_args()


def read_scene(path):
    """Fields by their dotted names. A scene file says only what differs from the reference scene."""
    reference = step(f"read {REFERENCE}", read_fields, REFERENCE)
    given = step(f"read {path}", read_fields, path)
    # What stands around: CoppeliaSim's empty scene has a floor, and no boxes are built.
    only = ONLY | {"solids": reference["solids"]}
    unknown = [name for name in given if name not in BUILT | LEFT.keys() | only.keys()]
    if unknown:
        sys.exit(
            f"{path}: this script does not know {', '.join(unknown)}. reference.toml lists all fields; "
            "one that is new there has to be added to this script."
        )
    refused = [name for name in given if name in only and given[name] != only[name]]
    if refused:
        sys.exit(
            f"{path}: {', '.join(refused)} cannot be built in CoppeliaSim as it stands there. "
            "Leave it out, or use reference.toml."
        )
    scene = reference | given
    for name in ("start_joints_deg", "min_joints_deg", "max_joints_deg"):
        values = scene.get(f"robot.{name}")
        if values is not None and len(values) != JOINTS:
            sys.exit(f"{path}: robot.{name} has {len(values)} values. Give {JOINTS}, one for each joint.")
    left = [f"{name} ({LEFT[name]})" for name in given if name in LEFT and given[name] != reference.get(name)]
    if left:
        print("not taken from the scene file:", ", ".join(left))
    return scene


def read_fields(path):
    with open(path, "rb") as file:
        return flat(tomllib.load(file))


def flat(table, prefix=""):
    """Sections become parts of the names; poses and other small tables stay values."""
    fields = {}
    for key, value in table.items():
        name = prefix + key
        if isinstance(value, dict) and (not prefix or name == "board.motion"):
            fields |= flat(value, name + ".")
        else:
            fields[name] = value
    return fields


def connect(arguments):
    from coppeliasim_zmqremoteapi_client import RemoteAPIClient

    return RemoteAPIClient(host=arguments.host, port=arguments.port).require("sim")


def step(what, function, *arguments):
    try:
        return function(*arguments)
    except Exception as error:
        sys.exit(f"Could not {what}: {error}")


def pose_of(entry):
    position = entry.get("position_m", IDENTITY[:3])
    rotation = entry.get("rotation_xyzw", IDENTITY[3:])
    return [float(value) for value in position + rotation]


def load_arm(sim, model):
    if model is None:
        parameter = getattr(sim, "stringparam_resourcesdir", sim.stringparam_application_path)
        model = sim.getStringParam(parameter) + "/models/robots/non-mobile/UR5.ttm"
    arm = sim.loadModel(model)
    sim.setObjectAlias(arm, "UR5")
    remove_scripts(sim, arm)
    return arm


def remove_scripts(sim, arm):
    """A script that came with the model would move the arm when the simulation starts."""
    scripts = []
    if hasattr(sim, "sceneobject_script"):
        scripts = sim.getObjectsInTree(arm, sim.sceneobject_script, 0)
    if scripts:
        sim.removeObjects(scripts)
        return
    try:
        script = sim.getScript(sim.scripttype_childscript, arm)
        if script != -1:
            sim.removeScript(script)
    except Exception as error:
        print(f"warning: look whether a script is attached to the UR5, and delete it ({error})", file=sys.stderr)


def joints_of(sim):
    return [sim.getObject("/UR5/joint", {"index": index}) for index in range(JOINTS)]


def place_arm(sim, arm, scene, kinematic):
    sim.setObjectPose(arm, -1, pose_of(scene["robot.arm"]))
    lows = scene.get("robot.min_joints_deg", JOINTS * [None])
    highs = scene.get("robot.max_joints_deg", JOINTS * [None])
    for joint, start, low, high in zip(joints_of(sim), scene["robot.start_joints_deg"], lows, highs):
        limit_joint(sim, joint, low, high)
        if kinematic:
            sim.setJointMode(joint, sim.jointmode_kinematic, 0)
        else:
            sim.setJointTargetPosition(joint, math.radians(start))
        sim.setJointPosition(joint, math.radians(start))


def limit_joint(sim, joint, low_deg, high_deg):
    """An end of the range that the scene does not have stays as the model in CoppeliaSim has it."""
    if low_deg is None and high_deg is None:
        return
    _cyclic, (low, extent) = sim.getJointInterval(joint)
    high = low + extent
    if low_deg is not None:
        low = math.radians(low_deg)
    if high_deg is not None:
        high = math.radians(high_deg)
    sim.setJointInterval(joint, False, [low, high - low])


def add_tip(sim, arm, scene):
    tip = sim.createDummy(0.01)
    sim.setObjectAlias(tip, "Tip")
    connection = sim.getObject("/UR5/connection")
    sim.setObjectParent(tip, connection, False)
    sim.setObjectPose(tip, connection, pose_of(scene["robot.tip"]))
    target = sim.createDummy(0.01)
    sim.setObjectAlias(target, "Target")
    sim.setObjectParent(target, arm, False)
    sim.setObjectPose(target, tip, IDENTITY)
    return tip


def add_camera(sim, tip, scene):
    """Two sensors in one place: `3D_camera` for colour, its child `depth` for depth."""
    colour = add_sensor(sim, "3D_camera", scene)
    sim.setObjectParent(colour, tip, False)
    sim.setObjectPose(colour, tip, pose_of(scene["camera.sensor"]))
    sim.setObjectInt32Param(colour, sim.visionintparam_depthignored, 1)
    depth = add_sensor(sim, "depth", scene)
    sim.setObjectParent(depth, colour, False)
    sim.setObjectPose(depth, colour, IDENTITY)
    sim.setObjectInt32Param(depth, sim.visionintparam_rgbignored, 1)


def add_sensor(sim, alias, scene):
    angle = math.radians(scene.get("camera.view_angle_deg", VIEW_ANGLE_DEG))
    size_m = 0.02
    floats = [scene["camera.near_m"], scene["camera.far_m"], angle, size_m] + 7 * [0.0]
    resolution = [scene["camera.width"], scene["camera.height"], 0, 0]
    sensor = sim.createVisionSensor(PERSPECTIVE_HIDDEN, resolution, floats)
    sim.setObjectAlias(sensor, alias)
    return sensor


def add_board(sim, scene):
    """The sheet with the dark squares as its children.

    In the sheet's frame x runs along the columns and y against the rows. The square between the first four inner
    corners is dark, which is the one in the second row and second column of squares.
    """
    width, height = scene["board.paper_m"]
    sheet = add_rectangle(sim, width, height, WHITE)
    sim.setObjectAlias(sheet, "Plane")
    sim.setObjectPose(sheet, -1, pose_of(scene["board.plane"]))
    columns, rows, square_m = scene["board.columns"] + 1, scene["board.rows"] + 1, scene["board.square_m"]
    for row in range(rows):
        for column in range(columns):
            if (row + column) % 2 == 0:
                square = add_rectangle(sim, square_m, square_m, BLACK)
                x = (column - (columns - 1) / 2) * square_m
                y = ((rows - 1) / 2 - row) * square_m
                sim.setObjectParent(square, sheet, False)
                sim.setObjectPose(square, sheet, [x, y, LIFT_M, 0.0, 0.0, 0.0, 1.0])


def add_rectangle(sim, width_m, height_m, colour):
    shape = sim.createPrimitiveShape(sim.primitiveshape_plane, [width_m, height_m, 0.0], 0)
    sim.setObjectInt32Param(shape, sim.shapeintparam_static, 1)
    sim.setObjectInt32Param(shape, sim.shapeintparam_respondable, 0)
    sim.setShapeColor(shape, "", sim.colorcomponent_ambient_diffuse, colour)
    return shape


def report(sim, arm, tip):
    camera = sim.getObject("/UR5/3D_camera")
    print("tip in the world:       ", rounded(sim.getObjectPose(tip, -1)))
    print("camera sensor in the tip:", rounded(sim.getObjectPose(camera, tip)))
    print("board in the world:     ", rounded(sim.getObjectPose(sim.getObject("/Plane"), -1)))
    connection = sim.getObject("/UR5/connection")
    print("connection in the arm:  ", rounded(sim.getObjectPose(connection, arm)))


def rounded(pose):
    return [round(value, 5) for value in pose]


if __name__ == "__main__":
    main()
