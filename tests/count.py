"""`make count`: how large the tree is. Lines by crate and kind, public items, long functions, and files that an addition touches."""

import re
import sys
from pathlib import Path

# Another checkout may be given, to compare.
ROOT = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent.parent
CRATES = ["core", "firmware", *sorted(f"host/{p.parent.name}" for p in ROOT.glob("host/*/Cargo.toml")), "python", "web", "rig", "rig/board", "tests"]
LONG = 100
PUBLIC = re.compile(r"^\s*pub (?:const fn|async fn|unsafe fn|fn|struct|enum|trait|type|const|static|union|macro)\b")


def sources(crate):
    """Rust files of a crate without those of crates below it, each with whether it belongs to the tests."""
    folder = ROOT / crate
    below = [p.parent for p in folder.glob("*/Cargo.toml")]
    for path in sorted(folder.rglob("*.rs")):
        if "target" in path.parts or any(b in path.parents for b in below):
            continue
        inner = path.relative_to(folder).parts
        yield path, inner[0] in ("tests", "benches", "examples", "fuzz") or inner[-1] == "tests.rs" or "tests" in inner


def parts(text, tests):
    """Numbers of lines: code, documentation and comments, unit tests, tests. A unit test module begins at `#[cfg(test)]` and ends the file."""
    count = dict.fromkeys(("code", "comments", "unit tests", "tests"), 0)
    unit = False
    lines = text.split("\n")
    for k, line in enumerate(lines):
        line = line.strip()
        unit |= line == "#[cfg(test)]" and any("mod tests {" in later for later in lines[k + 1 : k + 4])
        if not line:
            continue
        kind = "tests" if tests else "unit tests" if unit else "comments" if line.startswith("//") else "code"
        count[kind] += 1
    return count


def functions(text):
    """Names and lengths of functions in a formatted file: from `fn` to the brace at the same indentation."""
    lines = text.split("\n")
    for k, line in enumerate(lines):
        found = re.match(r"^(\s*)(?:pub(?:\([a-z: ]+\))? )?(?:const |async |unsafe )*fn (\w+)", line)
        if found and not line.rstrip().endswith(";"):
            end = next((j for j in range(k, len(lines)) if lines[j].rstrip() == found[1] + "}"), k)
            yield found[2], end - k + 1


def main():
    kinds = ("code", "comments", "unit tests", "tests")
    total = dict.fromkeys((*kinds, "public"), 0)
    long = []
    print(f"{'':<18}" + "".join(f"{k:>12}" for k in (*kinds, "public items")))
    for crate in CRATES:
        count = dict.fromkeys((*kinds, "public"), 0)
        for path, tests in sources(crate):
            text = path.read_text()
            for kind, lines in parts(text, tests or crate == "tests").items():
                count[kind] += lines
            if tests or crate == "tests":
                continue
            product = text.split("#[cfg(test)]\nmod tests {")[0]
            count["public"] += sum(bool(PUBLIC.match(line)) for line in product.split("\n"))
            long += [(n, path.relative_to(ROOT), name) for name, n in functions(product) if n > LONG]
        for key, value in count.items():
            total[key] += value
        print(f"{crate:<18}" + "".join(f"{v:>12}" for v in count.values()))
    print(f"{'all':<18}" + "".join(f"{v:>12}" for v in total.values()))

    print(f"\nfunctions of more than {LONG} lines: {len(long)}")
    for lines, path, name in sorted(long, reverse=True):
        print(f"  {lines:>4}  {path}: {name}")

    print("\nsteps of an addition, by CONTRIBUTING.md")
    for section in (ROOT / "CONTRIBUTING.md").read_text().split("\n## ")[1:]:
        title, _, body = section.partition("\n")
        steps = len(re.findall(r"^\d+\. ", body, re.M))
        if title.startswith("Add ") and steps:
            print(f"  {steps:>4}  {title}")

    print("\nwords of documents of more than 2500, and of the README")
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        words = len(path.read_text().split())
        if words > 2500 or path.name == "README.md":
            print(f"  {words:>5}  {path.relative_to(ROOT)}")


main()
