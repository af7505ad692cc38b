"""The workbench beside the viewer that it replaces, on the same cell, on the same screen, in one run.

    pip install coppeliasim-zmqremoteapi-client==2.0.4 numpy opencv-python-headless matplotlib websockets
    python viewers.py HANDEYE [SECONDS]

HANDEYE is the release binary. Needs Xvfb. The viewer, the window and `handeye serve` with one page run one after the other
on one cell that the script starts; each is warmed up first. Prints images per second and processor time per image of all,
and their ratios. The workbench also looks for the board in every image and draws its whole window; the line "same work"
counts only the threads that fetch, convert and draw. The page is this script, which says at once that a frame is shown.
"""

import asyncio
import json
import os
import re
import subprocess
import sys
import tempfile
import time

import websockets
from coppeliasim_zmqremoteapi_client import RemoteAPIClient

HERE = os.path.dirname(os.path.abspath(__file__))
WARM_UP = 6.0
TICK = os.sysconf('SC_CLK_TCK')
# The window, the camera worker, and the threads of the software rasteriser.
SAME_WORK = re.compile(r'^(handeye|camera|llvmpipe.*|.*gallium.*|.*:disk.*)$')


def processor_seconds(pid):
    """By thread name."""
    seconds = {}
    for task in os.listdir(f'/proc/{pid}/task'):
        try:
            text = open(f'/proc/{pid}/task/{task}/stat').read()
        except FileNotFoundError:
            continue
        name = text[text.index('(') + 1:text.rindex(')')]
        fields = text[text.rindex(')') + 2:].split()
        seconds[name] = seconds.get(name, 0.0) + (int(fields[11]) + int(fields[12])) / TICK
    return seconds


def workbench(binary, port, seconds, environment):
    with tempfile.TemporaryDirectory() as home, open(os.path.join(home, 'log'), 'w+') as log:
        environment = dict(environment, HOME=home, XDG_CONFIG_HOME=home, XDG_DATA_HOME=home,
                           RUST_LOG='handeye_app::live::textures=trace', LIBGL_ALWAYS_SOFTWARE='1')
        window = subprocess.Popen([binary, 'gui', '--connect', f'tcp://127.0.0.1:{port}'], env=environment, stderr=log)
        try:
            time.sleep(WARM_UP)
            count = lambda: open(log.name).read().count('image shown')
            shown, before, began = count(), processor_seconds(window.pid), time.monotonic()
            time.sleep(seconds)
            shown, after, took = count() - shown, processor_seconds(window.pid), time.monotonic() - began
        finally:
            window.kill()
            window.wait()
        spent = {name: after[name] - before.get(name, 0.0) for name in after}
        same = sum(value for name, value in spent.items() if SAME_WORK.match(name))
        return {'images': shown, 'seconds': took, 'cpu_seconds': sum(spent.values()), 'same_work_seconds': same,
                'threads': {name: round(value, 2) for name, value in sorted(spent.items()) if value > 0.05}}


async def page(address, seconds, pid):
    origin = f'http://{address}'
    async with websockets.connect(f'ws://{address}/socket?page=bench', origin=origin, max_size=None) as socket:
        await socket.send(json.dumps({'t': 'screen', 'width': 1440.0, 'height': 900.0, 'scale': 1.0}))
        images, start = 0, time.monotonic()
        began = before = None
        while True:
            frame = await socket.recv()
            if isinstance(frame, str):
                continue
            head = json.loads(frame[4:4 + int.from_bytes(frame[:4], 'little')])
            await socket.send(json.dumps({'t': 'shown', 'number': head['number']}))
            now = time.monotonic()
            if began is None and now - start > WARM_UP:
                images, began, before = 0, now, processor_seconds(pid)
            images += any(texture['jpeg'] for texture in head['textures'])
            if began is not None and now - began > seconds:
                spent = sum(processor_seconds(pid).values()) - sum(before.values())
                return {'images': images, 'seconds': now - began, 'cpu_seconds': spent}


def served(binary, port, seconds):
    with tempfile.TemporaryDirectory() as home:
        environment = dict(os.environ, HOME=home, XDG_CONFIG_HOME=home, XDG_DATA_HOME=home)
        command = [binary, 'serve', '--quiet', '--rerun', 'off', '--port', '0', '--connect', f'tcp://127.0.0.1:{port}']
        server = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        try:
            address = server.stdout.readline().strip().rsplit('//', 1)[1].rstrip('/')
            return asyncio.run(page(address, seconds, server.pid))
        finally:
            server.kill()
            server.wait()


def main():
    binary = os.path.abspath(sys.argv[1])
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 30.0
    screen = subprocess.Popen(['Xvfb', '-displayfd', '1', '-screen', '0', '1440x900x24', '-nolisten', 'tcp'],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    environment = dict(os.environ, DISPLAY=':' + screen.stdout.readline().strip())
    cell = subprocess.Popen([binary, 'cell', '--quiet', '--port', '0'], stdout=subprocess.PIPE, text=True)
    try:
        port = int(cell.stdout.readline().strip().rsplit(':', 1)[1])
        viewer = [sys.executable, os.path.join(HERE, 'reference_viewer.py'), str(port)]
        subprocess.run(viewer + ['2'], env=environment, stdout=subprocess.DEVNULL, check=True)
        reference = json.loads(subprocess.run(viewer + [str(seconds)], env=environment, stdout=subprocess.PIPE,
                                              text=True, check=True).stdout)
        # Images come while the simulation runs.
        RemoteAPIClient('127.0.0.1', port).require('sim').startSimulation()
        ours = workbench(binary, port, seconds, environment)
        in_browser = served(binary, port, seconds)
    finally:
        cell.kill()
        screen.kill()
    rate = lambda run: run['images'] / run['seconds']
    cost = lambda run, key='cpu_seconds': 1e3 * run[key] / max(run['images'], 1)
    print(f'{"":<28}{"images/s":>12}{"processor ms/image":>24}')
    print(f'{"reference viewer":<28}{rate(reference):>12.2f}{cost(reference):>24.1f}')
    print(f'{"workbench, everything":<28}{rate(ours):>12.2f}{cost(ours):>24.1f}')
    print(f'{"workbench in a browser":<28}{rate(in_browser):>12.2f}{cost(in_browser):>24.1f}')
    print(f'{"workbench, same work":<28}{"":>12}{cost(ours, "same_work_seconds"):>24.1f}')
    print(f'rate: {rate(ours) / rate(reference):.1f} times; processor time per image: '
          f'1/{cost(reference) / cost(ours):.1f} of it for everything, '
          f'1/{cost(reference) / cost(ours, "same_work_seconds"):.1f} for the same work, '
          f'1/{cost(reference) / cost(in_browser):.1f} in a browser')
    print('threads of the workbench, seconds:', ours['threads'])


if __name__ == '__main__':
    main()
