"""The error of each number of a case: from runs on other meshes, with other steps and windows."""
