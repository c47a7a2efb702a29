"""The lab as a page in the browser: look, click, watch the error fall. It calls the lab; no analysis is done here."""
