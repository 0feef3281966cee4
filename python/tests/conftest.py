"""Recordings that the tests share, and the command as a second way to the same numbers."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import mimu

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "tests" / "example"
EXAMPLES = ROOT / "python" / "examples"

Command = Callable[..., subprocess.CompletedProcess[str]]


def pytest_configure(config: pytest.Config) -> None:
    """Registers the marks of the tests."""
    config.addinivalue_line("markers", "nightly: what takes minutes; run by `make nightly`")


def run(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command ``mimu`` of the wheel."""
    program = Path(sys.executable).with_name("mimu")
    given = [program, *map(str, arguments)]
    return subprocess.run(given, cwd=cwd, capture_output=True, text=True, timeout=600, check=False)


def json_of(*arguments: object, cwd: Path | None = None) -> Any:
    """The command's JSON output."""
    done = run(*arguments, "--json", "-", cwd=cwd)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The repository's recording by hand, imported by the command."""
    path = tmp_path_factory.mktemp("by-hand") / "by-hand"
    done = run(
        "import", EXAMPLE / "accel.txt", EXAMPLE / "gyro.txt", "--columns", "t_s,accel_x,accel_y,accel_z", "--columns",
        "t_s,gyro_x,gyro_y,gyro_z", "--gravity", "9.80665", "--raw-unit", "count", "--reference", "gravity", "--device", "by-hand",
        "-o", path,
    )
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture(scope="session")
def by_hand(folder: Path) -> mimu.Recording:
    """The same, opened."""
    return mimu.read(folder)


@pytest.fixture(scope="session")
def arrays(by_hand: mimu.Recording) -> mimu.Recording:
    """The same as arrays."""
    return mimu.Recording(
        by_hand.t, by_hand.gyro, by_hand.accel, unit="count", gravity=9.80665, rate_hz=by_hand.rate_hz, device=by_hand.device
    )


def example(name: str) -> ModuleType:
    """A file of the examples."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def chamber() -> ModuleType:
    """The example of a unit in a chamber, with its truth."""
    return example("chamber")


@pytest.fixture(scope="session")
def at_rest() -> mimu.Recording:
    """Ten minutes at rest: white noise of known density and a bias with a random walk."""
    random = np.random.default_rng(5)
    rows, rate = 60_000, 100.0
    white = random.normal(size=(rows, 6)) * [2e-3] * 6
    walk = np.cumsum(random.normal(size=(rows, 6)) * 2e-5, axis=0)
    values = white + walk + [0.01, -0.02, 0.005, 0.03, -0.05, 9.81]
    return mimu.Recording(None, values[:, :3], values[:, 3:], unit="SI", gravity=9.81, rate_hz=rate, device="rest")


@pytest.fixture(scope="session")
def data() -> Path:
    """The public recordings, if they are available."""
    path = Path(os.environ.get("MIMU_DATA", ROOT / ".." / "shared" / "data"))
    if not (path / "imu_tk_xsens" / "xsens_acc.mat").is_file():
        pytest.skip("no public recordings at hand: set MIMU_DATA (docs/recordings.md says where to get them)")
    return path
