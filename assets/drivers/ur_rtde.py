# /// script
# requires-python = ">=3.9"
# dependencies = ["ur_rtde>=1.6,<1.7"]
# ///
"""A driver of Handeye Workbench that reads a controller of Universal Robots through RTDE (docs/drivers/ur_rtde.md).

    handeye driver test "handeye driver ur-rtde --host 192.168.0.10 --arm ur5e"

It only reads: RTDEReceiveInterface has nothing that moves the arm.
"""

import math
import socket
import time

from handeye_driver import Fault, parser, pose, quaternion, serve, within

PORT = 30004
# As named in Universal Robots' own description.
JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
# The robots whose chains the workbench has.
ARMS = ["ur3", "ur5", "ur10", "ur3e", "ur5e", "ur10e", "ur16e", "ur5_coppeliasim"]
OUTPUTS = ["timestamp", "actual_q", "actual_qd", "actual_TCP_pose", "actual_TCP_speed", "robot_mode", "safety_mode"]
ROBOT_MODES = {
    -1: "NO_CONTROLLER", 0: "DISCONNECTED", 1: "CONFIRM_SAFETY", 2: "BOOTING", 3: "POWER_OFF", 4: "POWER_ON", 5: "IDLE",
    6: "BACKDRIVE", 7: "RUNNING", 8: "UPDATING_FIRMWARE",
}  # fmt: skip
SAFETY_MODES = {
    1: "NORMAL", 2: "REDUCED", 3: "PROTECTIVE_STOP", 4: "RECOVERY", 5: "SAFEGUARD_STOP", 6: "SYSTEM_EMERGENCY_STOP",
    7: "ROBOT_EMERGENCY_STOP", 8: "VIOLATION", 9: "FAULT", 10: "VALIDATE_JOINT_ID", 11: "UNDEFINED_SAFETY_MODE",
}  # fmt: skip
# From this mode on the encoders of the joints are read.
POWER_ON = 4
# Slower than this an arm is at rest [m/s, rad/s]. The noise measured at rest is about a tenth of it.
REST_M_S, REST_RAD_S = 2e-3, 1e-2
# How long a connection or the next values may take [s].
PATIENCE_S = 2.0
# Number of values that determine how fast they arrive at best: 0.2 s of them.
FOR_THE_CLOCK = 25


class UrRtde:
    def __init__(self, options):
        self.options = options
        self.period_s = 1 / options.frequency
        self.receive = None
        self.last_s = -math.inf
        self.modes = None

    def open(self, outlet):
        host = self.options.host
        # The library waits for minutes if nothing answers.
        try:
            socket.create_connection((host, PORT), PATIENCE_S).close()
        except OSError as error:
            raise Fault(
                f"no controller answers at {host}:{PORT}: {error}. Check the address that the pendant shows, and that RTDE is "
                "enabled there (Settings, Security, Services)"
            ) from error
        import rtde_receive

        try:
            self.receive = rtde_receive.RTDEReceiveInterface(host, float(self.options.frequency), OUTPUTS)
        except RuntimeError as error:
            raise Fault(
                f"{host}:{PORT} does not give the values that are read ({' '.join(str(error).split())}): is it a robot of "
                "Universal Robots with software 3.10 (CB3), 5.4 (e-Series) or newer?"
            ) from error
        for _ in range(FOR_THE_CLOCK):
            outlet.heard(self.sample()["stamp"])
        arm = {"arm": self.options.arm} if self.options.arm else {}
        joints = [{"name": name, "kind": "revolute"} for name in JOINTS]
        name = f"Universal Robots controller at {host}"
        return {"name": name, "clock": "controller", "can": ["state", "joints"], "joints": joints, **arm}

    def sample(self):
        """The next values, all of one instant."""
        since = time.monotonic()
        while True:
            stamp = self.receive.getTimestamp()
            if stamp < self.last_s:
                raise Fault("the controller was restarted: its clock went back")
            if stamp > self.last_s:
                values = {
                    "stamp": stamp,
                    "joints": self.receive.getActualQ(),
                    "tip": self.receive.getActualTCPPose(),
                    "speeds": (self.receive.getActualTCPSpeed(), self.receive.getActualQd()),
                    "modes": (self.receive.getRobotMode(), self.receive.getSafetyMode()),
                }
                # A package that arrived meanwhile would mix two instants.
                if self.receive.getTimestamp() == stamp:
                    self.last_s = stamp
                    return values
                continue
            if time.monotonic() - since > PATIENCE_S:
                raise Fault(f"the controller has sent nothing for {PATIENCE_S} s")
            if not self.receive.isConnected():
                raise Fault(
                    "the controller closed the connection: was it switched off, or is another program using the same outputs?"
                )
            time.sleep(self.period_s / 4)

    def run(self, outlet):
        while not outlet.ended.is_set():
            values = self.sample()
            outlet.heard(values["stamp"])
            if values["modes"] != self.modes:
                self.modes = values["modes"]
                log_modes(outlet, *self.modes)
            # When switched off, the controller repeats its last values, or zeros.
            if values["modes"][0] >= POWER_ON:
                tip = values["tip"]
                outlet.state(
                    values["stamp"],
                    joints_rad=values["joints"],
                    base_from_tip=pose(tip[:3], quaternion(tip[3:])),
                    moving=moves(*values["speeds"]),
                )


def moves(tip_speed, joint_speeds):
    """Whether the arm moves, by the speeds that the controller measures."""
    return (
        math.hypot(*tip_speed[:3]) > REST_M_S
        or math.hypot(*tip_speed[3:]) > REST_RAD_S
        or any(abs(speed) > REST_RAD_S for speed in joint_speeds)
    )


def log_modes(outlet, robot_mode, safety_mode):
    robot = ROBOT_MODES.get(robot_mode, "an unknown mode")
    safety = SAFETY_MODES.get(safety_mode, "an unknown safety mode")
    if robot_mode < POWER_ON:
        outlet.log("warn", f"the arm is switched off ({robot}): its pose is not known until it is switched on")
    elif safety in ("NORMAL", "REDUCED"):
        outlet.log("info", f"robot mode {robot}, safety mode {safety}")
    else:
        outlet.log("warn", f"the arm was stopped by its safety system: {safety}")


def main():
    options = parser(__doc__)
    options.add_argument("--host", required=True, metavar="ADDR", help="address of the controller, as the pendant shows it")
    options.add_argument("--port", type=int, choices=[PORT], default=PORT, help="of RTDE; the library knows no other")
    options.add_argument(
        "--frequency", metavar="HZ", type=within(10, 500, int), default=125, help="states a second: up to 125 from a CB3, up to 500 from an e-Series"
    )
    arms = f"which arm it is, which the controller does not report: {', '.join(ARMS)}"
    options.add_argument("--arm", metavar="NAME", choices=ARMS, help=arms)
    serve(UrRtde(options.parse_args()))


if __name__ == "__main__":
    main()
