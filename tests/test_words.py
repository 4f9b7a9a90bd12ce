"""Names and prose use the terms of the field: the project's former private words stay away."""

from __future__ import annotations

import io
import re
import tokenize
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Private words, as parts of names in the code, and the terms of the field for them.
IN_NAMES = {
    "archive": "checkpoint",
    "chief": "headline, main",
    "course": "time history",
    "doubt": "warning",
    "doubts": "warnings",
    "former": "existing run",
    "leg": "sub-steps",
    "legs": "sub-steps",
    "march": "time loop",
    "marched": "run state",
    "modes": "generalized strains",
    "mush": "mushy zone",
    "passage": "extremes in the mould",
    "rub": "has friction",
    "rubs": "has friction",
    "scene": "simulation",
    "settled": "converged",
    "steepest": "cap",
    "unsettled": "not converged",
}
# Words that no sentence about casting needs.
IN_PROSE = ("chief", "march", "marched", "marches", "marching", "passage", "passages", "rub",
            "rubs", "scene", "scenes")  # fmt: skip
# Keys of a case keep their names.
KEYS = {"mush", "settled", "steepest"}
# Has the names in files of earlier versions, next to the present ones.
EARLIER = ROOT / "castfem" / "runs" / "output" / "summary_file.py"


def sources() -> list[Path]:
    return [p for folder in ("castfem", "forms", "meshes") for p in (ROOT / folder).rglob("*.py")]


def names(path: Path) -> dict[str, int]:
    """Return each name in a file, with a line that contains it."""
    text = io.StringIO(path.read_text(encoding="utf-8"))
    every = tokenize.generate_tokens(text.readline)
    return {token.string: token.start[0] for token in every if token.type == tokenize.NAME}


def test_names_in_the_code_are_terms_of_the_field() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}: {IN_NAMES[part.lower()]}"
        for path in sources()
        for name, line in names(path).items()
        for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)
        if part.lower() in IN_NAMES and name not in KEYS
    ]
    assert not found, "\n".join(found)


def test_prose_is_that_of_the_field() -> None:
    own = re.compile(rf"\b({'|'.join(IN_PROSE)})\b", re.IGNORECASE)
    pages = [*sources(), *(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in pages
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if own.search(line) and path != EARLIER
    ]
    assert not found, "\n".join(found)


def test_keys_that_keep_their_names_are_keys() -> None:
    page = (ROOT / "docs" / "case_files.md").read_text(encoding="utf-8")
    assert all(f"| `{key}` |" in page for key in KEYS)
