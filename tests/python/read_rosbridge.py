"""Reads a robot's topics through a rosbridge with PyPI's roslibpy and prints what they say as JSON.

Usage: read_rosbridge.py PORT VERSION BASE TIP
"""

import base64
import json
import sys
import threading

import roslibpy

port, version, base, tip = int(sys.argv[1]), sys.argv[2], sys.argv[3], sys.argv[4]
infix = "" if version == "1" else "msg/"
TOPICS = {
    "/tf": f"tf2_msgs/{infix}TFMessage",
    "/tf_static": f"tf2_msgs/{infix}TFMessage",
    "/joint_states": f"sensor_msgs/{infix}JointState",
    "/camera/image_raw": f"sensor_msgs/{infix}Image",
    "/camera/camera_info": f"sensor_msgs/{infix}CameraInfo",
    "/camera/depth": f"sensor_msgs/{infix}Image",
}

messages = {}
complete = threading.Event()


def receiver(name):
    def receive(message):
        messages.setdefault(name, message)
        if len(messages) == len(TOPICS):
            complete.set()

    return receive


client = roslibpy.Ros(host="127.0.0.1", port=port)
client.run(timeout=20)
topics = [roslibpy.Topic(client, name, kind) for name, kind in TOPICS.items()]
for topic in topics:
    topic.subscribe(receiver(topic.name))
if not complete.wait(20):
    sys.exit(f"nothing came on {sorted(set(TOPICS) - set(messages))}")


def times(a, b):
    """The product of two quaternions x, y, z, w."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turned(q, v):
    """A vector turned by a quaternion."""
    conjugate = (-q[0], -q[1], -q[2], q[3])
    return times(times(q, (*v, 0.0)), conjugate)[:3]


# Up from the tip to the base: the transforms of tf say where the child is in its parent.
links = {}
for message in (messages["/tf"], messages["/tf_static"]):
    for link in message["transforms"]:
        t, q = link["transform"]["translation"], link["transform"]["rotation"]
        parent = link["header"]["frame_id"]
        links[link["child_frame_id"]] = (parent, (t["x"], t["y"], t["z"]), (q["x"], q["y"], q["z"], q["w"]))
position, rotation = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
frame = tip
while frame != base:
    frame, t, q = links[frame]
    position = tuple(a + b for a, b in zip(t, turned(q, position)))
    rotation = times(q, rotation)


def pixels(image, bytes_per_pixel):
    """The bytes of an image without what pads its rows."""
    data, step = base64.b64decode(image["data"]), image["step"]
    width = image["width"] * bytes_per_pixel
    return b"".join(data[row * step : row * step + width] for row in range(image["height"]))


joints = dict(zip(messages["/joint_states"]["name"], messages["/joint_states"]["position"]))
info = messages["/camera/camera_info"]
k, d = ("K", "D") if version == "1" else ("k", "d")
print(
    json.dumps(
        {
            "translation": position,
            "rotation": rotation,
            "joints": joints,
            "image": pixels(messages["/camera/image_raw"], 3).hex(),
            "depth": pixels(messages["/camera/depth"], 2).hex(),
            "k": info[k],
            "d": info[d],
        }
    )
)
sys.stdout.flush()
client.terminate()
