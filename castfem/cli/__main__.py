"""`python -m castfem.cli`."""

from castfem.cli import main

main()
