"""Studies: the programs that write pages of `docs/`, each run by a target of the Makefile.

Papers computed again, blind cases, faults, real flights, the tutorial and the benchmarks: what comes in are public logs
or flights made here, what goes out is one page with its figures. Nothing else imports them but their own tests.
"""
