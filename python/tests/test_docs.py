"""The lines of docs/python.md print what the page shows."""

from __future__ import annotations

import doctest

import mimu
from conftest import ROOT


def test_the_lines_of_the_page_show_what_it_says(by_hand: mimu.Recording) -> None:
    page = (ROOT / "docs" / "python.md").read_text()
    code = page.split("```python\n")[1].split("```")[0]
    session = page.split("```pycon\n")[1].split("```")[0]
    names: dict[str, object] = {"t": by_hand.t, "gyro": by_hand.gyro, "accel": by_hand.accel}
    exec(code, names)
    test = doctest.DocTestParser().get_doctest(session, names, "python.md", None, None)
    failed, tried = doctest.DocTestRunner(verbose=False).run(test)
    assert tried == 6 and failed == 0
