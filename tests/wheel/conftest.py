"""Excluded from the suite, which builds nothing: `make test-pip`."""

from __future__ import annotations

import os

collect_ignore_glob = [] if "CASTFEM_PIP" in os.environ else ["test_*.py"]
