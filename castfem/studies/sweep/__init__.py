"""A table of cases: planned and checked as a whole, run in parallel, gathered in one table.

plan       which runs, from values for keys and from a CSV table
work       one run, in whichever process it happens
workers    several at once, by any executor;  processes  those of this machine
groups     on groups of ranks;  parts  by jobs that know nothing of each other
record     what is finished already
results    the table of results
view       the progress of all runs
"""
