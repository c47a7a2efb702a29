"""Libraries of the jobs, for the process that the workers are forked from: they lie in memory once.

None of them may start a thread, which would not be there after a fork; polars does.
"""

import gc

from quadctl.logs.memory import return_freed_memory

return_freed_memory()
gc.collect()
gc.freeze()  # a collection would write to every object, and so make a copy of its page
