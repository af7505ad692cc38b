"""Reads a Universal Robots controller at an address with PyPI's ur_rtde and prints the values as JSON."""

import json
import sys

import rtde_receive

VARIABLES = ["timestamp", "actual_q", "actual_TCP_pose", "robot_mode", "safety_mode", "runtime_state", "robot_status_bits",
             "safety_status_bits"]

receive = rtde_receive.RTDEReceiveInterface(sys.argv[1], 125.0, VARIABLES)
values = {
    "timestamp": receive.getTimestamp(),
    "actual_q": receive.getActualQ(),
    "actual_TCP_pose": receive.getActualTCPPose(),
    "robot_mode": receive.getRobotMode(),
    "safety_mode": receive.getSafetyMode(),
}
receive.disconnect()
print(json.dumps(values))
