# /// script
# requires-python = ">=3.9"
# dependencies = ["xarm-python-sdk>=1.18,<1.19"]
# ///
"""A driver for UFACTORY arms. It has not been run with an arm: it is checked with UFACTORY's SDK and a controller of our own.

It reads an xArm 5, 6 or 7, a Lite 6 or an 850 (docs/drivers/xarm.md).

    handeye driver test "handeye driver xarm --host 192.168.1.185"

It only reads: of the SDK it calls nothing that moves or enables the arm, or clears an error.
"""

import collections
import importlib
import math
import os
import queue
import socket
import sys
import threading
import time

from handeye_driver import Fault, conjugate, parser, pose, quaternion, serve, times

# Of commands, and of the report that comes 100 times a second. The SDK knows no others.
COMMAND_PORT, REPORT_PORT = 502, 30003
# Kinds of arm with 6 joints that are no xArm 6, by the number in the controller's version (SDK: is_lite6, is_850).
MODELS = {9: "Lite 6", 12: "850"}
# As documented for XArmAPI.state and XArmAPI.mode.
STATES = {1: "in motion", 2: "sleeping", 3: "suspended", 4: "stopping"}
MODES = {
    0: "position control", 1: "servo motion", 2: "joint teaching", 3: "cartesian teaching", 4: "joint velocity control",
    5: "cartesian velocity control", 6: "joint online planning", 7: "cartesian online planning",
}  # fmt: skip
# States that need somebody. The others change with each motion, which is not worth a line in the log.
HALTED = {3: "its program is paused", 4: "it does not move until it is enabled in UFACTORY Studio, and its brakes may be engaged"}
# Emergency stop and errors of the joints. The SDK takes no positions while one of them is set.
LOST = range(1, 18)
# The speed is that over at least this long [s]: ten reports.
SPEED_S = 0.1
# Slower than this an arm is at rest [m/s, rad/s].
REST_M_S, REST_RAD_S = 2e-3, 1e-2
# How long a connection or the next report may take [s].
PATIENCE_S = 2.0
# How long the SDK may take to connect [s]: it asks for the version for minutes, and the workbench waits 10 s for `hello`.
CONNECT_S = 5.0
# Longest interval at which errors are read [s], which the report does not have. A new state of the arm has them read at once.
ERRORS_S = 1.0
# How far the two orientations that the controller states may differ [rad]: both are rounded to 1e-6.
SAME_RAD = 1e-4
# Tries to read the pose twice while the arm does not move.
TRIES = 3

# What the controller states at one instant; the tip is x, y, z [mm] and roll, pitch, yaw [rad].
Report = collections.namedtuple("Report", "stamp joints tip state mode")


class XArm:
    def __init__(self, options):
        self.options = options
        self.arm = None
        self.joint_count = 0
        self.reports = queue.Queue(maxsize=100)
        self.recent = collections.deque()
        self.errors = (0, 0)  # of the controller: error and warning
        self.is_new_state = threading.Event()
        self.state = self.told = None

    def open(self, outlet):
        host = self.options.host
        address = reachable(host)
        # The SDK's units would be degrees. Without `forbid_uds` a file in /tmp would take the place of the address.
        self.arm = sdk().XArmAPI(address, is_radian=True, do_not_open=True, report_type="real", forbid_uds=True)
        wanted = ("cartesian", "joints", "state")
        all_of_it = ("cartesian", "joints", "state", "error_code", "warn_code", "mtable", "mtbrake", "cmd_num")
        self.arm.register_report_callback(self.take, **{f"report_{part}": part in wanted for part in all_of_it})
        self.connect(host)
        # The SDK assumes 7 joints where the version does not state them; the serial number is stated with them.
        if self.arm.sn is None:
            raise Fault(f"the firmware of the controller at {host} ({self.arm.version}) does not state the arm's joints: update it")
        self.joint_count = self.arm.axis
        self.check_orientation(outlet)
        self.read_errors()
        self.next_report()
        threading.Thread(target=self.watch_errors, args=(outlet,), daemon=True).start()
        model = MODELS.get(self.arm.device_type, f"xArm {self.joint_count}")
        joints = [{"name": f"joint{number}", "kind": "revolute"} for number in range(1, self.joint_count + 1)]
        hello = {"name": f"UFACTORY {model} at {host}", "clock": "monotonic", "can": ["state", "joints"], "joints": joints}
        if self.options.urdf:
            # The workbench reads the file itself, wherever it was started.
            tip = {"tip_link": self.options.tip_link} if self.options.tip_link else {}
            hello["arm"] = {"urdf": os.path.realpath(self.options.urdf), **tip}
        return hello

    def connect(self, host):
        """Has the SDK connect, in a thread of its own: it has no limit of time."""
        failures = []

        def work():
            try:
                self.arm.connect()
            except Exception as error:  # the SDK raises nothing more specific
                failures.append(error)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        thread.join(CONNECT_S)
        if failures or thread.is_alive() or not self.arm.connected:
            why = f": {failures[0]}" if failures else ""
            raise Fault(
                f"what listens at {host}:{COMMAND_PORT} does not answer as a controller of UFACTORY{why}. Check that this is the "
                "arm's address, and that UFACTORY Studio shows the arm there"
            )

    def check_orientation(self, outlet):
        """Compares roll, pitch, yaw, whose order of axes is a convention, to the rotation vector, which has none."""
        for _ in range(TRIES):
            readings = [self.arm.get_position(), self.arm.get_position_aa(), self.arm.get_position()]
            if any(code != 0 for code, _ in readings):
                break
            (_, before), (_, vector), (_, after) = readings
            if before == after:  # it did not move meanwhile
                angle = angle_between(of_rpy(before[3:]), quaternion(vector[3:]))
                if angle > SAME_RAD:
                    raise Fault(
                        f"the controller's roll, pitch, yaw and its rotation vector differ by {math.degrees(angle):.2f}°: its "
                        "firmware has another order of axes than UFACTORY's manual. Report this with the version of the firmware"
                    )
                return
        outlet.log("info", "roll, pitch, yaw are not compared to the controller's rotation vector: the arm moves, or there is none")

    def take(self, report):
        """Takes a report, in the thread of the SDK."""
        joints, tip = tuple(report["joints"]), tuple(report["cartesian"])
        try:
            self.reports.put_nowait(Report(time.monotonic(), joints, tip, report["state"], self.arm.mode))
        except queue.Full:  # before `hello`, nothing takes them
            pass

    def next_report(self):
        try:
            return self.reports.get(timeout=PATIENCE_S)
        except queue.Empty:
            pass
        if not self.arm.connected:
            raise Fault("the controller closed the connection: was it switched off or restarted?")
        raise Fault(f"the controller has sent no report on port {REPORT_PORT} for {PATIENCE_S} s: check the network")

    def read_errors(self):
        code, errors = self.arm.get_err_warn_code()
        if code == 0:
            self.errors = tuple(errors)

    def watch_errors(self, outlet):
        while not outlet.ended.is_set():
            self.is_new_state.wait(ERRORS_S)
            self.is_new_state.clear()
            self.read_errors()

    def run(self, outlet):
        while not self.reports.empty():  # from before `hello`
            self.reports.get()
        while not outlet.ended.is_set():
            report = self.next_report()
            if report.state != self.state:
                self.state = report.state
                self.is_new_state.set()
            self.log_changes(outlet, report)
            if self.errors[0] in LOST:
                self.recent.clear()
                continue
            outlet.state(
                report.stamp,
                joints_rad=report.joints[: self.joint_count],
                base_from_tip=pose([value / 1000 for value in report.tip[:3]], of_rpy(report.tip[3:])),
                moving=self.moves(report),
            )

    def moves(self, report):
        """Whether the arm moves, by the positions of late; None while there are too few. The controller's "in motion" is not
        used: whether it ends while a program waits between two motions is not documented."""
        self.recent.append(report)
        while len(self.recent) > 2 and report.stamp - self.recent[1].stamp >= SPEED_S:
            self.recent.popleft()
        return moves(self.recent[0], report)

    def log_changes(self, outlet, report):
        now = (report.state if report.state in HALTED else None, report.mode, self.errors)
        if now == self.told:
            return
        self.told = now
        error, warning = self.errors
        if error:
            lost = ": its pose is not known until the arm is enabled again" if error in LOST else ""
            outlet.log("warn", f"{words('error', error)}{lost}")
        if warning:
            outlet.log("warn", words("warning", warning))
        state = f"state {report.state} ({STATES.get(report.state, 'not documented')})"
        text = f"{state}, mode {report.mode} ({MODES.get(report.mode, 'not documented')})"
        if report.state in HALTED:
            outlet.log("warn", f"{text}: {HALTED[report.state]}")
        else:
            outlet.log("info", text)


def sdk():
    """The module of the SDK. Its package has the name of this file, which would be found first."""
    paths, here = list(sys.path), os.path.dirname(os.path.abspath(__file__))
    sys.path[:] = [path for path in paths if os.path.abspath(path) != here]
    try:
        return importlib.import_module("xarm.wrapper")
    finally:
        sys.path[:] = paths


def reachable(host):
    """The IPv4 address of a controller that answers. The SDK takes whatever is none for the name of a serial port."""
    try:
        address = socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_STREAM)[0][4][0]
    except OSError as error:
        raise Fault(f"{host} is no address: {error}. The display of the control box and UFACTORY Studio show it") from None
    for port in (COMMAND_PORT, REPORT_PORT):
        try:
            socket.create_connection((address, port), PATIENCE_S).close()
        except OSError as error:
            raise Fault(
                f"no controller answers at {host}:{port}: {error}. Check that the control box is on, its address (UFACTORY Studio "
                "shows it), and that no firewall is between"
            ) from error
    return address


def of_rpy(angles):
    """The quaternion of roll, pitch, yaw [rad]: turns about the fixed axes x, then y, then z, R = Rz(yaw) Ry(pitch) Rx(roll), as
    UFACTORY's User Manual states ("XYZ fixed angle"). The SDK's documentation names the axes and not their order."""
    roll, pitch, yaw = angles
    return times(quaternion((0.0, 0.0, yaw)), times(quaternion((0.0, pitch, 0.0)), quaternion((roll, 0.0, 0.0))))


def angle_between(a, b):
    x, y, z, w = times(conjugate(a), b)
    return 2 * math.atan2(math.hypot(x, y, z), abs(w))


def moves(before, after):
    """Whether the arm moved between two reports; None where they are too close to tell."""
    seconds = after.stamp - before.stamp
    if seconds < SPEED_S:
        return None
    return (
        math.dist(before.tip[:3], after.tip[:3]) > 1000 * REST_M_S * seconds
        or angle_between(of_rpy(before.tip[3:]), of_rpy(after.tip[3:])) > REST_RAD_S * seconds
        or any(abs(b - a) > REST_RAD_S * seconds for a, b in zip(before.joints, after.joints))
    )


def words(kind, code):
    """An error or a warning of the controller, in the SDK's words."""
    from xarm.core.config.x_code import ControllerError, ControllerWarn

    known = (ControllerError if kind == "error" else ControllerWarn)(code)
    said = ". ".join(part.rstrip(". ") for part in (known.title["en"], known.description["en"]) if part)
    return f"{kind} {code} of the controller ({said})"


def main():
    options = parser(__doc__)
    address = "address of the control box, as UFACTORY Studio shows it"
    options.add_argument("--host", required=True, metavar="ADDR", help=address)
    urdf = "the arm's URDF, up to the flange: the arm is drawn, and its joints are known"
    options.add_argument("--urdf", metavar="FILE", help=urdf)
    options.add_argument("--tip-link", metavar="LINK", help="the flange in the URDF, where that goes on behind it")
    chosen = options.parse_args()
    if chosen.tip_link and not chosen.urdf:
        options.error("--tip-link needs --urdf")
    serve(XArm(chosen))


if __name__ == "__main__":
    main()
