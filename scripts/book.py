#!/usr/bin/env python3
"""Makes the documents a book, with mdBook: scripts/book.py [--out FOLDER]   (target/book)

Its chapters are the pages that docs/README.md lists, in that order. Folders are those of the repository, and what pages link to
comes with them, so that links hold as they are; the test `documents` checks them, and that every page is listed.
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent
INDEX = pathlib.Path("docs/README.md")
LINK = re.compile(r"\[((?:[^\[\]]|`[^`]*`)+)\]\(([^)#\s]+)(#[^)\s]*)?\)")
SETTINGS = """[book]
title = "Handeye Workbench"
language = "en"
src = "src"

[output.html]
no-section-label = true

[output.html.fold]
enable = true
"""


def links(page):
    """Targets of the links of a page to files, outside of code."""
    text = re.sub(r"^```.*?^```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    for _, target, _ in LINK.findall(text):
        if "://" not in target:
            yield target


def title(page):
    return (ROOT / page).read_text(encoding="utf-8").split("\n", 1)[0].lstrip("# ").replace("`", "")


def within(page, target):
    """A link of a page as a path of the repository."""
    return pathlib.Path((ROOT / page.parent / target).resolve()).relative_to(ROOT)


def summary():
    """The table of contents, and its pages."""
    lines, pages = ["# Summary", "", "[Handeye Workbench](README.md)", f"[Documents]({INDEX})"], [pathlib.Path("README.md"), INDEX]
    for part in re.split(r"^## ", (ROOT / INDEX).read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        lines += ["", f"# {part.splitlines()[0]}", ""]
        for _, target, _ in LINK.findall(part):
            page = within(INDEX, target)
            if page.suffix == ".md" and page not in pages:
                pages.append(page)
                lines.append(f"- [{title(page)}]({page})")
                # Pages that only a page of this part lists: decisions, translations.
                for below in links(page):
                    child = within(page, below)
                    is_below = child.parent == page.parent / "zh-CN" or page.parent.name == "decisions" == child.parent.name
                    if child.suffix == ".md" and is_below and child not in pages:
                        pages.append(child)
                        lines.append(f"  - [{title(child)}]({child})")
    lines += ["", "# More", ""]
    # What these pages refer to besides, such as the style of the code, and what that refers to.
    for page in pages:
        for below in links(page):
            child = within(page, below)
            if child.suffix == ".md" and child not in pages:
                pages.append(child)
                lines.append(f"- [{title(child)}]({child})")
    return "\n".join(lines) + "\n", pages


def assembled(source, pages):
    """Copies the pages and what they link to; mdBook has the page README.md of a folder as index.md."""
    named = lambda path: path.with_name("index.md") if path.name == "README.md" else path
    shutil.rmtree(source, ignore_errors=True)
    for path in sorted(set(pages).union(within(page, target) for page in pages for target in links(page))):
        to = source / named(path)
        to.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            text = (ROOT / path).read_text(encoding="utf-8")
            to.write_text(re.sub(r"(\]\([^)\s]*?)README\.md", r"\1index.md", text), encoding="utf-8")
        elif (ROOT / path).is_dir():
            shutil.copytree(ROOT / path, to, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.md", "__pycache__"))
        else:
            shutil.copy(ROOT / path, to)
    shutil.copytree(ROOT / "docs" / "images", source / "docs" / "images", dirs_exist_ok=True)


def dead_links(out):
    """Links of the made pages that lead nowhere."""
    for page in sorted(out.rglob("*.html")):
        content = page.read_text(encoding="utf-8").partition("<main>")[2].partition("</main>")[0]
        for target in re.findall(r'(?:href|src)="([^"#]+)', content):
            path = page.parent / urllib.parse.unquote(target)
            if "://" not in target and not target.startswith("mailto:") and not path.exists() and page.name != "print.html":
                yield f"{page.relative_to(out)}: {target}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "target" / "book")
    out = parser.parse_args().out.resolve()
    contents, pages = summary()
    work = out.with_name(out.name + "-source")
    assembled(work / "src", pages)
    (work / "book.toml").write_text(SETTINGS)
    (work / "src" / "SUMMARY.md").write_text(contents.replace("README.md)", "index.md)"), encoding="utf-8")
    mdbook = shutil.which("mdbook") or sys.exit("error: mdbook is not there: cargo install --locked mdbook@0.5.4")
    subprocess.run([mdbook, "build", "--dest-dir", str(out), str(work)], check=True)
    dead = list(dead_links(out))
    if dead:
        sys.exit("error: links that lead nowhere:\n  " + "\n  ".join(dead))
    print(f"{len(pages)} pages in {out / 'index.html'}")


if __name__ == "__main__":
    main()
