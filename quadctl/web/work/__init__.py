"""Long work: the jobs that call the lab and the simulator, and the worker process that they run in.

Models, datasets and paths come in; opened flights, evaluations, findings, step responses and reports go out. All of it
can be sent from process to process.
"""
