"""Constants of nature and of units."""

ZERO_CELSIUS = 273.15  # K
STEFAN_BOLTZMANN = 5.670374419e-8  # W/m2K4, CODATA 2018
ZERO_STRENGTH = 0.75
"""Solid fraction at which steel has no strength yet, at its zero strength temperature [M]."""
