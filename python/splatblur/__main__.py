"""`python -m splatblur` is the program `splatblur`."""

from ._cli import main

main()
