#!/usr/bin/env python3
"""Puts the program into a wheel of the module: scripts/wheel_with_program.py WHEEL PROGRAM_FOLDER OUT_FOLDER

The console script `handeye` starts it. Times are SOURCE_DATE_EPOCH.
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile

ENTRY = "[console_scripts]\nhandeye = handeye._program:main\n"


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    module, program, out = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        run("unpack", "--dest", folder, module)
        (unpacked,) = pathlib.Path(folder).iterdir()
        package = unpacked / "handeye"
        shutil.copytree(program, package / "_binary")
        (information,) = unpacked.glob("*.dist-info")
        (information / "entry_points.txt").write_text(ENTRY)
        run("pack", "--dest-dir", out, unpacked)


def run(*arguments):
    subprocess.run([sys.executable, "-m", "wheel", *map(str, arguments)], check=True, stdout=sys.stderr)


if __name__ == "__main__":
    main()
