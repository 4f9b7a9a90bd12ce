"""Keys of a case fitted to measurements: the fit, the data, those at probes."""
