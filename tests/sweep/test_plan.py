"""The runs of a sweep, and input that is refused before the first run."""

from __future__ import annotations

import pytest
from small_case import write_small

import castfem
from castfem.base.shown_quantity import Quantity
from castfem.post.compare.study_tables import sweep_table
from castfem.studies.sweep.plan import brief, plan, run_name, split_values
from castfem.studies.sweep.record import Row


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    return castfem.load(write_small(tmp_path_factory.mktemp("case")))


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("1 %/m,2 %/m", ("1 %/m", "2 %/m")),
        ("-1 K, 3 W/(m^2 K)", ("-1 K", "3 W/(m^2 K)")),
        ('["a", "b"],[]', ('["a", "b"]', "[]")),
        ('"one, two",three', ('"one, two"', "three")),
        ("{ a = 1, b = 2 }", ("{ a = 1, b = 2 }",)),
        ("1,", ("1", "")),
    ],
)
def test_split_values(text, parts):
    assert split_values(text) == parts


def test_product(base):
    variants = plan(base, ["speed=3 m/min,4 m/min", "superheat=20 K,30 K,40 K", "order=2"])
    assert [(v.case.casting.speed * 60, v.case.casting.superheat) for v in variants] == [
        pytest.approx(pair) for pair in [(3, 20), (3, 30), (3, 40), (4, 20), (4, 30), (4, 40)]
    ]
    assert all(v.case.mesh.order == 2 for v in variants)
    first = variants[0]
    assert first.given == {"casting.speed": "3 m/min", "casting.superheat": "20 K"}
    assert first.name == "speed_3_m_min__superheat_20_K"


def test_names_do_not_change_when_values_are_added(base):
    few = plan(base, ["speed=3 m/min,4 m/min"])
    more = plan(base, ["speed=2 m/min,3 m/min,4 m/min"])
    assert {v.name for v in few} < {v.name for v in more}


def test_table(base, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text(
        "name, speed [m/min], superheat [K], steel.name\n"
        "# a remark\n"
        "slow and cold, 3, 20, carbon_042\n"
        "fast, 0.07 m/s, , carbon_042\n"
    )
    slow, fast = plan(base, [], table)
    assert (slow.name, fast.name) == ("slow_and_cold", "fast")
    assert slow.case.casting.speed == pytest.approx(0.05)
    assert fast.case.casting.speed == pytest.approx(0.07)
    assert (slow.case.casting.superheat, fast.case.casting.superheat) == (20.0, 40.0)
    assert slow.given == {"casting.speed": "3 m/min", "casting.superheat": "20 K"}
    assert fast.given == {"casting.speed": "0.07 m/s", "casting.superheat": ""}


def test_table_times_values(base, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text("name,speed [m/min]\nslow,3\nfast,4\n")
    names = [v.name for v in plan(base, ["superheat=20 K,30 K"], table)]
    assert names == [
        "slow__superheat_20_K", "slow__superheat_30_K",
        "fast__superheat_20_K", "fast__superheat_30_K",
    ]  # fmt: skip


def test_labels_are_the_names_as_written(base, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text("name,speed [m/min]\nslow & cold,3\n,4\n")
    first, second, third, _ = plan(base, ["superheat=20 K,30 K"], table)
    assert first.label == "slow & cold, superheat 20 K"
    assert second.label == "slow & cold, superheat 30 K"
    assert third.label == ""
    assert brief({"mould.taper": '{top="2 %/m", exit="0.4 %/m"}', "speed": ""}) == [
        'taper {top="2 %/m", exit=" ...'
    ]


def test_equal_rows_are_refused(base, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text("speed [m/min],superheat [K]\n3,20\n4,20\n3,20\n")
    (problem,) = _problems(base, table=table)
    assert problem == "two runs would be the same: speed_3_m_min"


def test_awkward_names():
    assert run_name({"mould.taper": "-1 %/m"}) == "taper_-1_percent_m"
    assert run_name({"a.x": "../..", "b.x": "1"}) == "a.x_default__b.x_1"
    long = run_name({"a.b": "x" * 300})
    assert len(long) <= 100
    assert long != run_name({"a.b": "x" * 301})


def _problems(base, *assignments, table=None) -> tuple[str, ...]:
    with pytest.raises(castfem.InputError) as caught:
        plan(base, assignments, table)
    return caught.value.problems


def test_all_bad_values_are_reported_once(base):
    """Six runs, five of them bad, for two reasons."""
    problems = _problems(base, "speed=3 m/min,3", "superheat=20 K,-5 K,30 K")
    assert len(problems) == 2
    assert sum("sweep: casting.speed: a speed needs its unit" in line for line in problems) == 1
    assert sum("sweep: casting.superheat: " in line and "-5 K" in line for line in problems) == 1


@pytest.mark.parametrize(
    ("assignments", "message"),
    [
        ((), "nothing to sweep"),
        (("speed=3 m/min,",), "a value is missing"),
        (("speed=3 m/min", "casting.speed=4 m/min"), "casting.speed is given twice"),
        (("nosuch=1,2",), "no table of the case has a key of this name"),
        (("steel.name=nosuch,carbon_042",), "nosuch"),
    ],
)
def test_invalid_values_are_refused(base, assignments, message):
    (problem,) = _problems(base, *assignments)
    assert message in problem


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "needs a header"),
        ("speed [m/min],sped [m/min]\n1,2\n", "column sped: no table"),
        (
            "speed [m/min],casting.speed [m/min]\n1,2\n",
            "line 1: two columns are of casting.speed; leave one out",
        ),
        ("name,order\na,{ a=1, b=2 }\n", "run 1 has 3 cells, the header 2 (put a cell with commas"),
        ("name,order\na,1\nb,2\na,2\n", "line 4: two rows are named a"),
        ("name,order\na,1\n.,2\n", 'line 3: the name "." cannot name a folder; give it let'),
        ("name,order\n/,1\n", 'line 2: the name "/" cannot name a folder'),
        (
            "name,order\nsweep.csv,1\n",
            'line 2: the name "sweep.csv" is reserved for files of the sweep',
        ),
        ("speed [m/min]\n3 kg\n", "run 1: casting.speed: "),
    ],
)
def test_bad_table(base, tmp_path, text, message):
    table = tmp_path / "runs.csv"
    table.write_text(text)
    (problem,) = _problems(base, table=table)
    assert message in problem
    assert problem.startswith(f"{table}: ")


TAPERS = {
    "semicolons": """
name; mould.taper
single; 1 %/m
double; [{ to = "30 mm", taper = "2 %/m" }, { taper = "0.8 %/m" }]
parabola; { top = "2 %/m", exit = "0.4 %/m" }
""",
    "doubled quotes": """
name, mould.taper
single, 1 %/m
double, "[{ to = ""30 mm"", taper = ""2 %/m"" }, { taper = ""0.8 %/m"" }]"
parabola, "{ top = ""2 %/m"", exit = ""0.4 %/m"" }"
""",
}


@pytest.mark.parametrize("text", TAPERS.values(), ids=TAPERS)
def test_tapers_of_several_values(tmp_path, text):
    table = tmp_path / "runs.csv"
    table.write_text(text)
    found = plan(castfem.load("billet125/taper_0"), [], table)
    tapers = [v.case.mould.taper.face.segments for v in found]
    assert [[(s.end, s.top, s.bottom) for s in taper] for taper in tapers] == [
        [(None, 0.01, 0.01)],
        [(0.03, 0.02, 0.02), (None, 0.008, 0.008)],
        [(None, 0.02, 0.004)],
    ]


def test_faults_of_table_and_set_have_their_source(base, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text("speed [m/min]\n3\n4 kg\n")
    problems = _problems(base, "superheat=20 K,-5 K", table=table)
    assert [p.partition(": casting")[0] for p in problems] == ["sweep", f"{table}: run 2"]


def test_key_in_table_and_set_is_refused(base, tmp_path):
    table = tmp_path / "runs.csv"
    table.write_text("speed [m/min]\n3\n4\n")
    (problem,) = _problems(base, "speed=3 m/min,4 m/min", table=table)
    assert "casting.speed is also given by --set" in problem


GIVEN = {
    "casting.speed": "{} m/min", "casting.superheat": "40 K", "mould.taper": "1 percent/m",
    "cooling.mould.surface.0.coefficient": "1600 W/(m^2 K)", "mesh.surface_size": "0.8 mm",
    "coupling.interval": "0.1 s",
}  # fmt: skip
RESULTS = {
    "shell_mid_face": Quantity(4.8e-3, "mm", "shell, mid-face"),
    "surface_temperature_mid_face": Quantity(1500.0, "degC", "surface, mid-face"),
    "heat_removed": Quantity(2.4e6, "MJ/m", "heat removed per m"),
    "mould_mean_flux": Quantity(1.9e6, "kW/m^2", "mean heat flux in the mould"),
    "shell_least": Quantity(4.1e-3, "mm", "thinnest shell, mould exit"),
    "contact_lost": Quantity(0.3, "mm", "contact lost at"),
    "contact_regained": Quantity(0.4, "mm", "contact mid-face found"),
}


def table(width: int) -> list[str]:
    rows = [
        Row(f"run{i}", {k: v.format(3 + i) for k, v in GIVEN.items()}, "finished", RESULTS, 3.0, "")
        for i in range(3)
    ]
    return sweep_table(rows, width).lines(width)


@pytest.mark.parametrize("width", [80, 100])
def test_six_keys_leave_room_for_the_results(width: int) -> None:
    lines = table(width)
    assert max(map(len, lines)) <= width
    first = next(line for line in lines if "speed 3 m/min" in line)
    assert first.split()[3:7] == ["4.80", "1226.8", "2.4", "1900"]
    text = "\n".join(lines)
    for key, value in (("superheat", "40 K"), ("taper", "1 percent/m"), ("interval", "0.1 s")):
        assert f"{key} {value}" in text
    below = " ".join(text.split())
    assert "not shown, but in sweep.csv: " in below and "contact mid-face found" in below
