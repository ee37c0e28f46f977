"""A recording becomes arrays: bytes in, :class:`~vehnav.logs.log.Log` out."""
