"""A robot or a camera whose truth is known: `python clock.py robot|camera AHEAD`.

The tip goes up and down by a function of the time, and an image holds the time at which it was taken. The clock that stamps
are from is ahead of the time by AHEAD seconds.
"""
import json, math, os, struct, sys, threading, time

part, ahead = sys.argv[1], float(sys.argv[2])
out = os.fdopen(os.dup(1), "wb")
lock = threading.RLock()
wanted, greeted = None, False


def send(message, data=b""):
    with lock:
        out.write(json.dumps(message).encode() + b"\n" + data)
        out.flush()


def work():
    global wanted
    while True:
        time.sleep(0.01)
        with lock:
            now = time.time()
            if greeted and part == "robot":
                z = 0.5 + 0.2 * math.sin(math.pi * now)
                pose = {"translation_m": [0.0, 0.0, z], "rotation_xyzw": [0.0, 0.0, 0.0, 1.0]}
                send({"type": "state", "stamp": now + ahead, "base_from_tip": pose})
            elif wanted is not None:
                send({"type": "image", "id": wanted["id"], "stamp": now + ahead, "width": 8, "height": 1, "encoding": "mono8",
                      "bytes": 8}, struct.pack("<d", now))
                wanted = None


threading.Thread(target=work, daemon=True).start()
for line in sys.stdin.buffer:
    message = json.loads(line)
    with lock:
        if message["type"] == "hello":
            can = ["state"] if part == "robot" else ["image"]
            send({"type": "hello", "protocol": 1, "name": part, "can": can, "camera": {"width": 8, "height": 1}})
            greeted = True
        elif message["type"] == "ping":
            send({"type": "pong", "id": message["id"], "stamp": time.time() + ahead})
        elif message["type"] == "next_image":
            wanted = message
        elif message["type"] == "bye":
            break
os._exit(0)
