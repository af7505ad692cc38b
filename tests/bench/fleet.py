#!/usr/bin/env python3
"""How many sessions a second the example of a fleet calibrates, with one process and with two.

    python tests/bench/fleet.py [SESSIONS]      (1000; needs what core/python/examples/fleet.py needs)

Sessions of ten robots are drawn: twenty views of corners each, one robot's camera moves by 1 mm half way, and one session of every
hundred has the poses of another, which has no answer that fits or says so.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import pandas as pd

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests" / "python"))
import simulated  # noqa: E402

EXAMPLE = ROOT / "core" / "python" / "examples" / "fleet.py"


def draw(folder, count):
    rng = np.random.default_rng(1)
    before = None
    for i in range(count):
        session = simulated.session(rng, 20, 0.1, 0.05, 0.01)
        if i % 10 == 3 and i >= count // 2:
            # Moved on the tip: the robot would have to be elsewhere for the same images.
            moved = simulated.pose([0, 0, 0], [1e-3, 0, 0])
            session.base_from_tip = session.base_from_tip @ simulated.TIP_FROM_CAMERA @ simulated.inverse(moved) @ simulated.inverse(
                simulated.TIP_FROM_CAMERA)
        if i % 100 == 99:
            session.base_from_tip, before = before, session.base_from_tip
        else:
            before = session.base_from_tip
        simulated.write_folder(os.path.join(folder, f"robot{i % 10}", f"{i // 10:03}"), session)


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    with tempfile.TemporaryDirectory() as folder:
        sessions = os.path.join(folder, "sessions")
        draw(sessions, count)
        for workers in (1, 2):
            out = os.path.join(folder, f"{workers}.parquet")
            begun = time.monotonic()
            command = [sys.executable, str(EXAMPLE), sessions, "--out", out, "--workers", str(workers)]
            subprocess.run([*command, "--chart", os.path.join(folder, "drift.png")], check=True, stderr=subprocess.DEVNULL)
            print(f"{workers} workers: {time.monotonic() - begun:.1f} s with starting and drawing")
        table = pd.read_parquet(out)
        moved = table[(table["robot"] == "robot3") & table["problem"].isna()].sort_values("session")
        place = np.array(moved["translation_m"].tolist())
        half = len(place) // 2
        print(f"robot3 moved by {1e3 * np.linalg.norm(place[half:].mean(0) - place[:half].mean(0)):.3f} mm (drawn: 1)")
        codes = table["findings"].dropna().explode().value_counts()
        print(f"{int(table['problem'].notna().sum())} without an answer; findings: {dict(codes)}")


if __name__ == "__main__":
    main()
