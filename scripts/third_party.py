#!/usr/bin/env python3
"""Prints the licences of the crates in a program: scripts/third_party.py PACKAGE

What stands in the program itself counts, not what built it. Texts that several crates share are printed once.
"""

import json
import pathlib
import subprocess
import sys

TRIPLE = "x86_64-unknown-linux-gnu"
NAMES = ("licen", "copying", "notice", "copyright", "unlicense")


def packages_in(program):
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", TRIPLE]
    metadata = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    by_id = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    left = [identifier for identifier, package in by_id.items() if package["name"] == program]
    seen = set()
    while left:
        identifier = left.pop()
        if identifier in seen:
            continue
        seen.add(identifier)
        normal = (dep["pkg"] for dep in nodes[identifier]["deps"] if any(kind["kind"] is None for kind in dep["dep_kinds"]))
        left.extend(normal)
    found = (by_id[identifier] for identifier in seen)
    return sorted((package for package in found if package["source"]), key=lambda package: (package["name"], package["version"]))


def texts_of(package):
    folder = pathlib.Path(package["manifest_path"]).parent
    for path in sorted(folder.iterdir()):
        if path.is_file() and path.name.lower().startswith(NAMES):
            yield path.read_text(encoding="utf-8", errors="replace").strip()


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    packages = packages_in(sys.argv[1])
    if not packages:
        sys.exit(f"error: there is no package {sys.argv[1]}")
    users = {}
    for package in packages:
        for text in texts_of(package):
            users.setdefault(text, []).append(f"{package['name']} {package['version']}")
    for package in packages:
        print(f"{package['name']} {package['version']}: {package['license'] or 'see below'}")
    for text, names in users.items():
        print(f"\n{'=' * 80}\n{', '.join(names)}\n\n{text}")


if __name__ == "__main__":
    main()
