"""The hot mould: heat conduction in its copper tube, thermal distortion, and the resulting wall.

    tube = Tube(MPI.COMM_WORLD, mesh)
    heat = Conduction(tube, copper).solve(HeatedBy(flux=...), CooledBy(...))
    shape = Distortion(tube, copper, support="hung").solve(heat.temperature)

SI units, K. Only imported by `castfem mould --hot` and similar commands, not by a run.
"""
