"""A table of cases: planned and checked as a whole, run in parallel, gathered in one table.

plan     which runs, from values for keys and from a CSV table
work     one run, in whichever process it happens
local    processes of this machine;  ranks  those of an MPI launcher
record   what is finished already
results  the table of results
view     the progress of all runs
"""
