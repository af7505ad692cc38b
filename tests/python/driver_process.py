"""The workbench's end of a driver, for tests that run one as the workbench does."""

import json
import os
import queue
import subprocess
import tempfile
import threading
import time

# Longer than any driver waits by itself.
PATIENCE_S = 20.0


class Ended(Exception):
    """What the driver ended with, or did not send."""


class Talk:
    """A driver's process, in a folder of its own: `written` is what it has left there."""

    def __init__(self, command, environment=None):
        self.errors = tempfile.TemporaryFile()
        self.folder = tempfile.TemporaryDirectory()
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            cwd=self.folder.name,
            env={**os.environ, **(environment or {})},
        )
        self.messages, self.logs, self.count = queue.Queue(), [], 0
        threading.Thread(target=self.read, daemon=True).start()
        self.say(type="hello", protocol=1, workbench="test")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.written = os.listdir(self.folder.name)
        self.folder.cleanup()

    def say(self, **message):
        self.process.stdin.write(json.dumps(message).encode() + b"\n")
        self.process.stdin.flush()

    def read(self):
        while line := self.process.stdout.readline():
            message = json.loads(line)
            self.messages.put((message, self.process.stdout.read(message.get("bytes", 0))))
        self.messages.put(None)

    def wait(self, kind, pick=lambda message: True):
        """The next message of a kind, and its bytes. Others are skipped, but for the driver's end."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                found = self.messages.get(timeout=max(deadline - time.monotonic(), 0.01))
            except queue.Empty:
                raise Ended(f"no {kind} that was waited for within {PATIENCE_S} s: {self.said()[-2000:]}") from None
            if found is None:
                raise Ended(self.said()[-3000:])
            message, data = found
            if message["type"] == "log":
                self.logs.append(message["text"])
            if message["type"] == "error" and kind != "error":
                raise Ended(message["text"])
            if message["type"] == kind and pick(message):
                return message, data

    def said(self):
        """What the driver has logged: before its `hello` on standard error."""
        self.errors.seek(0)
        return "\n".join([*self.logs, self.errors.read().decode(errors="replace")])

    def hello(self):
        return self.wait("hello")[0]

    def state(self, pick=lambda message: True):
        return self.wait("state", pick)[0]

    def log(self, part):
        return self.wait("log", lambda message: part in message["text"])[0]

    def image(self, depth=False, after=None):
        """An image with its bytes, and its depth with its bytes."""
        self.count += 1
        self.say(type="next_image", id=self.count, after=after, depth=depth)
        image = self.wait("image")
        assert image[0]["id"] == self.count, image[0]
        return image, self.wait("depth") if depth else None

    def error(self):
        text = self.wait("error")[0]["text"]
        assert self.process.wait(PATIENCE_S) == 1
        return text

    def bye(self):
        self.say(type="bye")
        assert self.process.wait(PATIENCE_S) == 0

    def refuses_to_move(self):
        self.say(type="arm", id=7, on=True)
        assert self.wait("refused")[0]["id"] == 7
        self.say(type="move", id=8, speed=0.1, joints_rad=[0.0])
        assert self.wait("refused")[0]["id"] == 8
