"""The notebooks of the manual run, block after block, and print what stands below each block."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

PAGES = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.md"))
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.M | re.S)
NUMBER = re.compile(r"\d+(?:\.\d+)?")


def parts(text: str) -> tuple[list[str], list[float]]:
    """The words of a text, and its numbers."""
    return NUMBER.sub("#", text).split(), [float(one) for one in NUMBER.findall(text)]


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if page.stem != "index"], ids=str)
def test_a_notebook_runs_and_prints_what_it_shows(
    page: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    assert sum(bool(shown) for _, shown in blocks) >= 1
    names: dict[str, object] = {"__name__": "notebook"}
    for number, (code, shown) in enumerate(blocks, start=1):
        exec(compile(code, f"{page.name}, block {number}", "exec"), names)
        (words, values), (theirs, expected) = parts(capsys.readouterr().out), parts(shown)
        assert words == theirs
        assert values == pytest.approx(expected, rel=0.02)  # versions of the libraries differ
    plt.close("all")
