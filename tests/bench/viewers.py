"""The workbench beside the viewer that it replaces, on the same cell, on the same screen, in one run.

    pip install coppeliasim-zmqremoteapi-client==2.0.4 numpy opencv-python-headless matplotlib
    python viewers.py HANDEYE [SECONDS]

HANDEYE is the release binary. Needs Xvfb. The two run one after the other on one cell that the script starts; each is
warmed up first. Prints images per second and processor time per image of both, and their ratios. The workbench also
looks for the board in every image and draws its whole window; the line "same work" counts only the threads that
fetch, convert and draw.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time

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
                           RUST_LOG='handeye_app::gui::textures=trace', LIBGL_ALWAYS_SOFTWARE='1')
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
        ours = workbench(binary, port, seconds, environment)
    finally:
        cell.kill()
        screen.kill()
    rate = lambda run: run['images'] / run['seconds']
    cost = lambda run, key='cpu_seconds': 1e3 * run[key] / max(run['images'], 1)
    print(f'{"":<28}{"images/s":>12}{"processor ms/image":>24}')
    print(f'{"reference viewer":<28}{rate(reference):>12.2f}{cost(reference):>24.1f}')
    print(f'{"workbench, everything":<28}{rate(ours):>12.2f}{cost(ours):>24.1f}')
    print(f'{"workbench, same work":<28}{"":>12}{cost(ours, "same_work_seconds"):>24.1f}')
    print(f'rate: {rate(ours) / rate(reference):.1f} times; processor time per image: '
          f'1/{cost(reference) / cost(ours):.1f} of it for everything, '
          f'1/{cost(reference) / cost(ours, "same_work_seconds"):.1f} for the same work')
    print('threads of the workbench, seconds:', ours['threads'])


if __name__ == '__main__':
    main()
