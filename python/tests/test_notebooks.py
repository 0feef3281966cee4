"""The notebooks run from top to bottom."""

from __future__ import annotations

import os
from pathlib import Path

import nbformat
import pytest
from conftest import EXAMPLES
from nbclient import NotebookClient


def executed(name: str) -> str:
    """The text and HTML that the cells of a notebook show."""
    book = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    NotebookClient(book, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(EXAMPLES)}}).execute()
    outputs = [output for cell in book.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"], outputs
    shown = [output.get("text", "") or "".join(output.get("data", {}).values()) for output in outputs]
    return "\n".join(shown)


def test_the_session_by_hand(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MIMU_DATA", os.fspath(data.resolve()))
    shown = executed("by_hand")
    assert "gyro_g_sensitivity" in shown and '<div class="mimu">' in shown and "#ifndef" in shown


def test_the_unit_over_temperature() -> None:
    shown = executed("over_temperature")
    assert "true 25.0 s" in shown and '<div class="mimu">' in shown
