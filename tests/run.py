"""Runs the tests of all crates, several executables at a time: those that wait for a board or a person leave the processor to those that compute.

Usage: run.py CARGO ARGUMENT...: what `cargo test` is called with. `cargo test` itself runs one executable after the other.
"""

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed

# More than two cores: most of the command's and the board's tests wait.
AT_A_TIME = 3


def executables(cargo: list[str]) -> list[tuple[str, str]]:
    """Folder and path of each, the largest first: they take the longest."""
    built = subprocess.run([*cargo, "--no-run", "--message-format=json-render-diagnostics"], stdout=subprocess.PIPE, text=True, check=False)
    if built.returncode != 0:
        sys.exit(built.returncode)
    messages = [json.loads(line) for line in built.stdout.splitlines() if line.startswith("{")]
    tests = [m for m in messages if m["reason"] == "compiler-artifact" and m["profile"]["test"] and m["executable"]]
    found = [(os.path.dirname(m["manifest_path"]), m["executable"]) for m in tests]
    return sorted(found, key=lambda test: -os.path.getsize(test[1]))


def environment(cargo: list[str]) -> dict[str, str]:
    """As cargo sets it. A test that builds a program takes the same compiler, and is not linted."""
    kept = {name: value for name, value in os.environ.items() if name not in ("RUSTC_WORKSPACE_WRAPPER", "CLIPPY_ARGS")}
    toolchain = [word[1:] for word in cargo if word.startswith("+")]
    return kept | {"RUSTUP_TOOLCHAIN": toolchain[0]} if toolchain else kept


def run(folder: str, executable: str, env: dict[str, str]) -> tuple[str, int, float, str]:
    """What cargo would run, in the same folder."""
    began = time.monotonic()
    done = subprocess.run(
        [executable], cwd=folder, env=env | {"CARGO_MANIFEST_DIR": folder}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace", check=False,
    )
    return f"{os.path.relpath(folder)} {os.path.basename(executable)}", done.returncode, time.monotonic() - began, done.stdout


def main() -> None:
    cargo = sys.argv[1:]
    # The job server of make is not handed down through Python.
    os.environ.pop("MAKEFLAGS", None)
    failed = []
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        jobs = [pool.submit(run, *test, environment(cargo)) for test in executables(cargo)]
        for job in as_completed(jobs):
            name, code, seconds, output = job.result()
            results = [line for line in output.splitlines() if line.startswith("test result:")]
            print(f"{seconds:6.1f} s  {name}: {'; '.join(results) or f'exit {code}'}", flush=True)
            if code != 0:
                failed.append(name)
                print(output, flush=True)
    documented = subprocess.run([*cargo, "--doc"], check=False)
    if failed or documented.returncode != 0:
        sys.exit("failed: " + ", ".join(failed or ["documentation"]))


main()
