"""What a run writes and what is shown of it: plain files, written by one process.

Nothing here knows MPI or DOLFINx; h5py, pandas and matplotlib are imported when they are needed.

    folder      the folder of a run, its lock, run.json
    xdmf        fields over time for ParaView;  fields  reads them back
    history     one row a step
    checkpoint  the state to resume from
    summary     results beside references;  results  names them;  show  prints them
    figures     pictures, from the files alone
"""
