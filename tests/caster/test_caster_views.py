"""The strand of a caster at moments, at fixed places, in maps, in text and on its page."""

from __future__ import annotations

import itertools
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from rolled_case import rolled
from small_caster import STOP, caster
from test_caster_run import Halted

import castfem
from castfem.base.errors import InputError
from castfem.cli import execute
from castfem.model import Case, load_case, shipped_cases
from castfem.model.build.simulation import case_steel
from castfem.model.caster_slices import by_plant, slice_of, starts_of
from castfem.model.machine import thickness_of
from castfem.physics.machine.side import Side
from castfem.post.plots.caster_figures import _look_of as look_of
from castfem.post.plots.caster_figures import mapped, middle_of, moments_figure, reheated
from castfem.post.report.caster import _leaving, answers, pieces_in_band
from castfem.runs.caster.files import read_table
from castfem.runs.caster.run import run_caster
from castfem.runs.interrupt import Stopped
from castfem.runs.output.history import read_columns

PYROMETERS = [
    {"name": "exit", "at": "150 mm"},
    {"name": "edge", "at": "60 mm", "on": "corner"},
]
SHORT = {"time": ["0 s", "0.5 s", "1 s", "2 s"], "event": None}
REQUESTED = {
    "caster.pyrometer": PYROMETERS,
    "caster.moments": ["0 s", "4.2 s", "9 s"],
    "caster.cut": "0.1 m",
}


@pytest.fixture(scope="module")
def looked_at(tmp_path_factory: pytest.TempPathFactory) -> tuple[Case, Path]:
    """Return a caster with all kinds of records, and its folder."""
    case, folder = caster(REQUESTED), tmp_path_factory.mktemp("looked_at")
    run_caster(case, folder)
    return case, folder


def test_pyrometer_records_each_slice_as_it_passes(looked_at: Any, tmp_path: Path) -> None:
    case, folder = looked_at
    seen, units, words = read_table(folder / "pyrometers.csv")
    assert units["surface_temperature"] == "degC" and units["time"] == "s"
    assert set(words["pyrometer"]) == {"exit", "edge"} and len(seen["time"]) > 15
    assert (np.diff(seen["time"]) >= 0.0).sum() > 0.8 * len(seen["time"])
    number = 9
    run = castfem.run(slice_of(by_plant(case), starts_of(case)[number - 1]), tmp_path)
    history = read_columns(tmp_path / "history.csv")  # all steps of that slice
    for name, column, place in (("exit", "mid_face", 0.15), ("edge", "corner", 0.06)):
        (i,) = np.flatnonzero((seen["slice"] == number) & (np.array(words["pyrometer"]) == name))
        assert seen["position"][i] == place
        age = run.case.casting.travel.time_at(place)
        assert seen["time"][i] == pytest.approx(starts_of(case)[number - 1] + age, abs=1e-9)
        expected = np.interp(age, history["time"], history[f"surface_temperature_{column}"])
        assert seen["surface_temperature"][i] == pytest.approx(expected, abs=1e-3)


def test_moments_are_interpolated_between_the_slices(looked_at: Any) -> None:
    _, folder = looked_at
    listed = ET.parse(folder / "strand.pvd").getroot().iter("DataSet")
    assert [float(one.attrib["timestep"]) for one in listed] == [0.0, 4.5, 9.0]
    strand, _, _ = read_table(folder / "strand.csv")
    mesh = meshio.read(folder / "moments" / "strand_4.5s.vtu")
    position, celsius = mesh.point_data["position"], mesh.point_data["temperature"] - 273.15
    for row in np.flatnonzero(strand["clock"] == 4.5):
        here = np.abs(position - strand["position"][row]) < 1e-6
        assert here.sum() > 10
        assert celsius[here].min() == pytest.approx(strand["temperature_min"][row], abs=2e-3)
        assert celsius[here].max() == pytest.approx(strand["temperature_max"][row], abs=2e-3)
        assert mesh.points[here, 2] == pytest.approx(-strand["position"][row], abs=1e-6)
    spans = np.ptp(mesh.points, axis=0)[:2]
    assert spans == pytest.approx([0.05, 0.05], abs=1e-6)  # a quarter of the billet of 100 mm


def test_strand_of_a_moment_begins_at_the_meniscus(looked_at: Any, tmp_path: Path) -> None:
    """There it is as poured; at a stop, or with a tail, it begins at its youngest slice."""
    case, folder = looked_at
    strand, _, _ = read_table(folder / "strand.csv")
    youngest = strand["position"][strand["clock"] == 4.5].min()
    mesh = meshio.read(folder / "moments" / "strand_4.5s.vtu")
    position, kelvin = mesh.point_data["position"], mesh.point_data["temperature"]
    poured = kelvin[position == 0.0]
    assert youngest > 0.01 and len(poured) > 10
    assert poured == pytest.approx(case_steel(case).liquidus + 30.0, abs=1e-3)  # half way, 4 to 5 s
    between = (position > 0.0) & (position < youngest - 1e-6)
    assert not between.any()  # the distance is less than 0.1 m
    for name, more in (
        ("stop", caster({"caster.moments": ["1.5 s"], "caster.end": "2 s"}, STOP)),
        ("tail", caster({"caster.moments": ["1.5 s"], "caster.cast_until": "1 s"}, SHORT)),
    ):
        run_caster(more, tmp_path / name)
        mesh = meshio.read(tmp_path / name / "moments" / "strand_1.5s.vtu")
        strand, _, _ = read_table(tmp_path / name / "strand.csv")
        youngest = strand["position"][strand["clock"] == 1.5].min()
        assert mesh.point_data["position"].min() == pytest.approx(youngest, abs=1e-6) != 0.0


def test_stop_does_not_change_the_records(looked_at: Any, tmp_path: Path) -> None:
    _, folder = looked_at
    with pytest.raises(Stopped):
        run_caster(caster(REQUESTED), tmp_path, progress=Halted(43, Stopped))
    run_caster(caster(REQUESTED), tmp_path, resume=True)
    names = ["pyrometers.csv", "strand.pvd", "strand.csv"]
    names += [f"moments/{path.name}" for path in (folder / "moments").iterdir()]
    for name in names:
        assert (folder / name).read_bytes() == (tmp_path / name).read_bytes(), name
    run_caster(caster(), tmp_path)  # another case: all earlier records are removed
    assert not any((tmp_path / name).exists() for name in ("pyrometers.csv", "strand.pvd"))
    assert not list((tmp_path / "moments").iterdir())


def test_bent_strand_follows_its_machine(tmp_path: Path) -> None:
    segments = [
        {"rolls": 1, "pitch": "200 mm", "diameter": "120 mm"},
        {"rolls": 4, "pitch": "200 mm", "diameter": "120 mm", "radius": "3 m"},
    ]
    plant = {"time": ["0 s", "4 s"], "speed": ["1.5 m/min"] * 2}
    case = rolled(
        machine={"first": "300 mm", "segment": segments}, secondary=None,
        caster={"plant": plant, "spacing": "0.3 m", "every": "2 s", "moments": ["2 s"]},
        cooling__0__to=None,
    )  # fmt: skip
    run_caster(case, tmp_path)
    mesh = meshio.read(tmp_path / "moments" / "strand_2s.vtu")
    thickness = thickness_of(case.section)
    assert case.machine is not None and thickness is not None
    side = Side(case.machine.pairs(), thickness, case.casting.length)
    low = mesh.point_data["position"].max()
    here = mesh.points[mesh.point_data["position"] == low]
    faces = [side.at(face, float(low)) for face in (side.extrados, side.intrados)]
    for face in faces:
        away = np.linalg.norm(here[:, [0, 2]] - face, axis=1)
        assert away.min() < 1e-5
    assert faces[1][1] - faces[0][1] > 1e-3  # it has left the vertical
    points, temperature, solid = middle_of(tmp_path / "moments" / "strand_2s.vtu")
    assert points.shape[:2] == temperature.shape == solid.shape
    assert (np.diff(points[0, :, 0]) > 0.0).all()


def test_moments_of_a_straight_strand_are_side_by_side(looked_at: Any) -> None:
    case, folder = looked_at
    figure = moments_figure(folder, case)
    figure.draw_without_rendering()  # lays it out
    panels = [axes.get_position() for axes in figure.axes[:3]]
    assert len({round(panel.y0, 6) for panel in panels}) == 1
    assert all(one.x1 < other.x0 for one, other in itertools.pairwise(panels))
    assert sum(panel.width for panel in panels) > 0.5  # of the page


def test_reheating_is_above_the_lowest_so_far() -> None:
    strand = {
        "slice": np.array([1.0, 2, 1, 2, 1, 1, 3, 3]),
        "clock": np.array([0.0, 0, 2, 2, 1, 3, 2, 3]),
        "position": np.array([0.1, 0.6, 0.8, 0.9, 0.7, 0.9, 0.6, 0.8]),
        "t": np.array([500.0, 900.0, 850.0, 950.0, 800.0, 790.0, 700.0, 730.0]),
    }  # fmt: skip
    found = reheated(strand, "t", 0.5)
    assert found[[0, 2, 4, 5]].tolist() == [0.0, 50.0, 0.0, 0.0]
    assert np.isnan(found[[1, 3]]).all()  # the earlier state of that slice is not known
    assert found[[6, 7]].tolist() == [0.0, 30.0]  # it has passed the mould between two instants


def test_mechanics_are_mapped_if_present(looked_at: Any) -> None:
    _, folder = looked_at
    strand, _, _ = read_table(folder / "strand.csv")
    none, some = np.zeros(len(strand["clock"])), np.linspace(0.0, 9.0, len(strand["clock"]))
    more = {"I1_max": some, "I2_max": none, "bulge_intrados": some, "roll_force": none * np.nan}
    thermal, found = mapped(strand, 0.1), mapped({**strand, **more}, 0.1)
    assert set(found) == {*thermal, "I1_max", "bulge_intrados"}
    assert found["I1_max"] is some
    label, ticks = look_of("I1_max", some, (1073.15, 1223.15))[1:]
    assert label == "I1, axial tension in the band [MPa]" and not ticks


def test_pieces_within_the_band_in_the_straightener() -> None:
    case = load_case(shipped_cases.find("slab1200/ladle_change"), ['caster.cut="8 m"'])
    # At 1.2 m/min a piece leaves the meniscus in 400 s; straightening is from 14.27 to 16.83 m.
    strand = {
        "clock": np.array([700.0, 800.0, 900.0, 1000.0]),
        "time": np.array([750.0, 790.0, 400.0, 570.0]),  # left at -50, 10, 500 and 430 s
        "position": np.array([15.0, 15.0, 17.5, 16.0]),
        "surface_temperature_corner_intrados": np.array([900.0, 840.0, 900.0, 960.0]),
        "surface_temperature_narrow_face": np.array([990.0, 990.0, 990.0, 990.0]),
    }
    events = [(720.0, "ladle closed")]
    found = list(pieces_in_band(strand, case, events))
    assert len(found) == 2
    assert "intrados: pieces 0 to 1 of 8 m within 800 °C to 950 °C" in found[0]
    assert "which has 840 °C to 960 °C" in found[0]
    assert "first at 700 s; last at 800 s" in found[0] and "14.27 to 16.83 m" in found[0]
    assert "narrow face: no piece is within" in found[1] and "has 990 °C to 990 °C" in found[1]
    strand["surface_temperature_narrow_face"][:] = 850.0
    assert "narrow face: all that pass: pieces 0 to 2 of 8 m" in list(
        pieces_in_band(strand, case, events)
    )[1]  # fmt: skip
    strand["surface_temperature_corner_intrados"][:] = [960.0, 940.0, 900.0, 940.0]
    text = next(pieces_in_band(strand, case, events))
    assert "pieces 1 to 2 of 8 m" in text
    assert "first at 800 s, 80 s after: ladle closed; last at 1000 s" in text
    assert not list(
        pieces_in_band(strand, load_case(shipped_cases.find("slab1200/ladle_change")), ())
    )


def test_events_before_an_answer_are_named(looked_at: Any) -> None:
    case, folder = looked_at
    lines = answers(folder, case)
    assert "first at 0 s and last at 9 s" in lines[0] and "after" not in lines[0]
    assert "4 s: ladle change" in lines
    between = caster(REQUESTED, {"time": ["0 s", "3.8 s", "5 s", "9 s"]})  # two looks at the strand
    assert "3.8 s: ladle change" in answers(folder, between)
    later = caster(REQUESTED, {"time": ["0 s", "9.5 s", "10 s", "11 s"]})
    assert not any("ladle change" in line for line in answers(folder, later))
    from castfem.post.report.caster import _after

    assert _after(4.0, [(1.0, "a"), (3.5, "b"), (5.0, "c")]) == ", 0.5 s after: b"


def test_leaving_times_are_rounded_to_a_microsecond() -> None:
    """Start and duration of the first add up to 0 s up to rounding."""
    left = np.array([-48.0 + 1.2 / 0.025 - 7.1e-15, 13.0])
    (text,) = _leaving({"left": left, "surface_temperature_corner": np.array([1219.0, 1229.0])})
    assert text.endswith("from 1219 °C at 0 s to 1229 °C at 13 s")


def test_page_contains_the_strand(looked_at: Any, capsys: pytest.CaptureFixture[str]) -> None:
    _, folder = looked_at
    assert execute(["report", str(folder)]) == 0 and "report.html" in capsys.readouterr().out
    text = (folder / "report.html").read_text()
    assert not re.search(r'(src|href)="(?!data:|#)', text) and "<script src" not in text
    found = re.search(r'<script type="application/json" id="strand">(.*?)</script>', text)
    data = json.loads(found[1])
    strand, _, _ = read_table(folder / "strand.csv")
    clocks = np.unique(strand["clock"])
    assert len(data["instants"]) == len(data["heads"]) == len(clocks) == 19
    ends = [-1.0 if end is None else end for end in data["pool"]]
    assert f'value="{ends.index(max(ends))}"' in text  # it opens at the longest pool
    rows = np.flatnonzero(strand["clock"] == clocks[12])
    shown = data["instants"][12]
    for name in ("shell_mid_face", "surface_temperature_corner"):
        order = rows[np.argsort(strand["position"][rows])]
        assert shown[name] == pytest.approx(strand[name][order], rel=1e-3)
    assert "ladle change" in data["heads"][8] and "ladle change" not in data["heads"][9]
    assert execute(["report", str(folder), "--at", "0.1 m"]) == 1
    assert "use a pyrometer" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"caster.moments": ["10 s"]}, "caster.moments: .*the run goes from 0 s to 9 s"),
        ({"caster.pyrometer": [{"name": "a", "at": "1 m"}]}, "followed to 0.2 m"),
        ({"caster.pyrometer": [{"name": "a", "at": "0.1 m"}] * 2}, "'a' appears twice"),
    ],
)
def test_invalid_input_is_rejected(changes: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        caster(changes)


def test_place_missing_on_the_surface_is_refused(tmp_path: Path) -> None:
    case = caster({"caster.pyrometer": [{"name": "a", "at": "0.1 m", "on": "moon"}]})
    with pytest.raises(InputError, match=r"caster.pyrometer.0.on: 'moon': one of mid_face, "):
        run_caster(case, tmp_path)
