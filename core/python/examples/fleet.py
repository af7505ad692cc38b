#!/usr/bin/env python3
"""Calibrates every session of a fleet and writes one table: fleet.py SOURCE --out fleet.parquet

    pip install handeye ray fsspec pyarrow pandas       # matplotlib as well, for --chart
    python fleet.py sessions --out fleet.parquet --chart drift.png
    python fleet.py s3://bucket/sessions --out s3://bucket/fleet.parquet      # pip install s3fs; any file system of fsspec

SOURCE has a folder for each robot, and in it one for each session (docs/reference/dataset.md), named so that they sort by time. A
row of the table is a session: robot, session, SHA-256 of its files, the transform, its covariance and expected error, the codes of
its findings, and why it has no answer where it has none. A session whose hash is in the table of an earlier run is not calibrated
again. Ray spreads the work over the processes of this machine, or of the cluster at RAY_ADDRESS.
"""

import argparse
import hashlib
import os
import pathlib
import sys
import tempfile
import time

import fsspec
import numpy as np
import pandas as pd
import ray

# What the workbench writes beside the data. The hash is of what a calibration reads: tables, images, the URDF of an arm.
WRITTEN = ("journal.jsonl", "session.json", "result.json", ".lock", ".rrd")


def sessions_of(source):
    """The file system, and the session folders in it."""
    files, root = fsspec.core.url_to_fs(source)
    return files, sorted(os.path.dirname(path) for path in files.find(root) if os.path.basename(path) == "dataset.toml")


def local_copy(files, folder, to):
    """The session as a local folder, and the hash of what is read of it."""
    digest = hashlib.sha256()
    for path in sorted(files.find(folder)):
        if not path.endswith(WRITTEN):
            data = files.cat_file(path)
            name = os.path.relpath(path, folder)
            digest.update(f"{name}\0{len(data)}\0".encode() + data)
            target = pathlib.Path(to, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
    return digest.hexdigest()


def calibrated(source, folder, known):
    """The row of a session: from its files alone."""
    import handeye

    files, _ = fsspec.core.url_to_fs(source)
    row = {"robot": os.path.basename(os.path.dirname(folder)), "session": os.path.basename(folder)}
    with tempfile.TemporaryDirectory() as here:
        row["sha256"] = local_copy(files, folder, here)
        if row["sha256"] in known:
            return None
        begun = time.monotonic()
        try:
            found = handeye.calibrate_dataset(here)
        except handeye.HandeyeError as error:
            return {**row, "problem": str(error).replace(here, folder)}
    hand_eye = found.document["hand_eye"]
    return {
        **row,
        "problem": None,
        "mode": found.mode,
        "translation_m": hand_eye["translation_m"],
        "rotation_xyzw": hand_eye["rotation_xyzw"],
        "covariance": np.asarray(found.hand_eye_covariance).ravel().tolist(),
        "tip_error_95_mm": found.tip_error_95_mm,
        "reach_error_95_mm": found.reach_error_95_mm,
        "rms_px": found.rms_px,
        "findings": [finding.code for finding in found.findings],
        "handeye": handeye.__version__,
        "seconds": time.monotonic() - begun,
    }


def chart(table, path):
    """How far the camera of each robot is from where its first session had it, with what both sessions state."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(9, 5))
    for robot, rows in table[table["problem"].isna()].sort_values("session").groupby("robot"):
        place = np.array(rows["translation_m"].tolist())
        variance = np.array([np.trace(np.reshape(c, (6, 6))[:3, :3]) for c in rows["covariance"]])
        moved_mm = 1e3 * np.linalg.norm(place - place[0], axis=1)
        stated_mm = 1e3 * 1.96 * np.sqrt((variance + variance[0]) / 3)
        axes.errorbar(range(len(rows)), moved_mm, yerr=stated_mm, capsize=3, marker="o", label=robot)
    axes.set_xlabel("session")
    axes.set_ylabel("distance of the camera from that of the first session, mm")
    axes.legend()
    figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source")
    parser.add_argument("--out", default="fleet.parquet")
    parser.add_argument("--workers", type=int, help="processes; as many as there are processors if not given")
    parser.add_argument("--chart", help="image of each robot's drift")
    asked = parser.parse_args()
    files, root = fsspec.core.url_to_fs(asked.out)
    old = pd.read_parquet(asked.out) if files.exists(root) else pd.DataFrame()
    _, folders = sessions_of(asked.source)
    if not folders:
        sys.exit(f"error: {asked.source} has no folder with a dataset.toml")
    # One thread each: there are as many sessions as anybody needs to be busy.
    ray.init(num_cpus=asked.workers, runtime_env={"env_vars": {"RAYON_NUM_THREADS": "1"}}, log_to_driver=False)
    begun = time.monotonic()
    known = ray.put(frozenset(old["sha256"]) if len(old) else frozenset())
    work = ray.remote(calibrated)
    waiting = [work.remote(asked.source, folder, known) for folder in folders]
    rows = []
    while waiting:
        done, waiting = ray.wait(waiting, num_returns=min(len(waiting), 50), timeout=5.0)
        rows += [row for row in ray.get(done) if row is not None]
        print(f"\r{len(folders) - len(waiting)} of {len(folders)}", end="", file=sys.stderr, flush=True)
    seconds = time.monotonic() - begun
    table = pd.concat([old, pd.DataFrame(rows)], ignore_index=True) if len(old) else pd.DataFrame(rows)
    table.to_parquet(asked.out)
    failed = [row for row in rows if row["problem"] is not None]
    print(f"\n{len(rows)} sessions in {seconds:.1f} s, {len(rows) / seconds:.1f} a second; {len(failed)} without an answer")
    for row in failed[:10]:
        print(f"  {row['robot']}/{row['session']}: {row['problem']}")
    if asked.chart:
        chart(table, asked.chart)


if __name__ == "__main__":
    main()
