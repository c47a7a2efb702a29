"""`python -m quadctl`: the same as the command `quadctl`."""

from quadctl.cli import main

main()
