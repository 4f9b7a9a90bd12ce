"""The files of a run, written by one process: plain, and without MPI or DOLFINx.

h5py, pandas and matplotlib are imported when they are needed. What cannot be written raises a
`RunFailure` and leaves the file before, what cannot be read an `InputError`.
"""
