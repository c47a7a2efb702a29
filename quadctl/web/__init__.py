"""The pages in the browser: the lab (`page`) and the live view of a flight (`live`).

Flight logs, vehicle files and clicks come in; a page, model files, session files and reports go out. From the bottom:
`elements` and `port`, which both pages share; `session`, `work`, `figures`; `workbench` (what can be done) and `panels`
(what is shown), which do not know each other; `page`, which connects these two.
"""
