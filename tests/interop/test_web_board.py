"""The page leads a session with a board on USB: as `mimu wizard` does, with the same journal, and it says what to do where the port fails.

Needs what test_web.py needs, and the virtual bench beside the command.
"""
import io
import json
import os
import time
import tomllib
import zipfile

import pytest
import web_board
from browser import needs_page, numbers, same, taken_away
from conftest import run
from test_pages import CLIPPED, FAINT

pytestmark = needs_page


@pytest.fixture(scope="session")
def lines(tmp_path_factory):
    return web_board.lines(tmp_path_factory.mktemp("board"))


@pytest.fixture
def usb(page):
    """The page with a serial port."""
    page.add_init_script(web_board.MOCK)
    page.reload()
    return page


def connect(page, lines, settings=True):
    """Connects the board, and waits until its lines are shown."""
    page.evaluate("lines => { board.lines = lines; board.at = 0; board.perSecond = 100; }", lines)
    if settings:
        page.fill("#board-gravity", "9.80665")
        page.fill("#board-name", "plane-7")
        page.eval_on_selector_all("#board-form details", "all => all.forEach(d => d.open = true)")
        page.fill("#board-dwell", str(web_board.DWELL_S))
        page.fill("#more-wizard", "--warm-up 0 --as-planned --trust-clock")
    page.click("#connect")
    page.locator("#line-columns select").nth(6).wait_for()


def begin(page, per_second=4000):
    page.evaluate("pace => { board.perSecond = pace; }", per_second)
    page.click("#line button.main")
    page.wait_for_selector("#session:not([hidden])")


def finished(page):
    """Waits for the end of the session and for its results."""
    page.locator("#prompt", has_text="The session is finished.").wait_for(timeout=100_000)
    page.wait_for_selector("#away:not([hidden])", timeout=100_000)
    assert page.inner_text("#error") == ""


def reaches(page, pose):
    """Waits until at least so many poses are recorded: one may come between two checks."""
    begun = time.monotonic()
    while int((page.inner_text("#count").split() or [0, 0])[1]) < pose:
        assert page.inner_text("#error") == "", page.inner_text("#log")
        assert time.monotonic() - begun < 100, page.inner_text("#session")
        page.wait_for_timeout(30)


def stopped_at(page, pose):
    reaches(page, pose)
    page.click("#stop")
    page.locator("#prompt", has_text="The session is stopped.").wait_for(timeout=100_000)


def journal(page, folder):
    """The session stored by the page, unpacked."""
    archive = zipfile.ZipFile(io.BytesIO(taken_away(page, "Download the journal")))
    assert archive.testzip() is None
    archive.extractall(folder)
    return folder


def entries(folder):
    return [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()]


def dwells(folder):
    return [entry for entry in entries(folder) if entry["entry"] == "dwell"]


def equal(ours, theirs, most=1e-9):
    """Asserts that two calibrations are equal, apart from the last digits."""
    for path, a, b in numbers(ours, theirs):
        assert abs(a - b) <= most * max(abs(a), abs(b)) or abs(a - b) < 1e-15, (path, a, b)


def placeless(result):
    """A result without the places of its recordings: the page and the command have other folders."""
    for problem in result["recording_problems"]:
        problem.pop("recording", None)
    return result


def test_a_whole_session_gives_the_calibration_of_the_command(usb, lines, tmp_path):
    connect(usb, lines)
    shown = usb.eval_on_selector_all("#line-columns select", "all => all.map(select => select.value)")
    assert ",".join(shown) == web_board.COLUMNS
    begun = time.monotonic()
    begin(usb)
    finished(usb)
    print(f"session of {len(lines)} lines at 4000 a second: {time.monotonic() - begun:.1f} s; {usb.inner_text('#steps')!r}")
    said = usb.inner_text("#log")
    for words in ["by the board's clock", "in use: session/calibration.toml"]:
        assert words in said, (words, said)
    ours = journal(usb, tmp_path / "page")
    calibration = tomllib.loads((ours / "calibration.toml").read_text())
    web_board.assert_true(calibration)

    # The command continues with the journal after the last dwell: it has no dwell to record, and makes its own calibration.
    theirs = tmp_path / "command"
    journal(usb, theirs)
    kept = [line for line in (theirs / "journal.jsonl").read_text().splitlines() if json.loads(line)["entry"] in ["dwell", "redo", "made"]]
    (theirs / "journal.jsonl").write_text("".join(line + "\n" for line in kept))
    for made in ["calibration.toml", "with-effects.toml", "diagnosis.html"]:
        (theirs / made).unlink(missing_ok=True)
    board = web_board.Socket(lines)
    said = web_board.wizard(board.port, theirs)
    board.close()
    assert "in use" in said, said
    assert dwells(theirs) == dwells(ours)
    equal(calibration, tomllib.loads((theirs / "calibration.toml").read_text()))

    # The page's result from the recording equals the command's.
    fit = json.loads(run("fit", ours / "calibration", "--json", "-", cwd=tmp_path))
    same(placeless(json.loads(taken_away(usb, "fit.json"))), placeless(fit), "fit of the session")
    found = run("diagnose", ours / "calibration", "--verify", ours / "verification", "--json", "-", cwd=tmp_path)
    assert json.loads(taken_away(usb, "diagnosis.json"))["verdict"] == json.loads(found)["verdict"]
    with usb.expect_download() as download:
        usb.click("#export")
    assert download.value.suggested_filename == "mimu.h"

    # The journal of a finished session needs no board.
    archive = tmp_path / "plane-7.zip"
    archive.write_bytes(taken_away(usb, "Download the journal"))
    usb.reload()
    usb.set_input_files("#file", archive)
    usb.wait_for_selector("#away:not([hidden])", timeout=100_000)
    assert "finished" in usb.inner_text("#loaded")
    same(placeless(json.loads(taken_away(usb, "fit.json"))), placeless(fit), "fit of the journal")


def test_a_session_with_whole_turns_counts_them_and_says_what_one_is_read_as(usb, tmp_path):
    spun = web_board.lines(tmp_path, whole_turns=True)
    connect(usb, spun)
    usb.check("#board-turns")
    begin(usb)
    usb.locator("#count", has_text="whole turns").wait_for(timeout=100_000)
    usb.locator("#turns-of", has_text="of 10 turns about").wait_for(timeout=100_000)
    if shots := os.environ.get("MIMU_SHOTS"):
        usb.screenshot(path=f"{shots}/spin.png", full_page=True)
    finished(usb)
    said = usb.inner_text("#log")
    # Each axis both ways, and once more in the verification.
    assert said.count("and it lies where it lay") >= 7, said
    ours = journal(usb, tmp_path / "page")
    calibration = tomllib.loads((ours / "calibration.toml").read_text())
    web_board.assert_true(calibration)
    made = [entry["spin"] for entry in entries(ours) if entry["entry"] == "spin"]
    assert sorted((spin["axis"], spin["turns"]) for spin in made[:6]) == [(axis, n) for axis in range(3) for n in [-10, 10]]
    # Half of the interval of a scale factor: 0.02 %, or 0.05 % if lines are lost within one of the spins, so that it does not count.
    print([calibration["gyro"]["interval_C"][i][i] / calibration["gyro"]["C"][i][i] for i in range(3)])
    for i in range(3):
        assert calibration["gyro"]["interval_C"][i][i] < 1e-3 * abs(calibration["gyro"]["C"][i][i])


# A phone lies beside the board for ten seconds, when the session has had most of its poses.
FIELD = """[field]
size_ut = 50.0
dip_deg = 65.0
[[field.magnet]]
at_m = [0.25, 0.0, 0.05]
moment_am2 = [3.0, 0.0, 0.0]
from_s = 105.0
to_s = 115.0
"""


def test_a_magnetometer_is_calibrated_and_the_page_says_where_the_field_differs(usb, tmp_path):
    spoken = web_board.lines(tmp_path, field=FIELD)
    connect(usb, spoken)
    shown = usb.eval_on_selector_all("#line-columns select", "all => all.map(select => select.value)")
    assert ",".join(shown) == web_board.COLUMNS + ",mx,my,mz"
    usb.fill("#board-field", "50")
    begin(usb, 1000)
    usb.locator("#field-off", has_text="here than in the poses before").wait_for(timeout=100_000)
    if shots := os.environ.get("MIMU_SHOTS"):
        usb.screenshot(path=f"{shots}/field.png", full_page=True)
    usb.evaluate("board.perSecond = 4000")
    finished(usb)
    said = usb.inner_text("#log")
    assert "here than in the poses before: move away from the desk" in said, said
    assert "mag is judged" in said, said
    if shots:
        usb.screenshot(path=f"{shots}/mag.png", full_page=True)
    ours = journal(usb, tmp_path / "page")
    calibration = tomllib.loads((ours / "calibration.toml").read_text())
    web_board.assert_true(calibration)
    [mag] = calibration["body"]
    assert (mag["triad"], mag["unit"]) == ("mag", "uT")
    assert "mag" in json.loads(taken_away(usb, "fit.json"))["sensors"]


def test_a_session_that_is_unplugged_goes_on_and_the_command_ends_it(usb, lines, tmp_path):
    connect(usb, lines)
    begin(usb, 1000)
    reaches(usb, 4)
    usb.evaluate("board.unplug()")
    usb.locator("#reconnect").wait_for()
    usb.locator("#log", has_text="the port has vanished; check the cable").wait_for()
    # Once by hand, once by itself.
    usb.click("#reconnect")
    usb.locator("#error", has_text="another tab or program").wait_for()
    usb.evaluate("board.plug(false)")
    usb.click("#reconnect")
    reaches(usb, 6)
    usb.evaluate("board.unplug()")
    usb.locator("#reconnect").wait_for()
    usb.evaluate("board.plug(true)")
    usb.locator("#reconnect").wait_for(state="hidden")
    stopped_at(usb, 8)
    folder = journal(usb, tmp_path / "session")
    had = dwells(folder)
    assert len(had) >= 7
    assert sum(entry["entry"] == "interrupted" for entry in entries(folder)) >= 4
    board = web_board.Socket(lines)
    said = web_board.wizard(board.port, folder)
    board.close()
    assert "the session continues after" in said and "in use" in said, said
    assert dwells(folder)[: len(had)] == had
    web_board.assert_true(tomllib.loads((folder / "calibration.toml").read_text()))


def test_a_session_of_the_command_goes_on_in_the_page(usb, lines, tmp_path):
    folder = tmp_path / "session"
    board = web_board.Socket(lines)
    web_board.wizard(board.port, folder, until=lambda events: sum(e["event"] == "dwell" for e in events) >= 5)
    board.close()
    had = dwells(folder)
    assert len(had) >= 5
    with zipfile.ZipFile(tmp_path / "session.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for path in folder.rglob("*"):
            archive.write(path, path.relative_to(tmp_path))
    usb.set_input_files("#journal", tmp_path / "session.zip")
    usb.locator("#loaded", has_text=f"plane-7: {len(had)} dwells").wait_for()
    assert usb.input_value("#board-gravity") == "9.80665"
    usb.eval_on_selector_all("#board-form details", "all => all.forEach(d => d.open = true)")
    usb.fill("#more-wizard", "--warm-up 0 --as-planned --trust-clock")
    connect(usb, lines, settings=False)
    begin(usb)
    usb.locator("#log", has_text="the session continues after").wait_for(timeout=100_000)
    finished(usb)
    ours = journal(usb, tmp_path / "page")
    assert dwells(ours)[: len(had)] == had
    web_board.assert_true(tomllib.loads((ours / "calibration.toml").read_text()))


def test_a_session_that_was_stopped_goes_on_in_the_page(usb, lines, tmp_path):
    connect(usb, lines)
    begin(usb, 1000)
    stopped_at(usb, 4)
    usb.click("#go-on")
    usb.locator("#log", has_text="the session continues after").wait_for(timeout=100_000)
    reaches(usb, 6)
    usb.click("#redo")
    usb.locator("#log", has_text="will be repeated").wait_for(timeout=100_000)
    stopped_at(usb, 7)
    found = [entry["entry"] for entry in entries(journal(usb, tmp_path / "page"))]
    assert found.count("redo") == 1 and found.count("dwell") >= 7
    usb.set_input_files("#journal", tmp_path / "page" / "journal.jsonl")
    assert "this is no ZIP archive" in usb.inner_text("#error")


def test_axes_with_the_names_of_others_are_asked_about_and_end_the_session(usb, lines):
    connect(usb, lines)
    # In both sensors alike, so that only the poses show it.
    for at, name in enumerate(["ay", "az", "ax", "gy", "gz", "gx"], start=1):
        usb.select_option(f"#line-role-{at}", name)
    begin(usb)
    usb.wait_for_selector("#question:not([hidden])", timeout=100_000)
    assert "continue anyway?" in usb.inner_text("#question")
    usb.click("#no")
    usb.locator("#error", has_text="plane-7").wait_for(timeout=100_000)
    assert usb.is_hidden("#question")
    assert "stopped" in usb.inner_text("#prompt")


def test_garbage_is_shown_and_says_which_field_to_correct(usb, lines):
    usb.evaluate("board.garbage = '\\u00f3\\u0000x~\\u0080\\n'")
    usb.fill("#board-gravity", "9.80665")
    usb.click("#connect")
    usb.locator("#error", has_text="no line of the board has six numbers").wait_for(timeout=100_000)
    usb.locator("#error button", has_text="--baud").click()
    assert usb.evaluate("document.activeElement.id") == "baud"
    usb.fill("#baud", "9600")
    usb.evaluate("board.garbage = null")
    connect(usb, lines)
    assert usb.evaluate("board.opened") == [115200, 9600]
    # Garbage during a session is counted, and the session continues.
    begin(usb, 1000)
    reaches(usb, 2)
    usb.evaluate("board.garbage = '1,2,\\u00ff\\n'")
    usb.locator("#log li", has_text="lines are not data").nth(1).wait_for(timeout=100_000)
    usb.evaluate("board.garbage = null")
    stopped_at(usb, 4)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("board.held = true", "another tab or program, such as a serial monitor, holds it"),
        ("board.refused = true", "no port was chosen: plug the board in and connect again"),
        ("board.lines = []", "nothing has come from the board in 5 s"),
    ],
)
def test_a_port_that_fails_is_a_sentence_that_says_what_to_do(usb, fault, words):
    usb.evaluate(fault)
    usb.click("#connect")
    usb.wait_for_selector("#error:not([hidden])", timeout=100_000)
    line = usb.inner_text("#error")
    assert words in line and "\n" not in line


def test_gravity_is_asked_for_before_the_session_and_leads_to_its_field(usb, lines):
    connect(usb, lines)
    usb.fill("#board-gravity", "")
    usb.click("#line button.main")
    usb.locator("#error", has_text="local gravity is unknown").wait_for()
    usb.locator("#error button", has_text="--gravity").click()
    assert usb.evaluate("document.activeElement.id") == "board-gravity"


def test_a_browser_without_serial_ports_says_which_has_them(page):
    page.add_init_script("delete Navigator.prototype.serial")
    page.reload()
    assert "open this page in Chrome, Edge or Opera" in page.inner_text("#no-serial")
    assert page.is_disabled("#connect")
    # A journal and logs can be calibrated all the same.
    assert page.is_enabled("#journal") and page.is_enabled("#file")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_session_can_be_read_on_a_phone_and_a_desk(chromium, server, lines, scheme, tmp_path):
    for width in [360, 1280]:
        context = chromium.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page = context.new_page()
        page.add_init_script(web_board.MOCK)
        page.goto(server.url)
        connect(page, lines)
        assert page.evaluate(CLIPPED) == [], width
        assert page.evaluate(FAINT) == [], width
        begin(page)
        reaches(page, 10)
        assert page.evaluate(CLIPPED) == [], width
        assert page.evaluate(FAINT) == [], width
        assert page.locator("#aims tr").count() == 6
        context.close()
