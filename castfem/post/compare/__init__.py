"""Finished runs side by side, and the tables of studies.

runs          the runs, read from their folders
table         the table, and what stands below it
figures       what figures there are;  drawing  draws them;  sections  those over the section
study_tables  what came of a sweep, and the errors of a case
"""
