"""The page of `make web` in a browser: its results are the command's, it says what it refuses, it can be cancelled, and it works offline.

Needs Chromium on the PATH, and the folder of the page in MIMU_PAGE (`make web-tests`); without either these tests are skipped.
"""
import json
import pathlib
import time

import numpy
import pytest
import web_logs
from browser import PATIENCE, Server, needs_page, same, taken_away
from conftest import EXAMPLE, run
from test_pages import CLIPPED, FAINT

pytestmark = needs_page


def calibrate(page):
    page.click("#columns button.main")
    # Not wait_for_function, which the page's security policy forbids.
    page.wait_for_selector("#work:not([hidden]) #progress[hidden]", state="attached", timeout=PATIENCE)


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
    judgement = diagnosis["judgement"]
    assert page.inner_text("#judgement") == f"{judgement['kind'].capitalize()}: {judgement['reason']}."
    assert page.eval_on_selector("#judgement", "shown => shown.previousElementSibling.id") == "result-title"
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
    # The place of the example does not apply to the next log.
    assert page.input_value("#gravity") == "9.80665"
    page.set_input_files("#file", EXAMPLE / "accel.txt")
    assert page.input_value("#gravity") == ""


def test_columns_are_taken_by_their_names_and_can_be_corrected(page, tmp_path):
    rows = web_logs.by_hand()
    # x and y of the accelerometer have each other's names.
    rows[:, [4, 5]] = rows[:, [5, 4]]
    web_logs.write_csv(tmp_path / "log.csv", rows)
    page.set_input_files("#file", tmp_path / "log.csv")
    page.wait_for_selector("#columns:not([hidden])")
    shown = page.eval_on_selector_all("#files select", "all => all.map(select => select.value)")
    assert shown == ["t_s", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    # No name has a unit: gravity is 9.8, and turns as the gyro reads in rad/s.
    assert page.input_value("#accel-unit") == "m/s²"
    assert page.input_value("#gyro-unit") == "rad/s"
    page.select_option("#role-0-4", "accel_y")
    page.select_option("#role-0-5", "accel_x")
    page.fill("#gravity", "9.80665")
    calibrate(page)
    assert page.inner_text("#error") == ""
    fit = json.loads(taken_away(page, "fit.json"))
    # As the log was made: C of the accelerometer is the inverse of its scale.
    scale = {p["name"]: p["value"] for p in fit["sensors"]["accel"]["parameters"]}
    diagonal = [value for name, value in scale.items() if "scale" in name]
    print(scale)
    assert numpy.allclose(diagonal, [1.005, 0.998, 1.01], atol=2e-3)


@pytest.mark.parametrize(("gyro", "accel"), [("deg/s", "g"), ("rad/s", "m/s²"), ("mdeg/s", "mg")])
def test_units_are_those_in_which_gravity_is_gravity_and_turns_as_the_gyro_reads(page, tmp_path, gyro, accel):
    per_si = {"rad/s": 1, "deg/s": 180 / numpy.pi, "mdeg/s": 180e3 / numpy.pi, "m/s²": 1, "g": 1 / web_logs.G, "mg": 1e3 / web_logs.G}
    rows = web_logs.by_hand()
    rows[:, 1:4] *= per_si[gyro]
    rows[:, 4:] *= per_si[accel]
    web_logs.write_csv(tmp_path / "log.csv", rows)
    page.set_input_files("#file", tmp_path / "log.csv")
    page.wait_for_selector("#columns:not([hidden])")
    assert [page.input_value(f"#{sensor}-unit") for sensor in ["gyro", "accel"]] == [gyro, accel]
    page.fill("#gravity", "9.80665")
    calibrate(page)
    assert page.inner_text("#error") == ""
    fit = json.loads(taken_away(page, "fit.json"))
    for sensor, made in [("gyro", [1.01, 0.99, 1.02]), ("accel", [1.005, 0.998, 1.01])]:
        scale = [p["value"] for p in fit["sensors"][sensor]["parameters"] if p["name"].startswith("scale_")]
        assert numpy.allclose(scale, made, atol=4e-3), (sensor, scale)


def test_a_parquet_file_is_read(page, tmp_path):
    web_logs.write_csv(tmp_path / "log.csv", web_logs.by_hand())
    # mimu's own recordings are compressed with zstd.
    run(
        "import", "log.csv", "--columns", "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", "--raw-unit", "SI", "--reference", "gravity",
        "--gravity", 9.80665, "-o", "rec", cwd=tmp_path,
    )  # fmt: skip
    page.set_input_files("#file", tmp_path / "rec" / "samples.parquet")
    page.wait_for_selector("#columns:not([hidden])")
    calibrate(page)
    assert page.inner_text("#error") == ""
    ours = json.loads(taken_away(page, "fit.json"))["sensors"]
    theirs = json.loads(run("fit", "rec", "--json", "-", cwd=tmp_path))["sensors"]
    same(ours, theirs, "fit of Parquet")


@pytest.mark.parametrize("several", ["verify", "joint"])
def test_several_recordings_of_a_unit_are_diagnosed_as_by_the_command(page, tmp_path, several):
    for k in [1, 2]:
        web_logs.write_csv(tmp_path / f"day-{k}.csv", web_logs.by_hand(seed=k))
        columns = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
        given = ["--columns", columns, "--raw-unit", "SI", "--reference", "gravity", "--gravity", 9.80665, "--device", "day-1"]
        run("import", f"day-{k}.csv", *given, "-o", {1: "rec", 2: "rec-2"}[k], cwd=tmp_path)
    page.set_input_files("#file", [tmp_path / "day-1.csv", tmp_path / "day-2.csv"])
    page.wait_for_selector("#columns:not([hidden])")
    page.select_option("#several", several)
    page.fill("#gravity", "9.80665")
    calibrate(page)
    assert page.inner_text("#error") == ""
    assert taken_away(page, "rec-2-samples.parquet") == (tmp_path / "rec-2" / "samples.parquet").read_bytes()
    second = ["--verify", "rec-2"] if several == "verify" else ["rec-2"]
    ours = json.loads(taken_away(page, "diagnosis.json"))
    theirs = json.loads(run("diagnose", "rec", *second, "--json", "-", cwd=tmp_path))
    # The drawn residuals are left out. In these synthetic logs the quantiles of the gyro's residuals differ by per cents between page and command,
    # also for a single recording.
    for found in [ours, theirs]:
        for sensor in found["sensors"].values():
            sensor.pop("picture")
    same(ours, theirs, f"diagnosis, {several}")
    inside = page.frame_locator("#report").locator("h1")
    assert inside.inner_text() == "Inertial unit day-1"


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
        ("letter.csv", b"Dear Sir,\nyours faithfully\n", "no line is a row of numbers"),
        ("log.csv.gz", b"\x1f\x8b" + bytes(100), "compressed with gzip; unpack it with gunzip"),
        ("log.parquet", b"PAR1" + bytes(200) + b"PAR1", "not a readable Parquet file"),
        ("log.ulg", b"ULog" + bytes(300), "log.ulg"),
        ("log.bag", b"#ROSBAG V2.0\n", "a browser cannot read bags of ROS 1"),
        ("empty.csv", b"", "no line is a row of numbers"),
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
    # At rest nothing shows the unit of a gyro, so nothing begins before it is chosen.
    assert page.input_value("#gyro-unit") == ""
    page.click("#noise")
    assert page.is_hidden("#work")
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


def test_noise_and_calibration_of_different_units_are_kept_apart(page, tmp_path):
    page.click("#example")
    page.wait_for_selector("#away:not([hidden])", timeout=PATIENCE)
    random = numpy.random.default_rng(3)
    rows = numpy.zeros((60_000, 7))
    rows[:, 0] = numpy.arange(len(rows)) / 100
    rows[:, 1:4] = random.normal(0, 2e-3, (len(rows), 3))
    rows[:, 4:] = random.normal([0, 0, 9.80665], 2e-2, (len(rows), 3))
    web_logs.write_csv(tmp_path / "rest.csv", rows)

    def kalibr():
        page.select_option("#gyro-unit", "rad/s")
        page.click("#noise")
        page.wait_for_selector("#work:not([hidden]) #progress[hidden]", state="attached", timeout=PATIENCE)
        assert page.inner_text("#error") == ""
        page.select_option("#format", label="Kalibr (imu.yaml)")
        with page.expect_download() as download:
            page.click("#export")
        return pathlib.Path(download.value.path()).read_text()

    def density(text):
        line = next(line for line in text.splitlines() if line.startswith("accelerometer_noise_density"))
        return float(line.split(":")[1].split("#")[0])

    page.set_input_files("#file", tmp_path / "rest.csv")
    page.wait_for_selector("#columns:not([hidden])")
    text = kalibr()
    assert abs(density(text) / (2e-2 / numpy.sqrt(100)) - 1) < 0.05
    assert "accelerometers:" not in text and "unit rest" in page.inner_text("#made-from")
    # Said to be the unit of the example, whose calibration is for counts.
    page.set_input_files("#file", tmp_path / "rest.csv")
    page.wait_for_selector("#columns:not([hidden])")
    page.select_option("#unit", "1")
    text = kalibr()
    assert abs(density(text) / (2e-2 / numpy.sqrt(100)) - 1) < 0.05
    assert "accelerometers:" not in text
    assert "count" in page.inner_text("#warnings") and "kept apart" in page.inner_text("#made-from")


def test_a_calibration_of_ones_own_is_verified_by_a_log_and_applied_to_it(page, tmp_path):
    page.click("#example")
    page.wait_for_selector("#away:not([hidden])", timeout=PATIENCE)
    cal = tmp_path / "cal.toml"
    cal.write_bytes(taken_away(page, "calibration.toml"))
    web_logs.write_csv(tmp_path / "log.csv", web_logs.by_hand())
    page.reload()
    page.set_input_files("#file", cal)
    page.wait_for_selector("#given:not([hidden])")
    assert "cal.toml" in page.inner_text("#given") and page.is_hidden("#columns")
    page.set_input_files("#file", [EXAMPLE / "accel.txt", EXAMPLE / "gyro.txt"])
    page.wait_for_selector("#columns:not([hidden])")
    page.fill("#gravity", "9.80665")
    page.fill("#unit-name", "accel")
    for sensor in ("accel", "gyro"):
        page.select_option(f"#{sensor}-unit", "count")
    for button, file in (("#verify-given", "verify.json"), ("#apply-given", "calibrated/samples.csv")):
        page.click(button)
        page.wait_for_selector("#work:not([hidden]) #progress[hidden]", state="attached", timeout=PATIENCE)
        assert page.inner_text("#error") == ""
        assert taken_away(page, file)
    lists = ["t_s,accel_x,accel_y,accel_z", "t_s,gyro_x,gyro_y,gyro_z"]
    run("import", EXAMPLE / "accel.txt", EXAMPLE / "gyro.txt", "--columns", lists[0], "--columns", lists[1], "--gravity", 9.80665,
        "--raw-unit", "count", "--device", "accel", "-o", "rec", cwd=tmp_path)
    run("apply", "rec", "--calibration", "cal.toml", "--format", "csv", "-o", "clean", cwd=tmp_path)
    ours, theirs = (numpy.loadtxt(text, delimiter=",", skiprows=1) for text in (
        taken_away(page, "calibrated/samples.csv").decode().splitlines(), (tmp_path / "clean" / "samples.csv").read_text().splitlines()))
    numpy.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)


def test_a_name_and_a_rate_hold_for_one_log_only(page, tmp_path):
    rows = web_logs.by_hand()
    web_logs.write_csv(tmp_path / "first.csv", rows)
    web_logs.write_csv(tmp_path / "second.csv", rows)
    page.set_input_files("#file", tmp_path / "first.csv")
    page.wait_for_selector("#columns:not([hidden])")
    assert page.get_attribute("#unit-name", "placeholder") == "first"
    page.fill("#rate", "123")
    page.fill("#unit-name", "B-17")
    page.set_input_files("#file", tmp_path / "second.csv")
    page.wait_for_selector("#columns:not([hidden])")
    assert page.input_value("#rate") == "" and page.input_value("#unit-name") == ""
    page.fill("#unit-name", "B-17")
    calibrate(page)
    page.wait_for_selector("#away:not([hidden])", timeout=PATIENCE)
    assert "B-17" in page.inner_text("#made-from")
    # The verdict, scale factors and biases are on the first screen of the result; the report is folded.
    page.evaluate("document.getElementById('result').scrollIntoView()")
    for words in ("scale factor", "bias"):
        where = page.locator("#parameters").get_by_text(words).first.bounding_box()
        assert where["y"] < 900, (words, where)
    assert page.evaluate("document.documentElement.scrollHeight") < 5000


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
    # The focus is on the result, so that a screen reader reads it.
    assert page.evaluate("document.activeElement.id") == "result-title"
    assert page.evaluate(unnamed) == []
    assert page.locator("h1").count() == 1
    assert page.locator("[role=status]").count() >= 1
