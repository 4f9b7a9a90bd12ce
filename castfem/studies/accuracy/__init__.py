"""Errors of the results of a case, from runs on other meshes, with other steps and windows."""
