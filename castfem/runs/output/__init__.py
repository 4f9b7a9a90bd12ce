"""The files of a run, written by one process, without MPI or DOLFINx.

h5py, pandas and matplotlib are imported when needed. A failed write raises `RunFailure` and leaves
the previous file; a failed read raises `InputError`.
"""
