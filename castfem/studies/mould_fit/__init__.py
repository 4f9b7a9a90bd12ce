"""A strand and its mould fitted to each other: runs in memory, again and again.

    found = follow(case, MPI.COMM_WORLD)          # flux and outline of the strand on its way
    turns = hot_mould_of(case, MPI.COMM_WORLD)    # with the wall that its heat distorts

A run imports nothing of this.
"""
