"""The mould at work: heat through its copper tube, how that distorts it, and the wall it leaves.

    tube = Tube(MPI.COMM_WORLD, mesh)
    heat = Conduction(tube, copper).solve(HeatedBy(flux=...), CooledBy(...))
    shape = Distortion(tube, copper, support="hung").solve(heat.temperature)

SI units, K. Only `castfem mould --hot` and its like import it; a run does not.
"""
