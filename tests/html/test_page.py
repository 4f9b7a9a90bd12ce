"""A report: one well-formed, self-contained file with numbers, curves and section of runs."""

from __future__ import annotations

import base64
import json
import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from synthetic_run import write_run

from castfem.base.errors import InputError
from castfem.cli import execute
from castfem.model import load_case
from castfem.model.shipped_cases import find
from castfem.post.html.graphics import Series, chart, sections
from castfem.post.html.page import LARGEST, write
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import read_history
from castfem.runs.results.run_case import error_lines as lines

NAMESPACE = "{http://www.w3.org/1999/xhtml}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("report") / "one")


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return write([folder], folder / "report.html").read_text(encoding="utf-8")


def parsed(text: str) -> ElementTree.Element:
    return ElementTree.fromstring(text.replace("<!DOCTYPE html>", ""))


def test_page_is_well_formed_and_self_contained(page: str) -> None:
    root = parsed(page)
    ids = [element.get("id") for element in root.iter() if element.get("id")]
    assert len(ids) == len(set(ids)) > 4
    for element in root.iter():
        for name in ("href", "src"):
            value = element.get(name)
            assert value is None or value.startswith(("#", "data:")), value
            if value is not None and value.startswith("#"):
                assert value[1:] in ids
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org/1999/xhtml)", page)
    assert len(page.encode()) < LARGEST


def test_every_image_has_a_description(page: str) -> None:
    for element in parsed(page).iter():
        if element.get("role") == "img":
            assert element.get("aria-label")


def test_label_belongs_to_one_control(page: str) -> None:
    controls = {f"{NAMESPACE}{name}" for name in ("input", "select", "output", "progress")}
    labels = list(parsed(page).iter(f"{NAMESPACE}label"))
    assert labels
    assert all(sum(e.tag in controls for e in label.iter()) == 1 for label in labels)


def test_numbers_are_those_of_the_run(folder: Path, page: str) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    text = re.sub(r"<[^>]+>", " ", page)
    label = next(iter(summary["quantities"].values()))["label"]
    assert summary["title"] in text and "finished" in text
    assert label.partition(",")[0] in text
    found = parsed(page).iter(f"{NAMESPACE}tr")
    rows = [row for row in found if row.find(f"{NAMESPACE}td") is not None]
    assert len(rows) > 5


def test_curves_contain_the_history_for_the_pointer(folder: Path, page: str) -> None:
    from castfem.runs.output.history import read_history

    table = read_history(folder / "history.csv")
    scripts = [
        e
        for e in parsed(page).iter(f"{NAMESPACE}script")
        if (e.get("id") or "").startswith("chart")
    ]
    assert scripts
    known = [json.loads(script.text or "") for script in scripts]
    shell = table["shell_mid_face"].to_numpy()
    ends = [curve["y"][-1] for one in known for curve in one["curves"]]
    assert any(end == pytest.approx(shell[-1], rel=1e-4) for end in ends if end is not None)
    assert all(one["x"][1] == pytest.approx(table["position"].iloc[-1]) for one in known)


def test_section_shows_the_fields(folder: Path) -> None:
    (found,) = sections([folder])
    with Fields(folder) as fields:
        cells, last = fields.cells, fields.values("temperature", -1)
    assert len(found.polygons) == len(cells) and len(found.mirrors) == 4
    first = found.fields[0]
    levels = np.frombuffer(base64.b64decode(first["values"]), dtype="<u2")
    levels = levels.reshape(len(found.places), len(cells))[-1]
    mean = last[cells[:, :4]].mean(axis=1) - 273.15
    shown = first["low"] + (first["high"] - first["low"]) * levels / 65535
    assert shown == pytest.approx(mean, abs=0.05)


def test_sections_of_several_runs_have_one_colour_scale(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "hotter"
    shutil.copytree(folder, other)
    with h5py.File(other / "fields.h5", "r+") as file:
        for step in file["steps"].values():
            step["temperature"][...] += 50.0
    (single,) = sections([folder])
    both = sections([folder, other])
    low, high = single.fields[0]["low"], single.fields[0]["high"]
    for one in both:
        first = one.fields[0]
        assert first["name"] == "temperature" and first["low"] == low
        assert first["high"] == pytest.approx(high + 50.0, rel=1e-5)
        shown = [float(end) for end in first["ends"]]
        assert shown == pytest.approx([low, high + 50.0], abs=0.51)


def test_several_runs_side_by_side(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    changed = (other / "case.toml").read_text() + "\n[added]\nkey = 5\n"
    (other / "case.toml").write_text(changed)
    summary = json.loads((other / "summary.json").read_text())
    name = "shell_mid_face"
    summary["quantities"][name]["value"] *= 2.0
    next(c for c in summary["references"] if c["quantity"] == name)["ours"] *= 2.0
    (other / "summary.json").write_text(json.dumps(summary))
    root = parsed(write([folder, other], tmp_path / "both.html").read_text(encoding="utf-8"))
    differing = [e for e in root.iter(f"{NAMESPACE}tr") if e.get("class") == "differs"]
    assert len(differing) == 1
    assert any(e.text == "added.key" for e in root.iter(f"{NAMESPACE}th"))


def test_page_of_many_runs_stays_small(tmp_path: Path) -> None:
    """Curves have fewer points and sections fewer places; the ends are kept."""
    folder = write_run(tmp_path / "one", steps=300)
    folders = [tmp_path / f"run{i:02d}" for i in range(36)]
    for other in folders:
        shutil.copytree(folder, other, ignore=shutil.ignore_patterns("figures"))
    page = write(folders, tmp_path / "many.html")
    assert page.stat().st_size < LARGEST
    text = page.read_text(encoding="utf-8")
    root = parsed(text)
    one = next(e for e in root.iter(f"{NAMESPACE}script") if e.get("id") == "chart0")
    curves = json.loads(one.text or "")["curves"]
    assert len(curves) == 36 and curves[0]["x"][-1] == pytest.approx(0.6)
    (whole,), (few, *_) = sections([folder]), sections([folder] * 24)
    assert whole is not None and few is not None and few.places == whole.places[-1:]


def test_text_of_a_case_ends_no_script(folder: Path, tmp_path: Path) -> None:
    """A title is data, not markup."""
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    summary = json.loads((other / "summary.json").read_text())
    summary["title"] = "</title><script>alert(1)</script> & more"
    (other / "summary.json").write_text(json.dumps(summary))
    root = parsed(write([other], tmp_path / "odd.html").read_text(encoding="utf-8"))
    heading = next(root.iter(f"{NAMESPACE}h1"))
    assert heading.text == summary["title"]


def test_chart_has_ticks_and_breaks_at_missing_values() -> None:
    x = np.linspace(0.0, 2.0, 5)
    found = chart(
        "t", "y [mm]", [Series("a", "#000", "", x, np.array([1, 2, np.nan, 4, 5.0]))], zero=True
    )
    assert found.lines[0]["path"].count("M") == 2
    assert found.up[0].text == "0" and found.data["curves"][0]["y"][2] is None
    flat = chart("t", "y", [Series("a", "#000", "", x, np.full(5, 3.0))], zero=False)
    assert flat.data["y"][0] < 3.0 < flat.data["y"][1]


def test_requested_places_have_their_own_tables(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "at.html"
    assert (
        execute(["report", str(folder), "-o", str(target), "--at", "300 mm", "--at", "0.2 m"]) == 0
    )
    root = parsed(target.read_text(encoding="utf-8"))
    table = read_history(folder / "history.csv")
    for number, position in enumerate((0.3, 0.2)):
        (place,) = (e for e in root.iter() if e.get("id") == f"place{number}")
        rows = {
            "".join(row[0].itertext()): "".join(row[1].itertext())
            for row in place.iter(f"{NAMESPACE}tr")
        }
        label = f"shell, mid-face, at {1e3 * position:g} mm"
        depth = float(np.interp(position, table["position"], table["shell_mid_face"]))
        assert float(rows[label]) == pytest.approx(depth, abs=6e-3)
    links = [e.get("href") for e in root.iter(f"{NAMESPACE}a")]
    assert {"#numbers", "#place0", "#place1"} <= set(links)


def test_place_not_reached_by_any_run_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has not reached 7 m"):
        write([folder], tmp_path / "at.html", (7.0,))


BILLET = 'docs/billet.md, "Error of the shipped default"'


@pytest.fixture
def ran(tmp_path):
    """Return a function that writes the folder of a run of a shipped case, with changes."""

    def _ran(name: str, *changes: str):
        folder = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        (folder / "case.toml").write_text(load_case(find(name), changes).resolved_toml())
        return folder

    return _ran


def test_shipped_case_names_the_page_of_its_errors(ran):
    assert lines({"": ran("billet125/taper_1")}) == [f"errors of these numbers: {BILLET}"]
    assert lines({"": ran("billet125/thermal", "output.figures=false")}) == [
        "errors of these numbers: docs/benchmarks.md"
    ]


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("taper_1", ["mesh.surface_size=1.2 mm"]), ("taper_1", ["coupling.interval=0.2 s"]),
        ("taper_1", ["casting.length=1 m"]), ("taper_1", ["title=mine"]), ("mechanics_first", []),
    ],
)  # fmt: skip
def test_changed_case_has_no_tabulated_errors(ran, name, changes):
    assert lines({"": ran(f"billet125/{name}", *changes)}) == []


def test_runs_without_tabulated_errors_are_left_out(ran, tmp_path):
    runs = {"one": ran("billet125/taper_1"), "other": ran("verification/neumann"), "no": tmp_path}
    assert lines(runs) == [f"errors of these numbers, of one: {BILLET}"]
