"""The commented case file that `castfem init` writes."""

from __future__ import annotations

STARTER = """\
# A case of castfem. Run it with:      castfem run {file}
# Check it without running it:         castfem check {file}
# All keys are described in docs/case_files.md; `castfem schema` helps editors to complete them.
# Quantities are texts with their unit; a temperature is "160 degC", a difference is "40 K".

title = "{title}"

[casting]
speed = "1.2 m/min"
length = "3 m"                        # followed from the meniscus
superheat = "25 K"                    # or: temperature = "1540 degC"

[steel]
name = "plain_carbon"                 # by its composition, wt%; or a file: "./steel.toml"
composition = {{ C = 0.12, Mn = 0.5, Si = 0.25 }}

[section]
shape = "rectangle"                   # or round, beam_blank, strip
width = "200 mm"
height = "160 mm"
corner_radius = "6 mm"
symmetry = "quarter"                  # or half, whole

[mesh]
surface_size = "0.7 mm"               # at the surface, normal to it
corner_size = "0.7 mm"                # along the surface, at a corner
face_size = "8 mm"                    # along the surface, at mid-face
core_size = "10 mm"
order = 2                             # cells that follow the round corner

# Zones in casting order. Several heat laws on one surface add up.
[[cooling]]
name = "mould"
to = "800 mm"

[[cooling.surface]]
law = "contact"
coefficient = "1600 W/(m^2 K)"
# Or as it is measured, without the coefficient: a flux, scaled to the mould's water
# (docs/thermal.md):
# flux = "savage_pritchard"
# water = "1500 L/min"
# water_rise = "7 K"
# measured_at = "1.2 m/min"           # the speed at which it is so much
wall = "160 degC"
gap_conductivity = "0.15 W/(m K)"     # of what fills the gap that opens in [mould]

[[cooling]]
name = "spray"
to = "2 m"

[[cooling.surface]]
law = "spray"
water = "3 L/(m^2 s)"                 # or that of the zone: flow = "60 L/min"
water_temperature = "25 degC"
correlation = "nozaki"
machine_factor = 4

[[cooling.surface]]                   # the spray is the water's alone
law = "radiation"
emissivity = 0.8
ambient = "25 degC"

[[cooling]]
name = "air"                          # the last zone goes on to the end

[[cooling.surface]]
law = "radiation"
emissivity = 0.8
ambient = "25 degC"

[[cooling.surface]]
law = "convection"
ambient = "25 degC"

# A coefficient may be a table over temperature, here or in a file ({{ file = "h.csv" }}).
[cooling.surface.coefficient]
temperature = [400, 800, 1200]
temperature_unit = "degC"
value = [9, 10, 12]
unit = "W/(m^2 K)"

# Take the # away to strain the strand as well, in a mould with walls (docs/mould.md).
# [mechanics]
# law = "kozlowski_zhu"                 # goes by the carbon of the steel
#
# [mould]
# length = "800 mm"                     # from the meniscus to its end
# taper = "1 %/m"

[thermal.time]
adaptive = {{ tolerance = "0.5 K", largest = "1 s" }}    # or: step = "50 ms"

[output]
fields = ["temperature", "solid_fraction"]
every = "5 s"
"""


def starter(file: str, title: str) -> str:
    """Return a starter case file for the given file name."""
    return STARTER.format(file=file, title=title)
