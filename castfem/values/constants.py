"""Constants of nature and of units."""

ZERO_CELSIUS = 273.15  # K
