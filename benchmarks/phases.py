"""Heat of a steel by a thermodynamic database beside the built-in formulas; a billet with both.

Steel of 0.17 % C by the Fe-C database among pycalphad's tests, which anybody has. Writes tables of
docs/materials.md; its runs are kept in results/phases. `--quick` takes a table that is stored
among the tests, and no pycalphad.
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.units import convert
from castfem.model import load_case
from castfem.model.shipped_cases import find
from castfem.physics.materials import load_steel
from castfem.physics.materials.phase_table import Request

CARBON = {"C": 0.17}
FROM = 1600.0  # degC
TEMPERATURES = (1530, 1520, 1510, 1500, 1480, 1400, 1200, 1000, 900, 800, 700, 600, 400, 200, 25)
RESULTS = {
    "heat_removed": ("heat removed per m", "MJ/m"),
    "shell_mid_face": ("shell, mid-face", "mm"),
    "shell_corner": ("shell, corner", "mm"),
    "surface_temperature_mid_face": ("surface, mid-face", "degC"),
    "surface_temperature_corner": ("surface, corner", "degC"),
}


def database(quick: bool) -> Path:
    """The Fe-C database, or a table by it."""
    if quick:
        return ROOT / "tests" / "materials" / "fe_c_017.csv"
    import pycalphad

    return Path(pycalphad.__file__).parent / "tests" / "databases" / "cfe_broshe.tdb"


def main(output: Output, quick: bool) -> None:
    """Compare the heat of the steel, then that of the billet."""
    file = database(quick)
    steels = {
        "built_in": load_steel("plain_carbon", composition=CARBON),
        "database": load_steel(
            "plain_carbon", composition=CARBON, overrides={"database": Request(str(file))}
        ),
    }
    rows = []
    for celsius in TEMPERATURES:
        row: dict[str, float] = {"temperature": celsius}
        for name, steel in steels.items():
            heat = steel.properties["enthalpy"]
            given_off = heat(FROM + ZERO_CELSIUS) - heat(celsius + ZERO_CELSIUS)
            row[name] = float(given_off) / 1e3
            row[f"solid_{name}"] = float(steel.solid_fraction(celsius + ZERO_CELSIUS))
        row["difference"] = 100.0 * (row["database"] / row["built_in"] - 1.0)
        rows.append(row)
    output.csv("phases_heat", rows)
    output.csv("phases_billet", _billets(output, quick, file))
    show(output)


def _billets(output: Output, quick: bool, file: Path) -> list[dict[str, float | str]]:
    """Results of the billet at the end of its mould, by name of the steel."""
    found = {}
    runs = (output.folder if quick else ROOT / "results") / "phases"
    for name, more in {"built_in": (), "database": (f"steel.database={file}",)}.items():
        steel = ("steel.name=plain_carbon", "steel.composition.C=0.17", *more)
        length = ("casting.length=20 mm", "output.fields=[]") if quick else ()
        changes = [*steel, *length, "output.figures=false"]
        case = load_case(find("billet125/thermal"), changes)
        found[name] = finished_run(case, runs / name).summary.quantities
    return [
        {
            "result": label, "unit": unit,
            **{name: convert(q[key].value, q[key].unit, unit) for name, q in found.items()},
        }
        for key, (label, unit) in RESULTS.items()
    ]  # fmt: skip


def show(output: Output) -> None:
    """The tables, from the data."""
    steels = {"built_in": "built-in", "database": "database"}
    head = {
        "temperature": "down to [°C]",
        **{name: (f"{label} [kJ/kg]", ".1f") for name, label in steels.items()},
        "difference": ("difference [%]", "+.1f"),
        **{f"solid_{name}": (f"solid, {label}", ".3f") for name, label in steels.items()},
    }
    output.table("phases_heat", output.rows("phases_heat"), head)
    of_billet = {name: (label, ".4g") for name, label in steels.items()}
    head = {"result": "at the end of the mould", "unit": "unit", **of_billet}
    output.table("phases_billet", output.rows("phases_billet"), head)
