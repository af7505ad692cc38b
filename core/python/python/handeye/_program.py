"""The program `handeye`, which searches images: it comes with the wheel of a release, or is installed for itself."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import sys
from typing import Optional

from ._errors import CalibrationError, InputError


PACKAGED = pathlib.Path(__file__).with_name("_binary") / "handeye"


def find() -> Optional[str]:
    """Where it is; None where it is not installed."""
    return str(PACKAGED) if PACKAGED.exists() else shutil.which("handeye")


def calibrated(program: str, folder: str, method: str) -> str:
    """The result document of a dataset folder by `handeye calibrate`."""
    command = [program, "calibrate", folder, "--json", "-", "--quiet", "--method", method]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if done.returncode != 0:
        words = done.stderr.decode(errors="replace").strip()
        kind = InputError if done.returncode == 2 else CalibrationError
        raise kind(words[len("error: "):] if words.startswith("error: ") else words or f"{program} ended with {done.returncode}")
    return done.stdout.decode()


def main() -> None:
    """The console script `handeye` of a wheel with the program."""
    os.execv(PACKAGED, [str(PACKAGED), *sys.argv[1:]])
