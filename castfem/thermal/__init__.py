"""The thermal problem: laws of surface cooling, the enthalpy solver, time stepping."""
