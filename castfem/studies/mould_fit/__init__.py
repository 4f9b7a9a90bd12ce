"""Iteration between a strand and its mould, with repeated runs in memory.

    found = follow(case, MPI.COMM_WORLD)          # flux and outline of the strand on its way
    turns = hot_mould_of(case, MPI.COMM_WORLD)    # with the wall that its heat distorts

A normal run imports nothing of this.
"""
