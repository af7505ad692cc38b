"""Drives the built-in cell with the official, unmodified Python client.

    pip install coppeliasim-zmqremoteapi-client==2.0.4 numpy     (and cbor2, or not: both ways must work)
    python official_client.py PORT [NAME...]

Every function whose name starts with `test_` is one scenario; it gets a fresh client and its `sim`, finds the
simulation stopped and may leave it running. Prints `N passed`, or the first failure and exits with 1.
"""

import asyncio
import math
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np

if os.environ.get('HANDEYE_CBOR') == 'cbor':
    sys.modules['cbor2'] = None  # the client then takes the only library that it depends on
from coppeliasim_zmqremoteapi_client import RemoteAPIClient
from coppeliasim_zmqremoteapi_client.asyncio import RemoteAPIClient as AsyncClient
from coppeliasim_zmqremoteapi_client import cbor

PORT = int(sys.argv[1])
START = [math.radians(a) for a in (0, 45, -60, 0, 90, 0)]
SPEED = dict(maxVel=[math.radians(310)] * 6, maxAccel=[math.radians(100)] * 6, maxJerk=[math.radians(80)] * 6)
BRISK = dict(maxVel=[2.0] * 6, maxAccel=[8.0] * 6, maxJerk=[80.0] * 6)


def connect():
    client = RemoteAPIClient(port=PORT)
    return client, client.require('sim')


def joints_of(sim):
    return [sim.getObject('/UR5/joint', {'index': i}) for i in range(6)]


def matrix(pose):
    """4 x 4 from [x y z qx qy qz qw]."""
    x, y, z, w = pose[3:]
    m = np.eye(4)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, 3] = pose[:3]
    return m


def near(a, b, tolerance=1e-9):
    assert len(a) == len(b) and all(abs(p - q) <= tolerance for p, q in zip(a, b)), f'{a} is not {b}'


def fails(text, call, *args):
    try:
        call(*args)
    except Exception as error:
        assert text in str(error), f'{error!s} does not say {text!r}'
        return
    raise AssertionError(f'no error, wanted {text!r}')


def image(sim, handle):
    """The image as people look at it: top row first."""
    pixels, (width, height) = sim.getVisionSensorImg(handle)
    assert isinstance(pixels, bytes) and len(pixels) == width * height * 3
    return np.frombuffer(pixels, np.uint8).reshape(height, width, 3)[::-1].astype(float)


def metres(sim, handle):
    depths, (width, height) = sim.getVisionSensorDepth(handle, 1)
    assert isinstance(depths, bytes) and len(depths) == width * height * 4
    return np.frombuffer(depths, '<f4').reshape(height, width)[::-1].astype(float)


def corners_in_camera(sim, truth, moment=None):
    """The board's inner corners in the camera's OpenCV axes, by the truth, now or at the moment of the images."""
    moment = moment or {'tip': sim.getObjectPose(sim.getObject('/UR5/Tip')), **truth}
    world_from_camera = matrix(moment['tip']) @ matrix(truth['tip_from_camera'])
    camera_from_target = np.linalg.inv(world_from_camera) @ matrix(moment['base_from_target'])
    target = truth['target']
    grid = [[c * target['square_m'], r * target['square_m'], 0, 1]
            for r in range(target['rows']) for c in range(target['columns'])]
    return (camera_from_target @ np.array(grid).T).T[:, :3]


def project(points, lens):
    """Pixels of points; the scenes of this suite have no distortion."""
    assert lens['model'] == 'none', 'run this suite on a scene without distortion'
    return np.stack([lens['fx'] * points[:, 0] / points[:, 2] + lens['cx'],
                     lens['fy'] * points[:, 1] / points[:, 2] + lens['cy']], axis=1)


def refine(grey, pixel, half=6):
    """The saddle point near a pixel: where all gradients around are perpendicular to the way to it."""
    gy, gx = np.gradient(grey)
    at = np.array(pixel)
    for _ in range(20):
        column, row = np.round(at).astype(int)
        ys, xs = np.mgrid[row - half:row + half + 1, column - half:column + half + 1]
        g = np.stack([gx[ys, xs].ravel(), gy[ys, xs].ravel()])
        p = np.stack([xs.ravel(), ys.ravel()])
        weight = np.exp(-((p - at[:, None]) ** 2).sum(axis=0) / (half * half / 2))
        a = (g * weight) @ g.T
        b = (g * weight) @ (g * p).sum(axis=0)
        at = np.linalg.solve(a, b)
    return at


def test_first_contact(client, sim):
    dummies = [sim.createDummy(0.01, 12 * [0]) for _ in range(50)]
    for i, dummy in enumerate(dummies):
        sim.setObjectPosition(dummy, -1, [0.01 * i] * 3)
    near(sim.getObjectPosition(dummies[49], -1), [0.49] * 3)
    sim.startSimulation()
    before = time.time()
    while (t := sim.getSimulationTime()) < 0.4:
        sim.addLog(sim.verbosity_scriptinfos, f'simulation time: {t:.2f} [s]')
    assert 0.3 < time.time() - before < 2, 'simulated time runs like real time'
    sim.stopSimulation()
    sim.removeObjects(dummies)
    assert not sim.isHandle(dummies[0])


def test_paths(client, sim):
    joints = joints_of(sim)
    assert len(set(joints)) == 6
    assert sim.getObject('/UR5/joint') == joints[0]
    assert sim.getObject('/UR5/joint/link/joint') == joints[1]
    assert sim.getObject('./joint', {'proxy': sim.getObject('/UR5')}) == joints[0]
    assert sim.getObject('/nope', {'noError': True}) == -1
    assert sim.getObjectAlias(joints[3]) == 'joint'
    assert sim.getObject(sim.getObjectAlias(joints[3], 7)) == joints[3]
    assert sim.getObjectParent(sim.getObject('/UR5/3D_camera/depth')) == sim.getObject('/UR5/3D_camera')
    assert sim.getObjectsInTree(sim.getObject('/UR5'), sim.object_joint_type) == joints
    assert sim.getObjectType(joints[0]) == sim.sceneobject_joint
    cyclic, (low, extent) = sim.getJointInterval(joints[0])
    assert cyclic is False
    near([low, extent], [-2 * math.pi, 4 * math.pi])
    for path in ('/UR5/Tip', '/UR5/Target', '/Plane', '/UR5/connection', '/Floor'):
        sim.getObject(path)


def test_errors(client, sim):
    fails('in sim._getObject: object does not exist, or alias/path is ill formatted.', sim.getObject, '/nope')
    fails('in sim.getObjectPose: object does not exist.', sim.getObjectPose, 99999)
    fails('object is not a joint.', sim.getJointPosition, sim.getObject('/UR5'))
    fails('the function requires more arguments.', sim.getObjectPose)
    fails('object not tagged for explicit handling.', sim.handleVisionSensor, sim.getObject('/UR5/3D_camera'))
    fails('No such function: sim.foo', client.call, 'sim.foo', [])
    fails("missing or invalid 'targetPos' field.", sim.moveToConfig, {})
    fails('invalid data.', sim.setObjectPosition, sim.getObject('/Plane'), [math.nan, 0, 0])
    assert not hasattr(sim, 'foo')


def test_poses(client, sim):
    dummy, arm = sim.createDummy(0.01), sim.getObject('/UR5')
    pose = [0.1, -0.2, 0.3, 0.5, 0.5, 0.5, 0.5]
    sim.setObjectPose(dummy, pose, arm)
    near(sim.getObjectPose(dummy, arm), pose)
    sim.setObjectPose(dummy, -1, pose)
    near(sim.getObjectPose(dummy), pose)
    near(sim.poseToMatrix(sim.getObjectPose(dummy)), sim.getObjectMatrix(dummy))
    near(sim.matrixToPose(sim.getObjectMatrix(dummy)), pose)
    near(np.array(sim.getObjectMatrix(dummy)), matrix(pose)[:3].ravel())
    wxyz = sim.getObjectPose(dummy + sim.handleflag_wxyzquat)
    near(wxyz[3:], [0.5] * 4)
    sim.setObjectOrientation(dummy, [0.1, 0.2, 0.3])
    near(sim.getEulerAnglesFromMatrix(sim.getObjectMatrix(dummy)), [0.1, 0.2, 0.3])
    near(sim.multiplyPoses(sim.getObjectPose(dummy), sim.getObjectPose(dummy, sim.handle_inverse)),
         [0, 0, 0, 0, 0, 0, 1])
    m = sim.getObjectMatrix(dummy)
    near(sim.multiplyMatrices(m, sim.getMatrixInverse(m)), [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0])
    if cbor.__package__ == 'cbor2':
        sim.setObjectMatrix(dummy, np.eye(4)[:3].ravel())
        near(sim.getObjectPose(dummy), [0, 0, 0, 0, 0, 0, 1])
    sim.removeObjects([dummy])


def test_image_is_the_projection_of_the_board(client, sim):
    camera = sim.getObject('/UR5/3D_camera')
    joints = joints_of(sim)
    truth = client.require('handeye').truth()
    sim.setStepping(True)
    sim.startSimulation()
    for q in (START, START[:4] + [1.45, 0.25], [0.05, 0.7, -0.95, 0.05, 1.5, -0.4]):
        for joint, angle in zip(joints, q):
            sim.setJointPosition(joint, angle)
        sim.step()
        grey = image(sim, camera).mean(axis=2)
        pixels = project(corners_in_camera(sim, truth), truth['intrinsics'])
        height, width = grey.shape
        inside = [p for p in pixels if 10 < p[0] < width - 10 and 10 < p[1] < height - 10]
        assert len(inside) > 30, 'the board is in view'
        errors = np.array([refine(grey, p) - p for p in inside])
        # Differences of neighbouring pixels are no exact gradients of such sharp edges: that scatters single corners by
        # some 0.03 px and cancels in the mean, which tells whether truth and image agree.
        assert np.abs(errors).max() < 0.1, f'corners are off by up to {np.abs(errors).max():.3f} px'
        assert np.abs(errors.mean(axis=0)).max() < 0.01, f'all corners are off by {errors.mean(axis=0)} px'
        columns = truth['target']['columns']
        square = pixels[[0, 1, columns, columns + 1]].mean(axis=0).round().astype(int)
        white = pixels[[1, 2, columns + 1, columns + 2]].mean(axis=0).round().astype(int)
        assert grey[square[1], square[0]] < 60 < 120 < grey[white[1], white[0]], 'the first square is dark'


def test_a_moving_board_is_where_the_moment_has_it(client, sim):
    camera, joints = sim.getObject('/UR5/3D_camera'), joints_of(sim)
    handeye = client.require('handeye')
    truth = handeye.truth()
    assert handeye.moment() == {}, 'there is no image yet'
    sim.setStepping(True)
    sim.startSimulation()
    handeye.moveBoard({'path': 'random_walk', 'speed_m_s': 0.1, 'seed': 3})
    for number in range(30):
        for joint, angle in zip(joints, START):
            sim.setJointPosition(joint, angle + 0.03 * math.sin(0.4 * number))
        sim.step()
        # Put, but not in the images yet.
        sim.setJointPosition(joints[0], START[0])
        if number % 6 == 5:
            moment = handeye.moment()
            near([moment['sim_time'], moment['joints'][0]],
                 [sim.getSimulationTime(), START[0] + 0.03 * math.sin(0.4 * number)])
            grey = image(sim, camera).mean(axis=2)
            pixels = project(corners_in_camera(sim, truth, moment), truth['intrinsics'])
            errors = np.array([refine(grey, p) - p for p in pixels])
            assert np.abs(errors).max() < 0.1, f'corners are off by up to {np.abs(errors).max():.3f} px'
    handeye.showBoard(False)
    sim.step()
    x, y = pixels.mean(axis=0).round().astype(int)
    assert np.ptp(image(sim, camera)[y - 20:y + 20, x - 20:x + 20]) < 60, 'no print is seen'
    fails("missing 'path' field", handeye.moveBoard, {})
    fails('there is no path "spiral"', handeye.moveBoard, {'path': 'spiral'})
    fails('speed_m_s is 5, it must be', handeye.moveBoard, {'path': 'circle', 'speed_m_s': 5})
    sim.stopSimulation(True)
    near(handeye.truth()['base_from_target'], truth['base_from_target'])


def test_depth_is_the_distance_along_the_axis(client, sim):
    depth = sim.getObject('/UR5/3D_camera/depth')
    truth = client.require('handeye').truth()
    sim.setStepping(True)
    sim.startSimulation()
    sim.step()
    z = metres(sim, depth)
    points = corners_in_camera(sim, truth)
    for pixel, point in zip(project(points, truth['intrinsics']), points):
        column, row = np.round(pixel).astype(int)
        assert abs(z[row, column] - point[2]) < 1e-3, f'{z[row, column]} m instead of {point[2]} m'
    raw, _ = sim.getVisionSensorDepth(depth)
    near_m, far_m = (sim.getObjectFloatParam(depth, p) for p in
                     (sim.visionfloatparam_near_clipping, sim.visionfloatparam_far_clipping))
    scaled = near_m + (far_m - near_m) * np.frombuffer(raw, '<f4').reshape(z.shape)[::-1]
    assert np.abs(scaled - z).max() < 1e-5
    # A sensor that ignores depth sees nothing but the far plane.
    assert (metres(sim, sim.getObject('/UR5/3D_camera')) == np.float32(far_m)).all()


def test_parts_and_forms_of_images(client, sim):
    camera = sim.getObject('/UR5/3D_camera')
    sim.setStepping(True)
    sim.startSimulation()
    sim.step()
    full, size = sim.getVisionSensorImg(camera)
    assert size == [640, 480] == sim.getVisionSensorRes(camera)
    rows = np.frombuffer(full, np.uint8).reshape(480, 640, 3)
    part, size = sim.getVisionSensorImg(camera, 0, 0.0, [300, 200], [50, 40])
    assert size == [640, 480], 'the resolution is that of the sensor, also for a part'
    assert part == rows[200:240, 300:350].tobytes()
    grey, _ = sim.getVisionSensorImg(camera, 1)
    assert (np.frombuffer(grey, np.uint8).reshape(480, 640) == rows.astype(int).sum(axis=2) // 3).all()
    alpha, _ = sim.getVisionSensorImg(camera, 2, 0.5)
    assert len(alpha) == 640 * 480 * 4
    fails('invalid arguments.', sim.getVisionSensorImg, camera, 0, 0.0, [600, 0], [50, 40])
    angle = sim.getObjectFloatParam(camera, sim.visionfloatparam_perspective_angle)
    near([320 / math.tan(angle / 2)], [client.require('handeye').truth()['intrinsics']['fx']], 1e-6)


def test_buffers_follow_passes_and_not_calls(client, sim):
    camera, joint = sim.getObject('/UR5/3D_camera'), sim.getObject('/UR5/joint')
    sim.setStepping(True)
    sim.startSimulation()
    background = image(sim, camera)
    assert (background == background[0, 0]).all(), 'before the first pass there is nothing to see'
    sim.step()
    first = image(sim, camera)
    assert not (first == background).all()
    sim.setJointPosition(joint, 0.1)
    assert (image(sim, camera) == first).all()
    sim.step()
    assert not (image(sim, camera) == first).all()
    sim.stopSimulation(True)
    assert (image(sim, camera) == background).all()
    near([sim.getJointPosition(joint)], [0])


def test_move_to_config(client, sim):
    joints = joints_of(sim)
    goal = [START[0] + 0.3, START[1] - 0.2, START[2] + 0.2, 0.1, START[4], -0.4]
    sim.startSimulation()
    before = sim.getSimulationTime()
    state = sim.moveToConfig({'joints': joints, 'targetPos': goal, **SPEED})
    assert sim.getSimulationTime() > before + 0.5
    near(state['pos'], goal)
    near([sim.getJointPosition(j) for j in joints], goal)
    assert state['joints'] == joints and 'callback' not in state


def test_move_to_config_with_callback(client, sim):
    joints = joints_of(sim)
    seen = []

    def callback(state):
        # Calls from inside a callback are allowed; time stands still meanwhile.
        seen.append((sim.getSimulationTime(), state['pos'][0]))
        sim.setJointPosition(joints[0], state['pos'][0])

    sim.startSimulation()
    state = sim.moveToConfig({'joints': joints[:1], 'targetPos': [0.3], 'callback': callback,
                              'maxVel': [2], 'maxAccel': [8], 'maxJerk': [80]})
    near(state['pos'], [0.3])
    near([sim.getJointPosition(joints[0])], [0.3])
    times = [t for t, _ in seen]
    assert len(seen) > 5
    near(np.diff(times), [0.05] * (len(times) - 1), 1e-6)
    state = sim.moveToConfig({'joints': joints[:1], 'targetPos': [1.0], 'callback': lambda state: True,
                              'maxVel': [2], 'maxAccel': [8], 'maxJerk': [80]})
    assert state['pos'][0] < 0.5, 'a callback that returns something true ends the motion'


def test_move_to_config_by_position(client, sim):
    calls = []
    sim.startSimulation()
    pos, vel, accel, left = sim.moveToConfig(-1, [0.0], None, None, [2.0], [8.0], [80.0], [0.2], None,
                                             lambda *args: calls.append(args), 'aux')
    near(pos, [0.2])
    assert calls and all(len(args) == 4 and args[3] == 'aux' for args in calls)


def test_move_to_pose(client, sim):
    tip, target = sim.getObject('/UR5/Tip'), sim.getObject('/UR5/Target')
    sim.startSimulation()
    goal = sim.getObjectPose(tip)
    goal[0] += 0.04
    goal[2] -= 0.05
    state = sim.moveToPose({'ik': {'tip': tip, 'target': target}, 'targetPose': goal,
                            'maxVel': [1.0] * 4, 'maxAccel': [2.0] * 4, 'maxJerk': [20.0] * 4})
    near(sim.getObjectPose(tip), goal, 1e-5)
    near(sim.getObjectPose(target), goal)
    near(state['pose'], goal)
    start = goal[:]
    goal[1] += 0.03
    seen = []
    sim.moveToPose({'pose': start, 'targetPose': goal, 'metric': [1, 1, 1, 0.1],
                    'callback': lambda state: seen.append(state['pose'][1]),
                    'maxVel': [1.0], 'maxAccel': [2.0], 'maxJerk': [20.0]})
    assert seen == sorted(seen) and abs(seen[-1] - goal[1]) < 1e-9


def test_move_to_pose_in_steps(client, sim):
    tip, target = sim.getObject('/UR5/Tip'), sim.getObject('/UR5/Target')
    sim.setStepping(True)
    sim.startSimulation()
    goal = sim.getObjectPose(tip)
    goal[2] += 0.03
    state = sim.moveToPose_init({'ik': {'tip': tip, 'target': target}, 'targetPose': goal,
                                 'maxVel': [1.0] * 4, 'maxAccel': [2.0] * 4, 'maxJerk': [20.0] * 4})
    steps = 0
    while True:
        result, state = sim.moveToPose_step(state)
        sim.step()
        steps += 1
        if result:
            break
    sim.moveToPose_cleanup(state)
    assert result == 1 and steps > 3
    near(sim.getObjectPose(tip), goal, 1e-5)


def test_stepping(client, sim):
    assert client.setStepping(True) == 0
    sim.startSimulation()
    assert sim.getSimulationState() == sim.simulation_advancing_firstafterstop
    for step in range(1, 11):
        client.step()
        near([sim.getSimulationTime()], [0.05 * step])
    frozen = sim.getSimulationTime()
    time.sleep(0.2)
    near([sim.getSimulationTime()], [frozen])
    near([sim.wait(0.2)], [0], 1e-6)
    near([sim.getSimulationTime()], [frozen + 0.2], 1e-6)
    assert sim.setStepping(False) == 1


def test_states(client, sim):
    assert sim.getSimulationState() == sim.simulation_stopped
    sim.startSimulation()
    sim.wait(0.1)
    assert sim.getSimulationState() == sim.simulation_advancing_running
    sim.pauseSimulation()
    while sim.getSimulationState() != sim.simulation_paused:
        time.sleep(0.01)
    paused = sim.getSimulationTime()
    time.sleep(0.15)
    assert sim.getSimulationTime() == paused
    sim.startSimulation()
    sim.wait(0.1)
    assert sim.getSimulationTime() > paused
    sim.stopSimulation(True)
    assert sim.getSimulationState() == sim.simulation_stopped


def test_images_while_another_client_moves(client, sim):
    joints, camera = joints_of(sim), sim.getObject('/UR5/3D_camera')
    sim.startSimulation()
    problems, images = [], []

    def move():
        try:
            _, other = connect()
            for angle in (0.2, 0.0):
                other.moveToConfig({'joints': joints, 'targetPos': [angle] + START[1:], **BRISK})
        except Exception as error:
            problems.append(error)

    thread = threading.Thread(target=move)
    thread.start()
    while thread.is_alive():
        images.append(sim.getVisionSensorImg(camera)[0])
    thread.join()
    assert not problems, problems
    assert len(set(images)) > 5, f'{len(set(images))} different images in {len(images)}'


def test_stop_from_another_client(client, sim):
    joints = joints_of(sim)
    sim.startSimulation()
    result = []
    thread = threading.Thread(target=lambda: result.append(connect()[1].moveToConfig(
        {'joints': joints, 'targetPos': [3.0] + START[1:], 'maxVel': [0.5] * 6, 'maxAccel': [2.0] * 6,
         'maxJerk': [20.0] * 6})))
    thread.start()
    while sim.getJointPosition(joints[0]) < 0.1:
        pass
    client.require('handeye').stop()
    thread.join(10)
    assert not thread.is_alive(), 'the call of the moving client returns'
    at_rest = sim.getJointPosition(joints[0])
    assert 0.1 < at_rest < 0.6, f'came to rest at {at_rest}'
    near([result[0]['pos'][0]], [at_rest])
    sim.wait(0.2)
    near([sim.getJointPosition(joints[0])], [at_rest])


def test_several_requests_at_once(client, sim):
    async def gather():
        async with AsyncClient(port=PORT) as other:
            asim = await other.require('sim')
            arm = await asim.getObject('/UR5')
            poses = await asyncio.gather(*(asim.getObjectPose(arm) for _ in range(30)))
            await asim.startSimulation()
            waits = asyncio.gather(asim.wait(0.2), asim.wait(0.1), asim.getSimulationState(), asim.step())
            return poses, await waits

    poses, (first, second, state, _) = asyncio.run(gather())
    assert len(poses) == 30 and all(pose == poses[0] for pose in poses)
    assert first < 0.06 and second < 0.06 and state >= 16


def test_test_callback(client, sim):
    calls = []

    def callback(a, b):
        calls.append((a, b))
        return a + b

    assert sim.testCB(21, callback, 21) == 42
    assert len(calls) == 100


def test_settings_and_signals(client, sim):
    assert sim.getInt32Param(sim.intparam_program_version) >= 40600
    fps = sim.getInt32Param(sim.intparam_idle_fps)
    sim.setInt32Param(sim.intparam_idle_fps, 0)
    assert sim.getInt32Param(sim.intparam_idle_fps) == 0
    sim.setInt32Param(sim.intparam_idle_fps, fps)
    near([sim.getFloatParam(sim.floatparam_simulation_time_step)], [sim.getSimulationTimeStep()])
    sim.setStringSignal('s', b'\x00\xff')
    assert sim.getStringSignal('s') == b'\x00\xff'
    sim.clearStringSignal('s')
    assert sim.getStringSignal('s') is None
    assert sim.addLog(sim.verbosity_scriptinfos, None) is None
    realtime = sim.getBoolParam(sim.boolparam_realtime_simulation)
    sim.setBoolParam(sim.boolparam_realtime_simulation, False)
    sim.startSimulation()
    before = time.time()
    sim.wait(20)
    assert time.time() - before < 10, 'without real time, time runs ahead'
    sim.setBoolParam(sim.boolparam_realtime_simulation, realtime)


KILLED = '''
import sys
sys.argv = ['client', '%d']
from coppeliasim_zmqremoteapi_client import RemoteAPIClient
client = RemoteAPIClient(port=%d)
sim = client.require('sim')
def callback(state):
    print('inside', flush=True)
    import time; time.sleep(1000)
sim.setStepping(True)
sim.startSimulation()
sim.step()
%s
'''


def killed(last_words):
    child = subprocess.Popen([sys.executable, '-c', KILLED % (PORT, PORT, last_words)], stdout=subprocess.PIPE)
    child.stdout.readline()
    os.kill(child.pid, signal.SIGKILL)
    child.wait()


def test_killed_clients_do_not_freeze_time(client, sim):
    idle = "print('idle', flush=True); import time; time.sleep(1000)"
    callback = ("sim.moveToConfig({'pos': [0], 'targetPos': [1], 'maxVel': [1], 'maxAccel': [1], 'maxJerk': [1], "
                "'callback': callback})")
    for last_words in (idle, callback):
        killed(last_words)
        frozen, before = sim.getSimulationTime(), time.time()
        while sim.getSimulationTime() < frozen + 0.1:
            assert time.time() - before < 10, 'time is frozen'
        sim.stopSimulation(True)


def main():
    wanted = sys.argv[2:]
    scenarios = [(name, run) for name, run in globals().items()
                 if name.startswith('test_') and (not wanted or name in wanted)]
    for name, run in scenarios:
        client, sim = connect()
        sim.stopSimulation(True)
        try:
            run(client, sim)
        except BaseException:
            print(f'FAILED {name} ({cbor.__package__})', flush=True)
            raise
        sim.stopSimulation(True)
        print(f'ok {name}', flush=True)
    print(f'{len(scenarios)} passed ({cbor.__package__})')


if __name__ == '__main__':
    main()
