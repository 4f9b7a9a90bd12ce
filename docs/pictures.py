"""Makes the README's picture: runs the shipped billet and shrinks what `castfem show` draws.

Run it by `.castfem/bin/python docs/pictures.py`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

from castfem import march
from castfem.case import load_case
from castfem.output.figures import draw_figures

HERE = Path(__file__).parent
WIDTH, COLOURS = 900, 96  # pixels in all, and a palette that keeps the file small
PAIR = ("temperature", "shell")


def main() -> None:
    """Put the temperature at the mould's exit and the growth of the shell side by side."""
    case = load_case(HERE.parent / "cases" / "billet125" / "idealised.toml")
    with tempfile.TemporaryDirectory() as folder:
        march.run(case, folder)
        drawn = {path.stem: path for path in draw_figures(folder)}
        pictures = [Image.open(drawn[name]).convert("RGB") for name in PAIR]
        height = min(p.height for p in pictures)
        scaled = [p.resize((round(p.width * height / p.height), height)) for p in pictures]
        sheet = Image.new("RGB", (sum(p.width for p in scaled), height), "white")
        left = 0
        for picture in scaled:
            sheet.paste(picture, (left, 0))
            left += picture.width
        size = (WIDTH, round(sheet.height * WIDTH / sheet.width))
        small = sheet.resize(size, Image.Resampling.LANCZOS).quantize(COLOURS)
        small.save(HERE / "figures" / "billet.png", optimize=True)


if __name__ == "__main__":
    main()
