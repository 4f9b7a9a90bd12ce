"""The folder of a run with the user's own steel and law repeats the run at any location."""

from __future__ import annotations

import json
import shutil
from hashlib import sha256
from pathlib import Path

import pytest
from runs.billet_runs import billet, run

from castfem.base.errors import InputError
from castfem.cli import execute
from castfem.model.load import portable
from castfem.physics import constitutive, materials
from castfem.runs import existing_run

HISTORY = "history.csv"


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Return a folder with a steel and a law."""
    folder = tmp_path / "own"
    folder.mkdir()
    steels, sets = (
        Path(str(package.__file__)).parent / "data" for package in (materials, constitutive)
    )
    shutil.copy(steels / "carbon_042.toml", folder / "mine.toml")
    shutil.copy(sets / "kozlowski_zhu.toml", folder / "law.toml")
    return folder


def test_moved_folder_repeats_the_run(
    tmp_path: Path, own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes = f"steel.name={own}/mine.toml", f"mechanics.law={own}/law.toml"
    case = billet("taper_1", *changes, "casting.length=30 mm")
    run(case, tmp_path / "first")
    contents = {name: (own / name).read_bytes() for name in ("mine.toml", "law.toml")}
    moved = tmp_path / "elsewhere" / "run"
    shutil.move(tmp_path / "first", moved)
    shutil.rmtree(own)
    text = (moved / "case.toml").read_bytes()
    assert str(tmp_path) not in text.decode()
    record = json.loads((moved / "run.json").read_text())
    assert record["files"] == {
        "case.toml": sha256(text).hexdigest(),
        "properties/steel/mine.toml": sha256(contents["mine.toml"]).hexdigest(),
        "properties/law/law.toml": sha256(contents["law.toml"]).hexdigest(),
    }
    monkeypatch.chdir(moved)
    assert execute(["run", "case.toml", "-o", "../again", "-q"]) == 0
    assert (moved / HISTORY).read_bytes() == (moved.parent / "again" / HISTORY).read_bytes()
    # It is resumed, and begins again, from its own copies.
    assert execute(["run", "--resume", ".", "-q"]) == 0
    assert len(json.loads((moved / "run.json").read_text())["commands"]) == 2
    assert execute(["run", "case.toml", "-o", ".", "-q"]) == 0
    assert (moved / "properties/steel/mine.toml").read_bytes() == contents["mine.toml"]
    found = json.loads((moved / "run.json").read_text())
    assert found["files"] == record["files"] and len(found["commands"]) == 1


def test_copies_belong_to_the_run_and_spare_user_files(tmp_path: Path, own: Path) -> None:
    case = billet("thermal", f"steel.name={own}/mine.toml", "casting.length=6 mm")
    theirs = tmp_path / "out" / "properties" / "steel" / "mine.toml"
    theirs.parent.mkdir(parents=True)
    theirs.write_text("of the user")
    with pytest.raises(InputError, match=r"holds properties/steel/mine\.toml, not of a run"):
        run(case, tmp_path / "out")
    assert theirs.read_text() == "of the user"
    theirs.unlink()
    (theirs.parent / "notes").write_text("of the user")
    run(case, tmp_path / "out")
    assert theirs.read_bytes() == (own / "mine.toml").read_bytes()
    run(billet("thermal", "casting.length=6 mm"), tmp_path / "out")
    assert [p.name for p in (tmp_path / "out" / "properties").rglob("*")] == ["steel", "notes"]


def test_refused_resume_leaves_the_copies(tmp_path: Path, own: Path) -> None:
    case = billet("thermal", f"steel.name={own}/mine.toml", "casting.length=6 mm")
    run(case, tmp_path / "out")
    before = {p: p.read_bytes() for p in (tmp_path / "out").rglob("*.*") if p.suffix != ".log"}
    with (own / "mine.toml").open("a") as file:
        file.write("# changed")
    with pytest.raises(InputError, match="belongs to another case"):
        run(case, tmp_path / "out", resume=True)
    after = {p: p.read_bytes() for p in (tmp_path / "out").rglob("*.*") if p.suffix != ".log"}
    assert after == before


def test_property_files_are_compared_by_contents(tmp_path: Path, own: Path) -> None:
    """A folder has copies: their location is no difference."""
    case = billet("thermal", f"steel.name={own}/mine.toml")
    folder = tmp_path / "out"
    text, files = portable(case, "properties")
    for name, content in {"case.toml": text.encode(), **files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    existing_run.check(folder, case, resume=False, overwrite=False)

    def difference(*changes: str) -> str:
        with pytest.raises(InputError) as refused:
            existing_run.check(folder, billet("thermal", *changes), resume=False, overwrite=False)
        return str(refused.value).partition("another case (")[2].partition(");")[0]

    mine = f"steel.name={own}/mine.toml"
    assert (
        difference(mine, "casting.speed=3 m/min") == "casting.speed: 3.6 m/min there, 3 m/min here"
    )
    (own / "other.toml").write_bytes((own / "mine.toml").read_bytes() + b"# changed")
    other = f"steel.name={own}/other.toml"
    assert difference(other) == "steel.name: mine.toml there, other.toml here"
    (own / "mine.toml").write_bytes((own / "other.toml").read_bytes())
    assert difference(mine) == "steel.name: other contents there, mine.toml here"
