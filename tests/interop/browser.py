"""The page of `make web` in a browser, and its results beside those of the command."""
import functools
import http.server
import os
import pathlib
import shutil
import threading

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PAGE = os.environ.get("MIMU_PAGE")
needs_page = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on the PATH"),
    pytest.mark.skipif(PAGE is None, reason="no page is given: make web-tests"),
]
# For a computation on a busy machine, ms.
PATIENCE = 300_000


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Static files with the MIME types that a browser requires."""

    extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".wasm": "application/wasm", ".js": "text/javascript"}

    def log_message(self, *_):
        pass


class Server:
    """Serves the page like any web server."""

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
    """The page, freshly loaded. A console message, a script error or a request to another server fails the test."""
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
    assert said == [], said


def taken_away(page, name):
    """Contents of a file that the page offers."""
    with page.expect_download() as download:
        page.get_by_role("button", name=name, exact=True).click()
    return pathlib.Path(download.value.path()).read_bytes()


def numbers(ours, theirs, path=""):
    """All numbers of two results of one layout, as (place, ours, theirs). Words and keys must be equal."""
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
    """Asserts that results of the page equal the command's, apart from the last digits of computations with rounding.

    The dwells are equal to the bit. Products of matrices are fused on a PC that can, and sine, exponential and logarithm are another
    library's: parameters then differ by 1e-15 of their size, and residuals, which are small differences of large numbers, by up to 2e-6.
    """
    pairs = numbers(ours, theirs)
    other = [(abs(a - b) / max(abs(a), abs(b)), path, a, b) for path, a, b in pairs if a != b]
    parts = {"dwells": 0.0, "residuals, and what is drawn of them": 1e-5, "others": 1e-9}
    of = lambda path: next((p for p in parts if p[:8] in path), "residuals, and what is drawn of them" if "picture" in path else "others")  # noqa: E731
    for part, most in parts.items():
        found = [one for one in other if of(one[1]) == part]
        print(f"{what}, {part}: {len(found)} of {sum(of(p) == part for p, _, _ in pairs)} numbers differ; most {max(found, default='none')}")
        for difference, path, a, b in found:
            assert difference < most or abs(a - b) < 1e-15, (path, a, b)
