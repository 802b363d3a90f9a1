"""`python -m splatblur` is the program `splatblur`."""

from ._cli import main

if __name__ == "__main__":
    main()
