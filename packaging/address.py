"""Writes the public address of the repository into everything that publishes it. No file of the repository has an address before: a fork has another.

Usage: address.py ADDRESS, as in address.py https://forge.example/owner/mimu. `address.py --show` prints the one that Cargo.toml has, or fails."""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def published() -> list[pathlib.Path]:
    """Manifests of the crates that the Makefile publishes."""
    names = re.search(r"^PUBLISHED := (.*)$", (ROOT / "Makefile").read_text(), re.M)[1].split()
    manifests = [*ROOT.glob("core/Cargo.toml"), *ROOT.glob("host/*/Cargo.toml")]
    return [m for m in manifests if re.search(r'^name = "(.*)"$', m.read_text(), re.M)[1] in names]


def insert(path: pathlib.Path, line: str, key: str, after: str) -> None:
    """`line` in place of the line that begins with `key`, or else below the line that begins with `after`."""
    lines = path.read_text().split("\n")
    at = next((k for k, old in enumerate(lines) if old.startswith(key)), None)
    if at is None:
        at = next(k for k, old in enumerate(lines) if old.startswith(after)) + 1
        lines.insert(at, line)
    lines[at] = line
    path.write_text("\n".join(lines))


def main(address: str) -> None:
    manifest = ROOT / "Cargo.toml"
    if address == "--show":
        found = re.search(r'^repository = "(.*)"$', manifest.read_text(), re.M)
        sys.exit("Cargo.toml has no address: packaging/address.py ADDRESS writes it") if found is None else print(found[1])
        return
    if not re.fullmatch(r"https://[\w.-]+(/[\w.-]+)+", address):
        sys.exit(f"{address}: not the https address of a repository")
    insert(manifest, f'homepage = "{address}"', "homepage = ", "license = ")
    insert(manifest, f'repository = "{address}"', "repository = ", "license = ")
    for crate in published():
        for key in ("homepage", "repository"):
            insert(crate, f"{key}.workspace = true", f"{key}.workspace", "license.workspace")
    project = ROOT / "python" / "pyproject.toml"
    for name, path in (("Changelog", "/blob/main/CHANGELOG.md"), ("Issues", "/issues"), ("Repository", "")):
        insert(project, f'{name} = "{address}{path}"', f"{name} = ", "[project.urls]")
    insert(ROOT / "CITATION.cff", f"repository-code: {address}", "repository-code:", "version:")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
