"""A worker as a program of its own: `python -m ethogram.campaign.worker DESCRIPTOR PARENT`.

It never sees the module that the program of its parent began with, so that a script needs no guard
and that standard input or a notebook will do.
"""

import sys

from ethogram.campaign.workers import serve

if __name__ == "__main__":
    serve(int(sys.argv[1]), parent=int(sys.argv[2]))
