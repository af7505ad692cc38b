#!/usr/bin/env python3
"""Builds the reference scene in a running CoppeliaSim (4.6 or later) and saves it as a .ttt file.

UNTESTED against a real CoppeliaSim: written from its manual and from the geometry of published scenes, and run against
a stand-in only. If a step fails, the message says which one, and the rest can be done by hand in the editor.

    pip install coppeliasim-zmqremoteapi-client cbor2
    # start CoppeliaSim with an empty scene, then
    python3 build_reference_scene.py --scene reference.toml --save reference.ttt

The numbers come from the same scene file that the built-in cell reads, so that both simulate the same cell. What
CoppeliaSim cannot do (lens distortion, noise, errors of the robot) is refused rather than ignored. The board is made of
flat squares instead of a texture: their edges are exact, and no texture is filtered or turned upside down.

Needs Python 3.11 for tomllib.
"""

import argparse
import math
import os
import sys
import tomllib

HERE = os.path.dirname(os.path.abspath(__file__))
# Dark squares lie this far above the sheet: enough for the depth buffer, a fiftieth of a millimetre for the camera.
LIFT_M = 2e-5
WHITE = [0.95, 0.95, 0.95]
BLACK = [0.05, 0.05, 0.05]
IDENTITY = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
# Options of sim.createVisionSensor: perspective, and no drawing of the view volume.
PERSPECTIVE_HIDDEN = 2 | 4
VIEW_ANGLE_DEG = 57.0


def main():
    arguments = parse_arguments()
    scene = read_scene(arguments.scene)
    refuse_what_cannot_be_built(scene)
    sim = connect(arguments)
    if sim.getSimulationState() != sim.simulation_stopped:
        sys.exit("The simulation is running. Stop it, and try again.")
    arm = step("load the UR5", load_arm, sim, arguments.model)
    step("place the UR5", place_arm, sim, arm, scene["robot"], arguments.kinematic)
    tip = step("add the tip and its target", add_tip, sim, arm, scene["robot"])
    step("add the camera", add_camera, sim, tip, scene["camera"])
    step("add the board", add_board, sim, scene["board"])
    report(sim, arm, tip)
    if arguments.save:
        path = os.path.abspath(arguments.save)
        step("save the scene", sim.saveScene, path)
        print(f"saved {path}")


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default=os.path.join(HERE, "reference.toml"), help="scene file to build")
    parser.add_argument("--host", default="localhost")
    parser.add_argument("--port", type=int, default=23000)
    parser.add_argument("--model", help="path of UR5.ttm on the machine of the simulator, if not in its usual place")
    parser.add_argument("--kinematic", action="store_true", help="joints follow exactly, without dynamics")
    parser.add_argument("--save", help="where the simulator saves the scene")
    return parser.parse_args()


def read_scene(path):
    """A scene file says only what differs from the reference scene."""
    scene = load_toml(os.path.join(HERE, "reference.toml"))
    for section, entries in load_toml(path).items():
        if isinstance(entries, dict):
            scene[section].update(entries)
    return scene


def load_toml(path):
    with open(path, "rb") as file:
        return tomllib.load(file)


def connect(arguments):
    from coppeliasim_zmqremoteapi_client import RemoteAPIClient

    return RemoteAPIClient(host=arguments.host, port=arguments.port).require("sim")


def step(what, function, *arguments):
    try:
        return function(*arguments)
    except Exception as error:
        sys.exit(f"Could not {what}: {error}")


def refuse_what_cannot_be_built(scene):
    """A vision sensor is an exact pinhole and an arm of the simulator has no hidden errors."""
    camera, robot = scene["camera"], scene["robot"]
    problems = []
    if camera.get("distortion", {"model": "none"})["model"] != "none":
        problems.append("camera.distortion")
    if any(key in camera for key in ("fx", "fy", "cx", "cy")):
        problems.append("camera.fx … cy (give view_angle_deg)")
    for section in ("camera", "board"):
        problems += [f"{section}.{key}" for key in ("random_offset_mm", "random_offset_deg") if scene[section].get(key)]
    problems += [f"robot.{key}" for key in ("repeatability_mm", "repeatability_deg") if robot.get(key)]
    if any(robot.get("joint_offset_deg", [])):
        problems.append("robot.joint_offset_deg")
    if problems:
        sys.exit("CoppeliaSim cannot simulate " + ", ".join(problems) + ". Use reference.toml or remove them.")


def pose_of(entry):
    return [float(value) for value in entry["position_m"] + entry["rotation_xyzw"]]


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
    return [sim.getObject("/UR5/joint", {"index": index}) for index in range(6)]


def place_arm(sim, arm, robot, kinematic):
    sim.setObjectPose(arm, -1, pose_of(robot["arm"]))
    lows, highs = robot["min_joints_deg"], robot["max_joints_deg"]
    for joint, start, low, high in zip(joints_of(sim), robot["start_joints_deg"], lows, highs):
        sim.setJointInterval(joint, False, [math.radians(low), math.radians(high - low)])
        if kinematic:
            sim.setJointMode(joint, sim.jointmode_kinematic, 0)
        else:
            sim.setJointTargetPosition(joint, math.radians(start))
        sim.setJointPosition(joint, math.radians(start))


def add_tip(sim, arm, robot):
    tip = sim.createDummy(0.01)
    sim.setObjectAlias(tip, "Tip")
    connection = sim.getObject("/UR5/connection")
    sim.setObjectParent(tip, connection, False)
    sim.setObjectPose(tip, connection, pose_of(robot["tip"]))
    target = sim.createDummy(0.01)
    sim.setObjectAlias(target, "Target")
    sim.setObjectParent(target, arm, False)
    sim.setObjectPose(target, tip, IDENTITY)
    return tip


def add_camera(sim, tip, camera):
    """Two sensors in one place: `3D_camera` for colour, its child `depth` for depth."""
    colour = add_sensor(sim, "3D_camera", camera)
    sim.setObjectParent(colour, tip, False)
    sim.setObjectPose(colour, tip, pose_of(camera["sensor"]))
    sim.setObjectInt32Param(colour, sim.visionintparam_depthignored, 1)
    depth = add_sensor(sim, "depth", camera)
    sim.setObjectParent(depth, colour, False)
    sim.setObjectPose(depth, colour, IDENTITY)
    sim.setObjectInt32Param(depth, sim.visionintparam_rgbignored, 1)


def add_sensor(sim, alias, camera):
    angle = math.radians(camera.get("view_angle_deg", VIEW_ANGLE_DEG))
    size_m = 0.02
    floats = [camera["near_m"], camera["far_m"], angle, size_m] + 7 * [0.0]
    sensor = sim.createVisionSensor(PERSPECTIVE_HIDDEN, [camera["width"], camera["height"], 0, 0], floats)
    sim.setObjectAlias(sensor, alias)
    return sensor


def add_board(sim, board):
    """The sheet with the dark squares as its children.

    In the sheet's frame x runs along the columns and y against the rows. The square between the first four inner
    corners is dark, which is the one in the second row and second column of squares.
    """
    width, height = board["paper_m"]
    sheet = add_rectangle(sim, width, height, WHITE)
    sim.setObjectAlias(sheet, "Plane")
    sim.setObjectPose(sheet, -1, pose_of(board["plane"]))
    columns, rows, square_m = board["columns"] + 1, board["rows"] + 1, board["square_m"]
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
