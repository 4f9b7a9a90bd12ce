"""The error of each number of a case: from runs on other meshes, with other steps and windows.

sizes     what the numbers of a case depend on: mesh, step, coupling window; a case with others;
          levels: cells and windows by one word
ladder    which runs tell the error of a case
estimate  from values at several sizes to an error
table     error.json, and the errors put beside the results of a run
proposal  which sizes reach an error, and how long that takes
"""
