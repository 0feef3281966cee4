"""The package as a newcomer finds it."""

from __future__ import annotations

import html.parser
import inspect
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import mimu
import pytest
from conftest import ROOT, run
from mimu import _mimu


def test_the_command_is_there_with_its_help_and_status() -> None:
    helped = run("--help")
    assert helped.returncode == 0 and "wizard" in helped.stdout
    assert run("--version").stdout.split() == ["mimu", mimu.__version__]
    refused = run("fit", "nowhere")
    assert refused.returncode == 1 and refused.stderr == "mimu: nowhere: there is no such file or directory; check the path\n"
    assert run("fit").returncode == 2
    module = subprocess.run([sys.executable, "-m", "mimu._command", "--version"], capture_output=True, text=True, check=True)
    assert module.stdout.split() == ["mimu", mimu.__version__]


#: Options about files that are written, and about what is printed.
OF_FILES = {"json", "strict", "verbose", "replace", "force"}
#: A trajectory is a file beside the recording.
BESIDE = {"trajectory", "trajectory_zero"}


@pytest.mark.parametrize(
    ("function", "subcommand", "elsewhere"),
    [
        # The objects, and destinations of the result.
        (mimu.fit, "fit", OF_FILES | BESIDE | {"class", "dwells", "o"}),
        (mimu.fit_sessions, "fit", OF_FILES | BESIDE | {"class", "dwells", "o", "only", "keep", "prior", "whole_turns", "placement", "reference_error", "part"}),
        (mimu.verify, "verify", OF_FILES | BESIDE),
        (mimu.diagnose, "diagnose", OF_FILES | {"o", "page", "plan", "next"}),
        (mimu.allan, "allan", OF_FILES | {"from", "to", "plot", "o"}),
        (mimu.noise_in_use, "noise", OF_FILES | {"o"}),
        (mimu.thermal.fit, "thermal fit", OF_FILES | {"lag", "range", "plot", "page", "o"}),
        # Destinations of the result; the short options of the faces are in `faces`.
        (mimu.read, "import", {"json", "o", "x", "y", "z"}),
        # Results other than a design, and the options for these only.
        (mimu.design, "design", {"json", "o", "effects", "after", "chamber", "verbose"}),
        (
            mimu.next_experiment, "design",
            {
                "json", "o", "verbose", "n", "budget", "sigma", "instability", "walk", "sensor", "prior", "aim",
                "target",
            },
        ),
    ],
)
def test_every_option_of_the_command_is_a_keyword(function: object, subcommand: str, elsewhere: set[str]) -> None:
    keywords = set(inspect.signature(function).parameters) - {"files", "output", "recording", "recordings", "part_class", "from_s", "to_s", "lag_s", "range_c"}
    options = {option.replace("-", "_") for option in _mimu.options(subcommand)} - elsewhere
    assert keywords == options


def test_every_public_thing_is_documented() -> None:
    for name in mimu.__all__:
        thing = getattr(mimu, name)
        assert inspect.getdoc(thing), name
    for method in ("apply", "to_toml", "save", "inverse", "to_dict"):
        assert inspect.getdoc(getattr(mimu.Calibration, method)), method


class Balance(html.parser.HTMLParser):
    """Checks that every element ends, and collects what a page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("img", "br", "meta", "input"):
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href") and value and not value.startswith(("data:", "#")):
                self.fetched.append(value)

    def handle_endtag(self, tag: str) -> None:
        if tag not in ("img", "br", "meta", "input"):
            assert self.open.pop() == tag, tag


def test_results_show_tables_and_plots_in_a_notebook(
    arrays: mimu.Recording, at_rest: mimu.Recording, chamber: ModuleType
) -> None:
    fit = mimu.fit(arrays)
    found = mimu.diagnose(arrays)
    thermal = mimu.thermal.fit(mimu.Recording(**chamber.session().keywords()))
    for result, words in [
        (arrays, ["50.0"]), (fit, ["<svg", "scale factor", "held out"]), (fit.calibration, ["misalignment"]),
        (found, ["<svg", found.verdict]), (mimu.allan(at_rest), ["data:image/svg+xml"]), (thermal, ["<svg", "lag"]),
        (mimu.design(n=6), ["D-efficiency"]), (mimu.verify(arrays, fit.calibration), ["<table"]),
    ]:
        shown = result._repr_html_()
        page = Balance()
        page.feed(shown)
        page.close()
        assert page.open == [] and page.fetched == [], type(result)
        assert shown.startswith('<div class="mimu">') and "<style>.mimu{" in shown
        for word in words:
            assert word in shown, (type(result), word)


def test_a_recording_comes_back_from_disk(arrays: mimu.Recording, tmp_path: Path) -> None:
    for format in ("parquet", "csv"):
        back = mimu.read(arrays.save(tmp_path / format, format=format))
        assert (back.gyro == arrays.gyro).all() and (back.t == arrays.t).all() and back.device == arrays.device
    with pytest.raises(mimu.Error, match="exists"):
        arrays.save(tmp_path / "csv")


def test_the_stubs_are_right() -> None:
    config = ROOT / "python" / "pyproject.toml"
    checked = [sys.executable, "-m", "mypy", "--config-file", str(config), "-p", "mimu"]
    done = subprocess.run(checked, capture_output=True, text=True, cwd=Path(__file__).parent, check=False)
    assert done.returncode == 0, done.stdout
    tested = [sys.executable, "-m", "mypy.stubtest", "mimu._mimu", "--ignore-missing-stub", "--mypy-config-file", str(config)]
    done = subprocess.run(tested, capture_output=True, text=True, cwd=Path(__file__).parent, check=False)
    assert done.returncode == 0, done.stdout
