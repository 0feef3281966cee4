"""The page of `make web` in a browser: its results are the command's, it says what it refuses, it can be cancelled, and it works offline.

Needs Chromium on the PATH, and the folder of the page in MIMU_PAGE (`make web-tests`); without either these tests are skipped.
"""
import functools
import http.server
import json
import os
import pathlib
import shutil
import threading
import time

import numpy
import pytest
import web_logs
from conftest import EXAMPLE, run
from test_pages import CLIPPED, FAINT

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PAGE = os.environ.get("MIMU_PAGE")
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on the PATH"),
    pytest.mark.skipif(PAGE is None, reason="no page is given: make web-tests"),
]
# Of a computation on a machine that does something else as well, ms.
PATIENCE = 300_000


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Static files, with the types that a browser wants."""

    extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".wasm": "application/wasm", ".js": "text/javascript"}

    def log_message(self, *_):
        pass


class Server:
    """The page as any server hands it out."""

    def __init__(self):
        handler = functools.partial(Quiet, directory=PAGE)
        self.http = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self.url = f"http://127.0.0.1:{self.http.server_address[1]}/"
        threading.Thread(target=self.http.serve_forever, daemon=True).start()

    def stop(self):
        self.http.shutdown()
        self.http.server_close()


@pytest.fixture(scope="session")
def chromium():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def server():
    server = Server()
    yield server
    server.stop()


@pytest.fixture
def page(chromium, server):
    """The page, freshly loaded. A message on the console, an error of a script or a request to elsewhere fails the test."""
    context = chromium.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    said = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    ours = (server.url, "data:", "blob:", "about:")
    page.on("request", lambda r: None if r.url.startswith(ours) else said.append(f"asks for {r.url}"))
    page.goto(server.url)
    yield page
    context.close()
    assert said == []


def calibrate(page):
    page.click("#columns button.main")
    # Not wait_for_function, which the page's security policy forbids.
    page.wait_for_selector("#work:not([hidden]) #progress[hidden]", state="attached", timeout=PATIENCE)


def taken_away(page, name):
    """Content of a file that the page offers."""
    with page.expect_download() as download:
        page.get_by_role("button", name=name, exact=True).click()
    return pathlib.Path(download.value.path()).read_bytes()


def numbers(ours, theirs, path=""):
    """All numbers of two results that have one layout, as (place, ours, theirs). Words and keys have to be the same."""
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys(), path
        return [pair for key in ours for pair in numbers(ours[key], theirs[key], f"{path}.{key}")]
    if isinstance(ours, list):
        assert len(ours) == len(theirs), path
        return [pair for k, (a, b) in enumerate(zip(ours, theirs)) for pair in numbers(a, b, f"{path}[{k}]")]
    if isinstance(ours, float) or isinstance(theirs, float):
        return [(path, ours, theirs)]
    assert ours == theirs, path
    return []


def same(ours, theirs, what):
    """Asserts that results of the page are the command's, but for the last digits of what was computed with rounding.

    The dwells are equal to the bit. Products of matrices are fused on a PC that can, and sine, exponential and logarithm are another
    library's: parameters then differ by 1e-15 of their size, and residuals, which are small differences of large numbers, by up to 1e-7.
    """
    pairs = numbers(ours, theirs)
    other = [(abs(a - b) / max(abs(a), abs(b)), path, a, b) for path, a, b in pairs if a != b]
    parts = {"dwells": 0.0, "residuals, and what is drawn of them": 1e-6, "others": 1e-9}
    of = lambda path: next((p for p in parts if p[:8] in path), "residuals, and what is drawn of them" if "picture" in path else "others")  # noqa: E731
    for part, most in parts.items():
        found = [one for one in other if of(one[1]) == part]
        print(f"{what}, {part}: {len(found)} of {sum(of(p) == part for p, _, _ in pairs)} numbers differ; most {max(found, default='none')}")
        for difference, path, a, b in found:
            assert difference < most or abs(a - b) < 1e-15, (path, a, b)


def test_the_example_gives_what_the_command_gives(page, tmp_path):
    begun = time.monotonic()
    page.click("#example")
    page.wait_for_selector("#verdict:not([hidden])", timeout=PATIENCE)
    print(f"example: verdict after {time.monotonic() - begun:.1f} s; {page.inner_text('#steps')!r}")
    page.wait_for_selector("#away:not([hidden])")
    lists = ["t_s,accel_x,accel_y,accel_z", "t_s,gyro_x,gyro_y,gyro_z"]
    run(
        "import", EXAMPLE / "accel.txt", EXAMPLE / "gyro.txt", "--columns", lists[0], "--columns", lists[1], "--gravity", 9.80665,
        "--raw-unit", "count", "--reference", "gravity", "--device", "accel", "-o", "rec", cwd=tmp_path,
    )  # fmt: skip
    assert taken_away(page, "samples.parquet") == (tmp_path / "rec" / "samples.parquet").read_bytes()
    fit = json.loads(run("fit", "rec", "--json", "-", cwd=tmp_path))
    diagnosis = json.loads(run("diagnose", "rec", "--json", "-", cwd=tmp_path))
    same(json.loads(taken_away(page, "fit.json")), fit, "fit")
    same(json.loads(taken_away(page, "diagnosis.json")), diagnosis, "diagnosis")
    assert page.inner_text("#verdict").startswith("Clean")
    assert diagnosis["verdict"] == "clean"
    assert f"{len(fit['dwells'])} poses" in page.inner_text("#next")


def test_an_export_is_the_file_of_the_command(page, tmp_path):
    page.click("#example")
    page.wait_for_selector("#away:not([hidden])", timeout=PATIENCE)
    (tmp_path / "calibration.toml").write_bytes(taken_away(page, "calibration.toml"))
    page.select_option("#format", label="C header (mimu.h)")
    with page.expect_download() as download:
        page.click("#export")
    run("export", "c", "--calibration", "calibration.toml", "-o", "mimu.h", cwd=tmp_path)
    assert pathlib.Path(download.value.path()).read_text() == (tmp_path / "mimu.h").read_text()
    assert "deg/s" in page.inner_text("#exported")
    # Where the example was recorded says nothing of where the next log was.
    assert page.input_value("#gravity") == "9.80665"
    page.set_input_files("#file", EXAMPLE / "accel.txt")
    assert page.input_value("#gravity") == ""


def test_columns_are_taken_by_their_names_and_can_be_corrected(page, tmp_path):
    rows = web_logs.by_hand()
    # x and y of the accelerometer under each other's name.
    rows[:, [4, 5]] = rows[:, [5, 4]]
    web_logs.write_csv(tmp_path / "log.csv", rows)
    page.set_input_files("#file", tmp_path / "log.csv")
    page.wait_for_selector("#columns:not([hidden])")
    shown = page.eval_on_selector_all("#files select", "all => all.map(select => select.value)")
    assert shown == ["t_s", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    assert page.input_value("#accel-unit") == "m/s²"
    page.select_option("#role-0-4", "accel_y")
    page.select_option("#role-0-5", "accel_x")
    page.select_option("#gyro-unit", "rad/s")
    page.fill("#gravity", "9.80665")
    calibrate(page)
    assert page.inner_text("#error") == ""
    fit = json.loads(taken_away(page, "fit.json"))
    # As the log was made: C of the accelerometer is the inverse of its scale.
    scale = {p["name"]: p["value"] for p in fit["sensors"]["accel"]["parameters"]}
    diagonal = [value for name, value in scale.items() if "scale" in name]
    print(scale)
    assert numpy.allclose(diagonal, [1.005, 0.998, 1.01], atol=2e-3)


def test_a_parquet_file_is_read(page, tmp_path):
    web_logs.write_csv(tmp_path / "log.csv", web_logs.by_hand())
    # mimu's own recordings are compressed with zstd.
    run(
        "import", "log.csv", "--columns", "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", "--raw-unit", "SI", "--reference", "gravity",
        "--gravity", 9.80665, "-o", "rec", cwd=tmp_path,
    )  # fmt: skip
    page.set_input_files("#file", tmp_path / "rec" / "samples.parquet")
    page.wait_for_selector("#columns:not([hidden])")
    page.select_option("#gyro-unit", "rad/s")
    calibrate(page)
    assert page.inner_text("#error") == ""
    ours = json.loads(taken_away(page, "fit.json"))["sensors"]
    theirs = json.loads(run("fit", "rec", "--json", "-", cwd=tmp_path))["sensors"]
    same(ours, theirs, "fit of Parquet")


def test_a_file_can_be_dropped_anywhere_on_the_page(page):
    drop = """text => {
        const data = new DataTransfer();
        data.items.add(new File([text], 'log.csv'));
        for (const type of ['dragover', 'drop']) document.querySelector('h1').dispatchEvent(new DragEvent(type, {dataTransfer: data, bubbles: true, cancelable: true}));
    }"""
    page.evaluate(drop, "time,gx,gy,gz,ax,ay,az\n" + "".join(f"{0.01 * k},1,2,3,0,0,{16384 + k}\n" for k in range(20)))
    page.wait_for_selector("#columns:not([hidden])")
    assert page.inner_text("#files legend") == "log.csv"
    assert page.input_value("#role-0-6") == "accel_z"
    assert page.input_value("#accel-unit") == "count"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("letter.csv", b"Dear Sir,\nyours faithfully\n", "none of its lines is a row of numbers"),
        ("log.csv.gz", b"\x1f\x8b" + bytes(100), "compressed with gzip; unpack it with gunzip"),
        ("log.parquet", b"PAR1" + bytes(200) + b"PAR1", "not a readable Parquet file"),
        ("log.ulg", b"ULog" + bytes(300), "log.ulg"),
        ("log.bag", b"#ROSBAG V2.0\n", "a browser cannot read bags of ROS 1"),
        ("empty.csv", b"", "none of its lines is a row of numbers"),
    ],
    ids=lambda value: value if isinstance(value, str) and "." in value and " " not in value else "",
)
def test_a_file_that_is_refused_is_refused_in_the_line_of_the_library(page, tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    page.set_input_files("#file", tmp_path / name)
    page.wait_for_selector("#error:not([hidden]), #columns:not([hidden])")
    if page.is_visible("#columns"):
        calibrate(page)
    line = page.inner_text("#error")
    assert words in line and "; " in line and "\n" not in line
    assert name in line


def test_a_broken_row_is_named_and_its_remedy_leads_to_the_field(page, tmp_path):
    path = tmp_path / "log.csv"
    web_logs.write_csv(path, web_logs.by_hand())
    lines = path.read_text().splitlines()
    lines[500] = "5.0,nonsense" + ",1" * 5
    path.write_text("\n".join(lines))
    page.set_input_files("#file", path)
    page.wait_for_selector("#columns:not([hidden])")
    calibrate(page)
    line = page.inner_text("#error")
    assert "log.csv, row 501, column gyro_x" in line
    page.locator("#error button", has_text="--skip-broken").click()
    assert page.evaluate("document.activeElement.id") == "broken"
    page.select_option("#broken", "1%")
    calibrate(page)
    assert page.inner_text("#error") == ""
    assert page.is_visible("#trace svg")


def test_noise_of_a_unit_at_rest_gives_the_file_of_an_estimator(page, tmp_path):
    random = numpy.random.default_rng(2)
    rows = numpy.zeros((60_000, 7))
    rows[:, 0] = numpy.arange(len(rows)) / 100
    rows[:, 1:4] = random.normal(0, 2e-3, (len(rows), 3))
    rows[:, 4:] = random.normal([0, 0, 9.80665], 2e-2, (len(rows), 3))
    web_logs.write_csv(tmp_path / "rest.csv", rows)
    page.set_input_files("#file", tmp_path / "rest.csv")
    page.wait_for_selector("#columns:not([hidden])")
    page.select_option("#gyro-unit", "rad/s")
    page.click("#noise")
    page.wait_for_selector("#away:not([hidden])", timeout=PATIENCE)
    assert page.is_visible("#allan svg")
    page.select_option("#format", label="Kalibr (imu.yaml)")
    with page.expect_download() as download:
        page.click("#export")
    text = pathlib.Path(download.value.path()).read_text()
    density = float(next(line for line in text.splitlines() if line.startswith("gyroscope_noise_density")).split(":")[1].split("#")[0])
    # White noise of 2 mrad/s at 100 Hz.
    assert abs(density / (2e-3 / numpy.sqrt(100)) - 1) < 0.05


def test_work_can_be_cancelled_and_begun_again(page, tmp_path):
    web_logs.write_csv(tmp_path / "log.csv", web_logs.by_hand(dwell_s=40.0, rate_hz=500.0))
    page.set_input_files("#file", tmp_path / "log.csv")
    page.wait_for_selector("#columns:not([hidden])")
    page.click("#columns button.main")
    page.locator("#status", has_text="reading log.csv").wait_for()
    page.click("#cancel")
    page.wait_for_selector("#progress", state="hidden")
    assert "cancelled" in page.inner_text("#steps")
    assert page.inner_text("#error") == ""
    assert page.is_hidden("#result")
    calibrate(page)
    assert page.inner_text("#error") == ""
    assert page.is_visible("#trace svg")


def test_a_log_of_80_megabytes_is_calibrated(page, tmp_path):
    rows = web_logs.by_hand(dwells=30, dwell_s=34.0, rate_hz=1000.0)
    web_logs.write_csv(tmp_path / "log.csv", rows)
    size = (tmp_path / "log.csv").stat().st_size
    assert size > 80e6
    page.set_input_files("#file", tmp_path / "log.csv")
    page.wait_for_selector("#columns:not([hidden])")
    begun = time.monotonic()
    calibrate(page)
    seconds = time.monotonic() - begun
    assert page.inner_text("#error") == ""
    print(f"{size / 1e6:.0f} MB, {len(rows)} rows: {seconds:.1f} s, in WebAssembly {page.inner_text('#steps')!r}")
    assert page.is_visible("#trace svg")


def test_the_page_works_without_a_network_once_it_has_been_loaded(chromium):
    server = Server()
    context = chromium.new_context()
    page = context.new_page()
    page.goto(server.url)
    page.evaluate("navigator.serviceWorker.ready.then(() => true)")
    while page.evaluate("navigator.serviceWorker.controller === null"):
        page.wait_for_timeout(50)
    server.stop()
    page.reload()
    page.click("#example")
    page.wait_for_selector("#verdict:not([hidden])", timeout=PATIENCE)
    context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_can_be_read_on_a_phone_a_tablet_and_a_desk(chromium, server, scheme):
    for width in [360, 768, 1280]:
        context = chromium.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page = context.new_page()
        page.goto(server.url)
        assert page.evaluate(CLIPPED) == [], width
        assert page.evaluate(FAINT) == [], width
        page.click("#example")
        page.wait_for_selector("#away:not([hidden])", timeout=PATIENCE)
        assert page.evaluate(CLIPPED) == [], width
        assert page.evaluate(FAINT) == [], width
        context.close()


def test_the_page_can_be_used_from_the_keyboard_and_by_ear(page):
    unnamed = """() => [...document.querySelectorAll('input, select, button, iframe, progress, svg:not(.key)')]
        .filter(e => !(e.labels?.length || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby') || e.title || e.textContent.trim()))
        .map(e => e.outerHTML.slice(0, 80))"""
    # The example, by Tab and Enter alone.
    for _ in range(10):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "example":
            break
    page.keyboard.press("Enter")
    page.wait_for_selector("#away:not([hidden])", timeout=PATIENCE)
    # The result is told where the reader's place is.
    assert page.evaluate("document.activeElement.id") == "result-title"
    assert page.evaluate(unnamed) == []
    assert page.locator("h1").count() == 1
    assert page.locator("[role=status]").count() >= 1
