"""The error of each number of a case: from runs on other meshes, with other steps and windows.

levels    cells and windows of a run by one word
sizes     what the numbers of a case depend on: mesh, step, coupling window; a case with others
ladder    which runs tell the error of a case
estimate  from values at several sizes to an error
table     error.json, and the errors put beside the results of a run
proposal  which sizes reach an error, and how long that takes
"""
