"""Tests of the manual: a package, because its file names also occur in other folders."""
