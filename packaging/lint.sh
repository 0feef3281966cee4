#!/usr/bin/env bash
# Checks what no test runs: workflows, forms of issues, the citation, the image's file, shell scripts, the recipe of conda, the formula of Homebrew, the
# paper. Linters that are not Python packages (actionlint, ruby) are used if they are there.
set -euo pipefail
cd "$(dirname "$0")/.."
tools=${CARGO_TARGET_DIR:-target}/lint
packaging/environment.sh packaging/lint.txt "$tools"
PATH=$(realpath "$tools")/bin:$PATH

check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
check-jsonschema --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/{wrong-result,log-or-export}.yml
check-jsonschema --builtin-schema vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
check-jsonschema --builtin-schema vendor.dependabot .github/dependabot.yml
zizmor --offline --quiet .github
if command -v actionlint >/dev/null; then actionlint; else echo "skipped: actionlint"; fi
# `then` is a file in tests/station.
shellcheck -S warning -e SC1010 .ci/run ./*/*.sh ./*/*/*.sh
hadolint packaging/Dockerfile
check-jsonschema --builtin-schema vendor.citation-file-format CITATION.cff
if command -v ruby >/dev/null; then ruby -c packaging/mimu.rb; else echo "skipped: ruby -c packaging/mimu.rb"; fi
python - <<'PYTHON'
import re, sys, pathlib, pypandoc, rattler_build

version = re.search(r'^version = "(.*)"', pathlib.Path("Cargo.toml").read_text(), re.M)[1]
recipe = rattler_build.Stage0Recipe.from_file("packaging/recipe.yaml").render(rattler_build.VariantConfig())[0].recipe
if recipe.package.version != version or f"\nversion: {version}\n" not in pathlib.Path("CITATION.cff").read_text():
    sys.exit(f"recipe.yaml and CITATION.cff have to have the version of Cargo.toml, {version}")
# The form of the Journal of Open Source Software: sections, length, a bibliography in which every citation is found.
text = pathlib.Path("paper/paper.md").read_text()
plain = pypandoc.convert_text(text, "plain", format="markdown", extra_args=["--citeproc", "--bibliography=paper/paper.bib"])
missing = [s for s in ("Summary", "Statement of need", "References") if f"# {s}" not in text] + re.findall(r"\w+\?\)", plain)
missing += [f for f in re.findall(r"!\[.*?\]\(([^)]*)\)", text) if not pathlib.Path("paper", f).is_file()]
words = len(re.sub(r"^---.*?^---", "", text, flags=re.M | re.S).split())
if missing or not 750 <= words <= 1750:
    sys.exit(f"paper/paper.md: {words} words; missing: {missing}")
print(f"recipe, citation and paper ({words} words) are as they should be")
PYTHON
