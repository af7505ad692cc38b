# /// script
# requires-python = ">=3.9"
# dependencies = ["panda-python>=1.1,<1.2"]
# ///
"""A driver for Franka arms. It has not been run with an arm: it is checked with libfranka in front of a controller of our own.

It reads a Franka Emika Robot (Panda) or a Research 3 through the Franka Control Interface (docs/drivers/franka.md).

    handeye driver test "handeye driver franka --host 172.16.0.2"

It only reads: of libfranka's Robot it calls read_once and server_version, which command nothing.
"""

import math
import os
import socket
import time

from handeye_driver import Fault, conjugate, parser, pose, serve, times, turned, within

PORT = 1337
# The Franka Emika Robot speaks up to this version of the protocol, the Research 3 later ones (panda-py's README).
LAST_OF_FER = 5
JOINTS = 7
# libfranka's names of RobotMode, and what they mean for somebody who wants to calibrate.
MODES = {
    "kOther": "not ready: are the brakes open? Desk opens them",
    "kIdle": "idle",
    "kMove": "moved by a program",
    "kGuiding": "guided by hand",
    "kReflex": "stopped by a reflex, as after a collision",
    "kUserStopped": "stopped by the user, with the external activation device",
    "kAutomaticErrorRecovery": "recovering from an error",
}
WARNED_OF = ("kOther", "kReflex")
# A joint slower than this is at rest [rad/s].
REST_RAD_S = 1e-2
# How far a column of a rotation matrix may be from length 1: rounding is within, the zeros of a field never set are not.
UNIT_TOLERANCE = 1e-3
# How long a connection may take [s].
PATIENCE_S = 2.0
# Number of values that determine how fast they arrive at best: they come 1000 times a second.
FOR_THE_CLOCK = 25


class Franka:
    def __init__(self, options):
        self.options = options
        self.period_s = 1 / options.frequency
        self.robot = None
        self.told = None

    def open(self, outlet):
        host = self.options.host
        # libfranka waits for a minute if nothing answers, and Python stands still meanwhile.
        try:
            socket.create_connection((host, PORT), PATIENCE_S).close()
        except ConnectionRefusedError as error:
            raise Fault(
                f"{host} refuses connections at port {PORT}: open the brakes and activate FCI in Desk (https://{host}), which "
                "takes an arm that has the FCI feature"
            ) from error
        except OSError as error:
            raise Fault(
                f"no controller answers at {host}:{PORT}: {error}. Check that it is on, its address, under which Desk opens, and "
                "the cable, which belongs into the control box and not into the arm's base"
            ) from error
        from panda_py import libfranka

        try:
            # Real-time priority is for programs that control the arm.
            self.robot = libfranka.Robot(host, libfranka.RealtimeConfig.kIgnore)
        except RuntimeError as error:
            raise Fault(trouble(host, error)) from error
        for _ in range(FOR_THE_CLOCK):
            outlet.heard(stamp(self.read()))
        version = self.robot.server_version()
        model, name = ("Franka Emika Robot", "panda") if version <= LAST_OF_FER else ("Franka Research 3", "fr3")
        joints = [{"name": f"{name}_joint{number}", "kind": "revolute"} for number in range(1, JOINTS + 1)]
        hello = {"name": f"{model} at {host}", "clock": "controller", "can": ["state", "joints"], "joints": joints}
        if self.options.urdf:
            # The workbench reads the file itself, wherever it was started.
            tip = {"tip_link": self.options.tip_link} if self.options.tip_link else {}
            hello["arm"] = {"urdf": os.path.realpath(self.options.urdf), **tip}
        return hello

    def read(self):
        """The next state. libfranka drops those that have waited, and takes none that is older than the one before."""
        try:
            return self.robot.read_once()
        except RuntimeError as error:
            raise Fault(trouble(self.options.host, error)) from error

    def run(self, outlet):
        due_s = time.monotonic()
        while not outlet.ended.is_set():
            state = self.read()
            outlet.heard(stamp(state))
            self.log_changes(outlet, state)
            outlet.state(stamp(state), joints_rad=list(state.q), **poses(state), moving=moves(state.dq))
            # States that are late are not made up for.
            due_s = max(due_s + self.period_s, time.monotonic())
            time.sleep(max(due_s - time.monotonic(), 0.0))

    def log_changes(self, outlet, state):
        mode, errors = state.robot_mode.name, errors_of(state)
        if (mode, errors) == self.told:
            return
        self.told = (mode, errors)
        text = f"robot mode {mode} ({MODES.get(mode, 'not known to this driver')})"
        if errors:
            outlet.log("warn", f"{text}, errors: {', '.join(errors)}")
        else:
            outlet.log("warn" if mode in WARNED_OF else "info", text)


def stamp(state):
    """Seconds since the controller was started."""
    return state.time.to_sec()


def moves(joint_speeds):
    """Whether the arm moves, by the speeds that the controller measures."""
    return any(abs(speed) > REST_RAD_S for speed in joint_speeds)


def errors_of(state):
    errors = state.current_errors
    return tuple(name for name in dir(errors) if not name.startswith("_") and getattr(errors, name) is True)


def poses(state):
    """Where the tip and the flange are. F_T_EE is the hand's place with what was set by a program or in Desk."""
    translation, rotation = transform("O_T_EE", state.O_T_EE)
    tool_translation, tool_rotation = transform("F_T_EE", state.F_T_EE)
    flange_rotation = times(rotation, conjugate(tool_rotation))
    offset = turned(flange_rotation, tool_translation)
    flange = pose([a - b for a, b in zip(translation, offset)], flange_rotation)
    return {"base_from_tip": pose(translation, rotation), "base_from_flange": flange}


def transform(name, values):
    """Translation and quaternion of a 4×4 matrix, which libfranka has column by column: 12 to 14 are the translation [m]."""
    x, y, z = (values[4 * column : 4 * column + 3] for column in range(3))
    if any(abs(math.hypot(*axis) - 1) > UNIT_TOLERANCE for axis in (x, y, z)):
        raise Fault(f"{name} is not the matrix of a rigid transform: {list(values)}. Check the end effector in Desk")
    return tuple(values[12:15]), quaternion_of_axes(x, y, z)


def quaternion_of_axes(x, y, z):
    """The unit quaternion of a rotation matrix with these columns, by its largest component, which is far from zero."""
    candidates = (
        (1 + x[0] - y[1] - z[2], x[1] + y[0], z[0] + x[2], y[2] - z[1]),
        (x[1] + y[0], 1 - x[0] + y[1] - z[2], y[2] + z[1], z[0] - x[2]),
        (z[0] + x[2], y[2] + z[1], 1 - x[0] - y[1] + z[2], x[1] - y[0]),
        (y[2] - z[1], z[0] - x[2], x[1] - y[0], 1 + x[0] + y[1] + z[2]),
    )
    largest = max(range(4), key=lambda i: candidates[i][i])
    length = math.hypot(*candidates[largest])
    return tuple(value / length for value in candidates[largest])


def trouble(host, error):
    """Why libfranka fails, and what to do."""
    text = " ".join(str(error).split())
    if type(error).__name__ == "IncompatibleVersionError" or "ncompatible" in text:
        return (
            f"{text}. Install the wheel of panda-py for this arm's system into a Python of yours (panda-py's README lists them), "
            "and name that with --python"
        )
    if "UDP receive" in text:
        return (
            f"{host} sends no states: {text}. Another program may control the arm through FCI, which has one user at a time; or a "
            "firewall of this computer does not let UDP in"
        )
    return f"{host}:{PORT} does not answer as a controller of Franka: {text}"


def main():
    options = parser(__doc__)
    options.add_argument("--host", required=True, metavar="ADDR", help="address of the control box, under which Desk opens")
    frequency = "states a second, 100; the controller sends 1000"
    options.add_argument("--frequency", metavar="HZ", type=within(10, 500, int), default=100, help=frequency)
    urdf = "the arm's URDF, up to the flange: the arm is drawn, and its joints are known"
    options.add_argument("--urdf", metavar="FILE", help=urdf)
    options.add_argument("--tip-link", metavar="LINK", help="the flange in the URDF, where that goes on behind it")
    chosen = options.parse_args()
    if chosen.tip_link and not chosen.urdf:
        options.error("--tip-link needs --urdf")
    serve(Franka(chosen))


if __name__ == "__main__":
    main()
