"""A driver with one thing wrong: `python broken.py FAULT [MARK]`. It moves by writing to the file MARK."""
import json, os, random, struct, subprocess, sys, threading, time, zlib

fault = sys.argv[1] if len(sys.argv) > 1 else "none"
mark = sys.argv[2] if len(sys.argv) > 2 else None
out = os.fdopen(os.dup(1), "wb")
lock = threading.RLock()
WIDTH, HEIGHT = 64, 48
JOINT = {"name": "lift", "kind": "prismatic", "min": 0.0, "max": 0.5}
joint, armed, motion, wanted, heard, greeted, pings = 0.1, False, None, None, time.monotonic(), False, 0
began = time.monotonic()


def now():
    return (time.monotonic() - began) * (1000 if fault == "milliseconds" else 1) + 100.0


def raw(data):
    with lock:
        out.write(data)
        out.flush()


def send(message, data=b""):
    raw(json.dumps(message).encode() + b"\n" + data)


def pose(z):
    return {"translation_m": [0.0, 0.0, z], "rotation_xyzw": [0.0, 0.0, 0.0, 1.0]}


def state():
    message = {"type": "state", "stamp": now(), "joints_rad": [joint], "base_from_tip": pose(joint), "moving": motion is not None}
    if fault == "trembles":
        message["joints_rad"] = [joint + random.uniform(0.0, 0.02)]
    if fault == "nan":
        message["base_from_tip"]["translation_m"][0] = float("nan")
    elif fault == "no stamp":
        del message["stamp"]
    elif fault == "quaternion":
        message["base_from_tip"]["rotation_xyzw"] = [0.0, 0.0, 0.0, 2.0]
    elif fault == "millimetres":
        message["base_from_tip"]["translation_m"] = [400.0, 0.0, 300.0]
    elif fault == "degrees":
        message["joints_rad"] = [90.0]
    elif fault == "stamps back":
        # The clock begins at 100: never ahead of it, which would be another fault.
        message["stamp"] = 200.0 - now()
    elif fault == "frozen stamps":
        message["stamp"] = 100.0
    elif fault == "other clock":
        message["stamp"] = now() + 5.0
    elif fault == "too many joints":
        message["joints_rad"] = [0.1, 0.2]
    elif fault == "no pose":
        del message["base_from_tip"]
    elif fault == "text for a number":
        message["stamp"] = "now"
    return message


def png(width, height):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = b"".join(b"\0" + bytes(3 * width) for _ in range(height))
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def image(request):
    message = {"type": "image", "id": request["id"], "stamp": now(), "width": WIDTH, "height": HEIGHT, "encoding": "mono8"}
    data = bytes(WIDTH * HEIGHT)
    if fault == "jpeg":
        message["encoding"], data = "jpeg", b"\xff\xd8\xff\xe0 this is no photograph"
    elif fault == "png of another size":
        message["encoding"], data = "png", png(WIDTH // 2, HEIGHT)
    elif fault == "image of another size":
        message["width"] = 2 * WIDTH
        data = bytes(2 * WIDTH * HEIGHT)
    elif fault == "encoding":
        message["encoding"] = "yuv422"
    elif fault == "old image" and request["after"] is not None:
        message["stamp"] = request["after"]
    elif fault == "image id":
        message["id"] += 7
    elif fault == "image of three seconds ago":
        message["stamp"] -= 3.0
    elif fault == "camera blocks states":
        time.sleep(0.4)
    message["bytes"] = len(data)
    if fault == "wrong length":
        message["bytes"] = len(data) * 3
    elif fault == "endless image":
        message["encoding"], message["bytes"] = "jpeg", 99999999999
    elif fault == "too few bytes":
        data = data[:-30]
    elif fault == "too many bytes":
        data = data + b"\xff\xfe\xfd\n"
    elif fault == "cut image":
        raw(json.dumps(message).encode() + b"\n" + data[:100])
        os._exit(0)
    send(message, data)
    if fault == "two images":
        send(message, data)


def halt():
    global motion
    if motion is not None and fault != "ignores stop":
        send({"type": "stopped", "id": motion["id"], "why": "stop"})
        motion = None


def work():
    global joint, motion, wanted, armed
    while True:
        time.sleep(1.0 if fault == "slow states" else 0.02)
        with lock:
            if not greeted:
                continue
            if time.monotonic() - heard > 1.0 and fault != "ignores silence":
                armed = False
                halt()
            done = None
            if motion is not None:
                goal = motion["joints_rad"][0]
                step = max(-0.0002, min(0.0002, goal - joint))
                joint += step
                if mark and step:
                    open(mark, "a").write("moved\n")
                if abs(goal - joint) <= (0.004 if fault == "stops short" else 0.0):
                    done, motion = motion["id"], None
            if fault != "no states":
                send(state())
            if done is not None:
                send({"type": "done", "id": done})
            if wanted is not None and fault != "no images":
                image(wanted)
                wanted = None


def hello():
    global greeted
    can = ["state", "joints", "image", "move_joints"]
    message = {"type": "hello", "protocol": 1, "name": f"broken {os.getpid()}", "version": "1", "clock": "test", "can": can,
               "joints": [JOINT], "camera": {"width": WIDTH, "height": HEIGHT}}
    if fault == "protocol 2":
        message["protocol"] = 2
    elif fault == "state without can":
        message["can"] = ["image"]
        del message["joints"]
    elif fault == "joints without joints":
        del message["joints"]
    elif fault == "nothing in can":
        message["can"] = []
    elif fault == "no can":
        del message["can"]
    elif fault == "arm of no name":
        message["arm"] = "ur99"
    elif fault == "another arm":
        message["arm"] = "ur5e"
    elif fault == "bytes after hello":
        message["bytes"] = 4
    if fault == "children leave":
        # One with a session of its own, one below a parent that has gone, one that does not know where it is from.
        null = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        sleep = [sys.executable, "-c", "import time; time.sleep(600)"]
        one = subprocess.Popen(sleep, start_new_session=True, **null).pid
        leave = f"import subprocess; print(subprocess.Popen({sleep!r}, start_new_session=True, **{null!r}).pid)"
        two = int(subprocess.run([sys.executable, "-c", leave], stdout=subprocess.PIPE, check=True).stdout)
        three = subprocess.Popen(sleep, start_new_session=True, env={}, **null).pid
        with open(mark, "w") as file:
            file.write(f"{one} {two} {three}")
    send(message)
    greeted = True
    if fault == "two hellos":
        send(message)
    elif fault == "image that nobody asked for":
        image({"id": 1, "after": None})
    elif fault == "answers nobody":
        send({"type": "done", "id": 4711})
    elif fault == "gives up":
        send({"type": "error", "text": "the controller is in protective stop"})
    elif fault == "dies":
        print("Traceback: the robot is not reachable", file=sys.stderr, flush=True)
        os._exit(3)
    elif fault == "closes its output":
        out.close()
        os.close(1)
    elif fault == "child holds the pipe":
        subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        os._exit(0)
    elif fault == "floods standard error":
        threading.Thread(target=lambda: [os.write(2, b"x" * 100_000) for _ in range(1000)], daemon=True).start()
    elif fault == "floods log":
        lines = ({"type": "log", "text": f"{i} " + "y" * 1000} for i in range(10_000))
        threading.Thread(target=lambda: [send(line) for line in lines], daemon=True).start()
    elif fault == "does not read":
        time.sleep(3600)


def hear(message):
    global armed, motion, wanted, pings
    kind, number = message["type"], message.get("id")
    if kind == "hello":
        hello()
    elif kind == "ping":
        pings += 1
        if fault == "no pong" or (fault == "one pong" and pings > 1):
            return
        send({"type": "pong", "id": number + (100 if fault == "pong id" else 0), "stamp": now()})
    elif kind == "next_image":
        wanted = message
    elif kind == "arm":
        if fault == "does not arm":
            send({"type": "refused", "id": number, "why": "the key is in local mode"})
            return
        armed = message["on"]
        if not armed:
            halt()
        send({"type": "done", "id": number})
        if armed and fault == "disarms":
            armed = False
            send({"type": "disarmed", "why": "the pendant is in manual mode"})
    elif kind == "move":
        if not armed and fault != "moves unarmed":
            send({"type": "refused", "id": number, "why": "read-only"})
        elif motion is not None:
            send({"type": "refused", "id": number, "why": "the arm moves"})
        elif fault != "does not answer move":
            motion = message
            send({"type": "accepted", "id": number})
    elif kind == "stop":
        halt()
        if fault != "ignores stop":
            send({"type": "done", "id": number})
    elif kind == "bye":
        if fault != "ignores the end":
            os._exit(0)
    elif fault == "dies of what it does not know":
        raise ValueError(kind)


if fault == "silent":
    time.sleep(3600)
elif fault == "chatter":
    raw(b"Connecting to the robot...\n")
elif fault == "empty line":
    raw(b"\n")
elif fault == "not JSON":
    raw(b"{'type': 'hello'}\n")
elif fault == "not UTF-8":
    raw(b"\xff\xfe\x00h\n")
elif fault == "no type":
    raw(b'{"hello": 1}\n')
elif fault == "a list":
    raw(b"[1, 2, 3]\n")
elif fault == "long line":
    raw(b"x" * 100_000_000)
elif fault == "deep":
    raw(b'{"type":"x","a":' + b"[" * 60_000 + b"\n")
elif fault == "cut line":
    raw(b'{"type":"hel')
    os._exit(0)
elif fault == "early state":
    send(state())
elif fault == "early exit":
    print("ModuleNotFoundError: No module named 'robot'", file=sys.stderr)
    sys.exit(1)

threading.Thread(target=work, daemon=True).start()
try:
    for line in sys.stdin.buffer:
        with lock:
            heard = time.monotonic()
            hear(json.loads(line))
except BrokenPipeError:
    pass
while fault == "ignores the end":
    time.sleep(1)
os._exit(0)
