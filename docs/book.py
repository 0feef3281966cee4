"""The documentation as a site: docs/ and the README, by mdBook, with search. Every link of the pages made is checked.

Usage: book.py MDBOOK OUTPUT. In the sources, links lead through the repository, as on a forge. A file outside docs/ that a page links to is
copied beside the pages, so that the site needs no forge. The notebooks are pages as they run, and so is the reference of the Python package:
it runs in the environment of python/environment.sh."""

import html.parser
import pathlib
import posixpath
import re
import shutil
import subprocess
import sys
import urllib.parse

# Or its compiled form would be a file of docs/.
sys.dont_write_bytecode = True
import python_pages

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent
LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
# Pages of the site that stand beside docs/ in the repository. mdBook would make a README.md to index.html and let links to it lead to README.html.
TOP = {"README.md": "index.md", "CONTRIBUTING.md": "CONTRIBUTING.md", "CHANGELOG.md": "CHANGELOG.md", "SECURITY.md": "SECURITY.md"}


# Notebooks that are pages.
NOTEBOOKS = {ROOT / "python" / "examples" / f"{name}.ipynb": name for name in ("by_hand", "over_temperature")}


def main(mdbook, output):
    output = pathlib.Path(output).resolve()
    source = output.with_name(output.name + "-source")
    for folder in (output, source):
        shutil.rmtree(folder, ignore_errors=True)
    pages = {ROOT / name: source / "src" / page for name, page in TOP.items()}
    for path in HERE.rglob("*"):
        if path.is_file() and path.suffix != ".py":
            pages[path] = source / "src" / path.relative_to(HERE)
    for origin, name in NOTEBOOKS.items():
        pages[origin] = source / "src" / "notebooks" / f"{name}.md"
    for origin, page in pages.items():
        page.parent.mkdir(parents=True, exist_ok=True)
        if page.suffix == ".md":
            text = python_pages.notebook(NOTEBOOKS[origin]) if origin in NOTEBOOKS else origin.read_text()
            page.write_text(rewritten(text, origin, page, pages, source / "src"))
        else:
            shutil.copy(origin, page)
    (source / "src" / "python-reference.md").write_text(python_pages.reference())
    (source / "book.toml").write_text(
        '[book]\ntitle = "mimu"\nlanguage = "en"\nsrc = "src"\n'
        f'[build]\nbuild-dir = "{output}"\ncreate-missing = false\n'
        "[output.html]\nno-section-label = true\nadditional-css = [\"wide.css\"]\n[output.html.print]\nenable = false\n"
    )
    # What the command prints has lines of up to 110 characters, of which mdBook's 750 pixels show 90.
    (source / "wide.css").write_text(":root { --content-max-width: 920px }\n")
    subprocess.run([mdbook, "build", str(source)], check=True)
    shutil.rmtree(source)
    broken = links_without_target(output)
    for line in broken:
        print(line, file=sys.stderr)
    number = len(list(output.rglob("*.html")))
    print(f"{output}/index.html: {number} pages, {len(broken)} broken links")
    return bool(broken)


def rewritten(text, origin, page, pages, src):
    """The `text` of `origin` with links that lead from where it will stand."""

    def link(found):
        target = urllib.parse.unquote(found[2])
        if re.match(r"[a-z]+:", target):
            return found[0]
        path = (origin.parent / target).resolve()
        if path.is_dir():
            path = next((p for p in (path / "README.md", path / "Cargo.toml") if p.is_file()), path)
        if path not in pages:
            if path == HERE / "python-reference.md":
                return found[1] + posixpath.relpath(src / path.name, page.parent) + found[3]
            if not path.is_file():
                sys.exit(f"{origin.relative_to(ROOT)}: the link {target} leads nowhere")
            # As text: a browser shows no Rust and downloads it.
            copy = src / "source" / (str(path.relative_to(ROOT)) + ".txt")
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, copy)
            return found[1] + posixpath.relpath(copy, page.parent) + ")"
        return found[1] + posixpath.relpath(pages[path], page.parent) + found[3]

    return LINK.sub(link, text)


class Page(html.parser.HTMLParser):
    """What a page links to, and what can be linked to in it."""

    def __init__(self, text):
        super().__init__()
        self.targets, self.anchors = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("href", "src") and value:
                self.targets.append(value)
            elif name in ("id", "name") and value:
                self.anchors.add(value)


def links_without_target(site):
    pages = {path: Page(path.read_text()) for path in site.rglob("*.html")}
    broken = []
    for path, page in pages.items():
        # Its links are absolute, for wherever a server has it.
        if path.name == "404.html":
            continue
        for target in page.targets:
            parts = urllib.parse.urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            to = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            if to.is_dir():
                to /= "index.html"
            fragment = urllib.parse.unquote(parts.fragment)
            if not to.is_file() or (fragment and to in pages and fragment not in pages[to].anchors):
                broken.append(f"{path.relative_to(site)}: {target}")
    return broken


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
