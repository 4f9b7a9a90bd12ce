"""Finished runs side by side: a table of their results and figures of their histories.

runs     the runs, read from their folders
table    the table;  remarks  what stands below it
figures  what figures there are;  drawing  draws them;  sections  those over the section,
         in their  places
"""
