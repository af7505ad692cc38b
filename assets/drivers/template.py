#!/usr/bin/env python3
"""A driver to start from, in Python without other packages. What it says and is told stands in docs/drivers.md.

The robot and the camera are made up: replace `read_robot`, `step` and `read_camera`. Check it with
    handeye driver test "python3 template.py" --allow-motion
"""
import json, math, os, sys, threading, time

messages = os.fdopen(os.dup(1), "wb")  # standard output is for messages only:
os.dup2(2, 1)  # output of libraries goes to standard error, and so to the window's log
lock = threading.RLock()
JOINTS = [{"name": f"joint {i + 1}", "kind": "revolute", "min": -math.pi, "max": math.pi} for i in range(6)]
WIDTH, HEIGHT = 640, 480
joints = [0.0, -1.2, 1.5, -0.3, 1.5, 0.0]
armed, motion, wanted, heard, greeted = False, None, None, time.monotonic(), False


def send(message, data=b""):
    with lock:  # a message and its bytes stay together
        messages.write(json.dumps(message, allow_nan=False).encode() + b"\n" + data)
        messages.flush()


def read_robot():
    """What the controller measures now, and when."""
    half = joints[0] / 2
    pose = {"translation_m": [0.4, 0.1 * joints[1], 0.3 + 0.1 * joints[2]],
            "rotation_xyzw": [math.cos(half), math.sin(half), 0.0, 0.0]}
    return {"stamp": time.monotonic(), "joints_rad": list(joints), "base_from_tip": pose, "moving": motion is not None}


def step(seconds):
    """Moves towards the goal; true once it is there. A real arm is moved by its controller, and asked whether it stands."""
    for i, goal in enumerate(motion["joints_rad"]):
        most = motion["speed"] * seconds
        joints[i] += max(-most, min(most, goal - joints[i]))
    return joints == motion["joints_rad"]


def read_camera():
    """Waits for the camera's next image: when it was, and its bytes. This camera takes 30 ms."""
    time.sleep(0.03)
    row = bytes(x % 256 for x in range(WIDTH))
    return time.monotonic(), row * HEIGHT


def halt(why):
    """Brakes. This robot stands at once; wait for a real one before saying so."""
    global motion
    if motion is not None:
        send({"type": "stopped", "id": motion["id"], "why": why})
        motion = None


def look():
    """Answers `next_image`. A thread of its own, and without the lock while the camera works: states and pongs go on. What
    takes long to load is loaded here or in `work`, after `hello` is answered."""
    global wanted
    while True:
        stamp, data = read_camera()
        with lock:
            if wanted is not None and (wanted["after"] is None or stamp > wanted["after"]):
                send({"type": "image", "id": wanted["id"], "stamp": stamp, "stamp_uncertainty_s": 0.01, "width": WIDTH,
                      "height": HEIGHT, "encoding": "mono8", "bytes": len(data)}, data)
                wanted = None


def work():
    """Reports the robot and moves it, fifty times a second."""
    global armed, motion
    while True:
        time.sleep(0.02)
        with lock:
            if not greeted:
                continue
            if time.monotonic() - heard > 1.0:
                halt("nothing was heard of the workbench")
                if armed:
                    send({"type": "disarmed", "why": "nothing was heard of the workbench for a second"})
                armed = False
            arrived = motion is not None and step(0.02)
            answer, motion = motion, None if arrived else motion
            send({"type": "state", **read_robot()})
            if arrived:
                send({"type": "done", "id": answer["id"]})


def hear(message):
    global armed, motion, wanted, greeted
    kind, answer = message["type"], {"id": message.get("id")}
    if kind == "hello":
        send({"type": "hello", "protocol": 1, "name": "template", "version": "1.0", "clock": "monotonic", "joints": JOINTS,
              "can": ["state", "joints", "image", "move_joints"], "camera": {"width": WIDTH, "height": HEIGHT}})
        greeted = True
    elif kind == "ping":
        send({"type": "pong", **answer, "stamp": time.monotonic()})
    elif kind == "next_image":
        wanted = message
    elif kind == "arm":
        armed = message["on"]
        if not armed:
            halt("motion is no longer allowed")
        send({"type": "done", **answer})
    elif kind == "move":
        goal = message.get("joints_rad", [])
        outside = len(goal) != len(JOINTS) or any(not j["min"] <= q <= j["max"] for j, q in zip(JOINTS, goal))
        why = "it is read-only" if not armed else "the arm moves" if motion else "out of range" if outside else None
        motion = motion if why else message
        send({"type": "refused", **answer, "why": why} if why else {"type": "accepted", **answer})
    elif kind == "stop":
        halt("stop")
        send({"type": "done", **answer})
    return kind != "bye"


threading.Thread(target=work, daemon=True).start()
threading.Thread(target=look, daemon=True).start()
for line in sys.stdin.buffer:  # ends when the workbench closes it
    with lock:
        heard = time.monotonic()
        if not hear(json.loads(line)):
            break
with lock:
    halt("the workbench is gone")
    os._exit(0)
