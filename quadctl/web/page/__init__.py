"""The lab page: one `Page` for each open tab of a browser, and the server.

The state of the workbench comes in; the panels whose fields have changed are drawn again.
"""
