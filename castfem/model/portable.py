"""A case that takes its own property files along, so that it runs again wherever it is put."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.model.document import PROPERTY_FILES, is_path

if TYPE_CHECKING:
    from castfem.model.load import AnyCase


def portable(case: AnyCase, beside: str) -> tuple[str, dict[str, bytes]]:
    """Return a case file, and the contents of the property files that belong beside it.

    Args:
        case: The case; the files it names are read.
        beside: Name of the folder for copies of them, in that of the case file.

    Returns:
        TOML as of `resolved_toml`, in which files of the user's are named relative to it:
        "properties/steel/mine.toml". Those names, and what is to be written under them.

    Raises:
        InputError: A file cannot be read.
    """
    import tomli_w

    tables, files = case.document(), {}
    for table, key in PROPERTY_FILES:
        name = tables.get(table, {}).get(key)
        if not isinstance(name, str) or not is_path(name):
            continue
        source = Path(name)
        kind = table if key == "name" else key
        try:
            content = source.read_bytes()
        except OSError as error:
            raise InputError(f"{table}.{key}: {name}: cannot be read ({error.strerror})") from error
        tables[table][key] = place = f"{beside}/{kind}/{source.name}"
        files[place] = content
    return tomli_w.dumps(tables), files
