"""MCAP recordings.

``records``   framing: lengths checked, nothing beyond the end of the file
``chunks``    one chunk: unpacked within bounds, its messages found, come what may
``delivery``  channel ids of a file -> topics
``indexed``   the fast path, for files that prove to be whole
``scan``      the careful path, for all others
``reader``    :func:`read_mcap`: files and folders -> Log
"""

from vehnav.logs.mcap.reader import read_mcap

__all__ = ["read_mcap"]
