"""Constants of nature and of units."""

ZERO_CELSIUS = 273.15  # K
STEFAN_BOLTZMANN = 5.670374419e-8  # W/m2K4, CODATA 2018
