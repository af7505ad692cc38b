"""Runs the Python of a documentation page, block after block as one program, where the page says that it is run.

    python run_page.py HANDEYE PAGE FOLDER

HANDEYE is the binary, FOLDER an empty one: the session that the page begins with is made there. What the page shows as printed,
in a block of text behind one of Python, has to be printed, but for the digits of numbers.
"""

import contextlib
import io
import os
import re
import subprocess
import sys

MAKE = "handeye auto --poses seed10 --out my_session"


def blocks(text):
    """Language and content of the fenced blocks, with the line that each begins at."""
    found = re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [(m.group(1), m.group(2), text.count("\n", 0, m.start()) + 1) for m in found]


def without_digits(text):
    return re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "#", " ".join(text.split()))


def main():
    binary, page, folder = (os.path.abspath(argument) for argument in sys.argv[1:])
    with open(page, encoding="utf-8") as file:
        text = file.read()
    assert MAKE in text, f"the page begins with another session than {MAKE!r}"
    os.chdir(folder)
    subprocess.run([binary, *MAKE.split()[1:], "--quiet"], check=True, stdout=subprocess.DEVNULL)
    names, printed, ran = {"__name__": "page"}, "", 0
    for language, content, line in blocks(text):
        if language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile("\n" * line + content, page, "exec"), names)
            printed, ran = out.getvalue(), ran + 1
        elif language == "text":
            assert without_digits(content) in without_digits(printed), f"line {line}: the page shows\n{content}\nand it is\n{printed}"
    assert ran > 3, f"{ran} blocks of Python"
    print(f"{ran} blocks of {os.path.basename(page)}")


if __name__ == "__main__":
    main()
